"""The visitor's process ends when its input closes, and what others print is no answer."""

import asyncio
import json
import subprocess
import sys

import pytest

from sklearn_pgnn.cli.app.visitor import Stages, Visitor
from sklearn_pgnn.cli.app.work import MODULE, Refused

pytestmark = pytest.mark.core


@pytest.mark.slow
def test_the_process_ends_with_its_input_and_answers_in_lines(tmp_path):
    command = [sys.executable, "-m", MODULE]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, cwd=tmp_path, text=True, **pipes) as process:
        process.stdin.write('{"do": "system", "system": "two-tanks"}\n')
        process.stdin.write('{"do": "system", "system": "none"}\n')
        process.stdin.write('{"do": "look", "files": [], "mapping": 3, "options": {}}\n')
        process.stdin.flush()
        told = [json.loads(process.stdout.readline()) for _ in range(3)]
        process.stdin.close()
        assert process.wait(timeout=60) == 0
    assert told[0]["done"]["name"] == "two tanks"
    assert told[1]["refused"].startswith("expected one of the systems")
    assert told[2] == {"stage": "reading the records", "step": 0, "steps": 1}


def test_a_file_that_arrives_when_a_diagnosis_has_begun_does_not_end_it():
    visitor = Visitor()
    number = visitor.new_number()
    visitor.running = going_on = Stages("diagnose")
    with pytest.raises(Refused, match=r"A diagnosis is running: wait for it, or stop it first\."):
        asyncio.run(visitor.take_record(number, "late.csv", b"t,v\n0,1\n"))
    assert visitor.running is going_on
    assert visitor.records == []


def test_files_that_arrive_together_count_together(monkeypatch):
    monkeypatch.setattr("sklearn_pgnn.cli.app.visitor.ALL_BYTES", 10)
    visitor = Visitor()
    one, other = visitor.new_number(), visitor.new_number()
    asyncio.run(visitor.take_record(one, "a.csv", b"t,v\n0,1"))
    with pytest.raises(Refused, match="Expected at most 1e-05 MB in all files of records"):
        asyncio.run(visitor.take_record(other, "b.csv", b"t,v\n0,1"))
