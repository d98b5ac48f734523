"""The command as a process: what cannot be written, and an end that waits for nobody."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from test_cli import write

from sklearn_pgnn.cli import main

pytestmark = pytest.mark.core
posix = pytest.mark.skipif(os.name != "posix", reason="signals and devices are those of POSIX")

#: a command that leaves a worker behind, busy with what nobody needs
LEAVING = """
import os, sys, time
from joblib import Parallel, delayed
from sklearn_pgnn.cli.ending import run_to_the_end
from sklearn_pgnn.threads import end_with_parent

def work(at):
    end_with_parent()
    open(f"{sys.argv[1]}/{os.getpid()}", "w").close()
    time.sleep(600 * (at > 1))
    return at

def command():
    made = Parallel(2, return_as="generator", batch_size=1)(delayed(work)(at) for at in range(4))
    print(next(made), flush=True)
    kept.append(made)
    while sys.argv[2:] == ["stay"]:
        time.sleep(1)
    raise SystemExit(0)

kept = []
run_to_the_end(command)
"""


def environment(**more):
    paths = [str(Path(path).absolute()) for path in sys.path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), **more}


def call(*args, **more):
    command = [sys.executable, "-m", "sklearn_pgnn", *map(str, args)]
    return subprocess.run(command, env=environment(), check=False, text=True, **more)


@pytest.mark.slow
@posix
def test_a_finished_command_waits_for_no_worker(tmp_path):
    script = tmp_path / "leaving.py"
    script.write_text(LEAVING)
    done = subprocess.run(
        [sys.executable, script, tmp_path],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (done.returncode, done.stdout) == (0, "0\n")
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="processes are seen in /proc")
def test_workers_end_when_their_parent_is_killed(tmp_path):
    script = tmp_path / "leaving.py"
    script.write_text(LEAVING)
    begun = tmp_path / "begun"
    begun.mkdir()
    command = [sys.executable, script, begun, "stay"]
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True) as job:
        assert job.stdout.readline() == "0\n"
        while len(workers := os.listdir(begun)) < 2:
            time.sleep(0.1)
        job.kill()
    until = time.monotonic() + 100
    while any(is_alive(pid) for pid in workers):
        assert time.monotonic() < until
        time.sleep(0.2)


def is_alive(pid):
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


@posix
def test_a_signal_after_the_end_has_no_traceback():
    code = (
        "import os, signal, threading, time\n"
        "from sklearn_pgnn.cli.ending import run_to_the_end\n"
        "def command():\n"
        "    threading.Thread(target=time.sleep, args=(600,)).start()\n"
        "    raise SystemExit(0)\n"
        "threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "run_to_the_end(command)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
@pytest.mark.parametrize("args", [["--help"], ["completion", "bash"]])
def test_a_stream_that_takes_nothing_is_told_in_one_line(args):
    with open("/dev/full", "w") as full:
        done = call(*args, stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 2
    assert done.stderr == "Error: output: No space left on device.\n"


@pytest.mark.slow
@posix
@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-", "<&-"])
def test_a_closed_stream_takes_everything(closed):
    command = f"{sys.executable} -m sklearn_pgnn completion bash {closed}"
    done = subprocess.run(command, shell=True, env=environment(), capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@posix
def test_what_reads_no_more_ends_the_command_without_a_word():
    command = f"{sys.executable} -m sklearn_pgnn completion bash | head -c 1 > /dev/null"
    done = subprocess.run(command, shell=True, env=environment(), capture_output=True, text=True)
    assert done.stderr == ""


@pytest.mark.slow
def test_a_terminal_in_ascii_shows_question_marks(tmp_path):
    write(tmp_path)
    text = re.sub(r"(?m)^name: .*$", "name: Wägen", (tmp_path / "cart.yaml").read_text())
    (tmp_path / "cart.yaml").write_text(text, encoding="utf-8")
    args = ["check", "--model", str(tmp_path / "cart.yaml"), str(tmp_path / "a.csv")]
    result = CliRunner(charset="ascii").invoke(main, [*args, "--quiet"])
    assert result.exit_code == 0, result.stderr
    assert "W?gen" in result.stdout


# -- names and places ------------------------------------------------------------------------------


def refused(args):
    result = CliRunner().invoke(main, [*map(str, args), "--quiet"])
    assert result.exit_code == 2, result.output
    return result.stderr


def test_an_output_that_cannot_be_one_is_no_bug(tmp_path):
    args = write(tmp_path)
    assert "got an empty text" in refused([*args, "--output", ""])
    said = refused([*args, "--output", tmp_path / ("a" * 300)])
    assert said.endswith("...: File name too long.\n")
    assert len(said.splitlines()) == 1
    (tmp_path / "out" / "report.html").mkdir(parents=True)
    assert "expected no folder of the name report.html" in refused([*args, "--force"])


@posix
def test_a_link_to_nothing_is_refused(tmp_path):
    args = write(tmp_path)
    (tmp_path / "out").symlink_to(tmp_path / "nowhere")
    assert "got a link to nothing" in refused(args)


@posix
@pytest.mark.parametrize("made", ["pipe", "device"])
def test_a_model_file_without_an_end_is_refused(tmp_path, made):
    write(tmp_path)
    path = tmp_path / "pipe" if made == "pipe" else Path("/dev/zero")
    if made == "pipe":
        os.mkfifo(path)
    said = refused(["check", "--model", path, tmp_path / "a.csv"])
    assert said.startswith(f"Error: {path}:1:1: expected a model file, got: a pipe or a device. (")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
def test_a_file_whose_name_is_no_text_is_used(tmp_path):
    args = write(tmp_path)
    odd = os.fsencode(tmp_path) + b"/r\xff.csv"
    Path(os.fsdecode(odd)).write_bytes((tmp_path / "a.csv").read_bytes())
    result = CliRunner().invoke(main, [*args, os.fsdecode(odd), "--quiet"])
    assert result.exit_code == 0, result.output
    assert "r?.csv" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
