"""The visitor's process ends when its input closes, and what others print is no answer."""

import json
import subprocess
import sys

import pytest

from sklearn_pgnn.cli.app.work import MODULE

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
