"""The visitor's process ends when its input closes, and what others print is no answer."""

import asyncio
import json
import subprocess
import sys

import pytest

from sklearn_pgnn.cli.app import jobs
from sklearn_pgnn.cli.app.visitor import Stages, Visitor
from sklearn_pgnn.cli.app.work import MODULE, NO_MEMORY, Refused
from sklearn_pgnn.exceptions import ModelError

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


GREEDY = """
import sys
from sklearn_pgnn.cli.app.worker import Answers, answer, limit_memory
limit_memory(4 * 10**9)
answer({"do": "greedy"}, Answers(sys.stdout), {"greedy": lambda _: bytearray(5 * 10**9)})
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory has a limit on Linux")
def test_work_that_needs_too_much_memory_says_so():
    done = subprocess.run([sys.executable, "-c", GREEDY], capture_output=True, text=True)
    assert json.loads(done.stdout)["refused"] == NO_MEMORY
    assert "needed more than 8 GB of memory. Remedy:" in NO_MEMORY


def test_a_file_that_arrives_when_a_diagnosis_has_begun_does_not_end_it(tmp_path):
    visitor = Visitor(tmp_path)
    number = visitor.new_number()
    visitor.running = going_on = Stages("diagnose")
    with pytest.raises(Refused, match=r"A diagnosis is running: wait for it, or stop it first\."):
        asyncio.run(visitor.take_record(number, "late.csv", b"t,v\n0,1\n"))
    assert visitor.running is going_on
    assert visitor.records == []


def test_files_that_arrive_together_count_together(tmp_path, monkeypatch):
    monkeypatch.setattr("sklearn_pgnn.cli.app.visitor.ALL_BYTES", 10)
    visitor = Visitor(tmp_path)
    one, other = visitor.new_number(), visitor.new_number()
    asyncio.run(visitor.take_record(one, "a.csv", b"t,v\n0,1"))
    with pytest.raises(Refused, match="Expected at most 1e-05 MB in all files of records"):
        asyncio.run(visitor.take_record(other, "b.csv", b"t,v\n0,1"))


def test_a_model_of_a_robot_in_another_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jobs.NEW.write_text("robot: {file: ../arm.urdf}\n")
    said = r"mine.yaml: expected a model that is whole, got one of a robot in '../arm.urdf'. Remedy"
    with pytest.raises(ModelError, match=said):
        jobs.take_model(lambda *_: None, "mine.yaml")
    assert not jobs.MODEL.exists()
