"""Files that are written whole: what they hold, who may read them, what a failure leaves."""

import os
import stat
import subprocess
import sys
import time

import pytest

from sklearn_pgnn.whole_file import (
    PRIVATE,
    UNFINISHED,
    YOUNG,
    WorkingFolder,
    remove_leftovers,
    write_whole,
)

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


# -- what killed processes leave -------------------------------------------------------------------

posix = pytest.mark.skipif(os.name != "posix", reason="nothing tells there whose process is gone")
HOLDING = """
import sys, time
from pathlib import Path
from sklearn_pgnn.whole_file import WorkingFolder
print(WorkingFolder(Path(sys.argv[1])).path, flush=True)
time.sleep(600)
"""


def aged(path):
    then = time.time() - 2 * YOUNG
    os.utime(path, (then, then))


@posix
def test_a_folder_is_a_leftover_when_its_process_was_killed_and_not_before(tmp_path):
    told = {**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    command = [sys.executable, "-c", HOLDING, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=told) as job:
        path = job.stdout.readline().strip()
        aged(path)
        remove_leftovers(tmp_path)
        assert os.listdir(tmp_path) == [os.path.basename(path)]
        job.kill()
    aged(path)
    WorkingFolder(tmp_path).remove()
    assert os.listdir(tmp_path) == []


@posix
def test_what_is_young_or_has_another_name_or_is_a_link_is_no_leftover(tmp_path):
    kept = [tmp_path / f"{UNFINISHED}young", tmp_path / "old", tmp_path / f"{UNFINISHED}link"]
    for path in kept[:2]:
        path.mkdir()
    aged(kept[1])
    kept[2].symlink_to(kept[1])
    remove_leftovers(tmp_path)
    assert all(path.exists() for path in kept)


@posix
def test_a_file_that_was_half_written_is_a_leftover(tmp_path):
    half = tmp_path / f"{UNFINISHED}0123"
    half.write_text("half")
    aged(half)
    remove_leftovers(tmp_path)
    assert os.listdir(tmp_path) == []


def test_a_name_as_long_as_the_file_system_takes_is_written(tmp_path):
    write_whole(tmp_path / ("a" * 255), "text")
    assert (tmp_path / ("a" * 255)).read_text() == "text"
