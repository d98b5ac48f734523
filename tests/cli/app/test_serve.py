"""The page is opened by a file that only its user reads: arguments of programs are seen by all."""

import os
import stat
import tempfile
from pathlib import Path

import pytest

pytest.importorskip("uvicorn")
pytest.importorskip("starlette")

from sklearn_pgnn.cli.app import serve


class Server:
    def run(self, sockets):
        for each in sockets:
            each.close()


def test_the_address_is_printed_and_opened_without_telling_it_to_others(
    tmp_path, monkeypatch, capsys
):
    opened = []

    def launch(path):
        opened.append((path, Path(path).read_text(), Path(path).parent.stat().st_mode))

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(serve.click, "launch", launch)
    monkeypatch.setattr(serve, "make_server", lambda *_: Server())
    serve.serve(0, opens=True, quiet=True)
    url = capsys.readouterr().out.strip()
    assert url.startswith("http://127.0.0.1:")
    secret = url.split("/")[3]
    assert len(secret) >= 32
    ((path, page, mode),) = opened
    assert secret not in path
    assert f"url={url}" in page
    assert os.name == "nt" or not mode & (stat.S_IRWXG | stat.S_IRWXO)
    assert list(tmp_path.iterdir()) == []


def test_who_it_is_for_is_said(monkeypatch, capsys):
    monkeypatch.setattr(serve, "make_server", lambda *_: Server())
    serve.serve(0, opens=False, quiet=False)
    assert "whoever has this address has the session" in capsys.readouterr().out
