"""Files that are written whole: what they hold, who may read them, what a failure leaves."""

import os
import stat

import pytest

from sklearn_pgnn.whole_file import PRIVATE, write_whole

pytestmark = pytest.mark.core


@pytest.fixture
def mask():
    before = os.umask(0o027)
    yield 0o027
    os.umask(before)


def mode_of(path):
    return stat.S_IMODE(path.stat().st_mode)


def test_a_text_keeps_its_ends_of_line_and_bytes_are_bytes(tmp_path):
    write_whole(tmp_path / "text", "a\nµ\r\n")
    write_whole(tmp_path / "bytes", b"\x00\r\n")
    assert (tmp_path / "text").read_bytes() == "a\nµ\r\n".encode()
    assert (tmp_path / "bytes").read_bytes() == b"\x00\r\n"


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps permissions otherwise")
def test_permissions_are_those_of_any_new_file_unless_it_is_private(tmp_path, mask):
    write_whole(tmp_path / "usual", "")
    write_whole(tmp_path / "private", "", PRIVATE)
    assert mode_of(tmp_path / "usual") == 0o666 & ~mask
    assert mode_of(tmp_path / "private") == 0o600


def test_the_mask_of_the_process_is_left_alone(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(os, "umask", asked.append)
    write_whole(tmp_path / "text", "of one thread")
    assert asked == []


def test_what_was_there_stays_where_writing_fails_and_nothing_is_left_beside(tmp_path, monkeypatch):
    write_whole(tmp_path / "text", "before")

    def fail(*_):
        raise OSError("no room")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="no room"):
        write_whole(tmp_path / "text", "after")
    assert os.listdir(tmp_path) == ["text"]
    assert (tmp_path / "text").read_text() == "before"
