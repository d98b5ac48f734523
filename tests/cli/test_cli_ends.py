"""How the command line ends when something is in its way: internal errors, signals, a full disk."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import warnings

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console
from test_cli import FILES, table, write

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.ending import check, held, stoppable
from sklearn_pgnn.cli.output import result_folder
from sklearn_pgnn.exceptions import DiagnosisWarning, RecordError, SimulationError
from sklearn_pgnn.progress_display import EVERY, Lines, _bars, _Live

#: as from a terminal: a job in the background would ignore Ctrl-C
CALL = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from sklearn_pgnn.cli import main
main(sys.argv[1:])
"""


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """What a diagnosis knows after a fit."""
    folder = tmp_path_factory.mktemp("fitted")
    write(folder)
    rows = table()
    diagnosis = ModelDiagnosis(
        PhysicsModel.from_yaml(folder / "cart.yaml"), catalogue=(effects.CoulombFriction,)
    )
    return vars(diagnosis.fit(rows[["t", "F"]], rows[["speed"]]))


@pytest.fixture
def breaking(monkeypatch):
    """Let `fit` break down with an error, or a stage of it after it learned what it is told."""

    def arrange(error, learned=None):
        def fit(self, X, y):
            if learned is None:
                raise error
            vars(self).update(learned)
            warning = DiagnosisWarning("a stage of the diagnosis failed")
            warning.__cause__ = error
            warnings.warn(warning, stacklevel=1)
            return self

        monkeypatch.setattr(ModelDiagnosis, "fit", fit)

    return arrange


@pytest.fixture
def found(monkeypatch, fitted):
    """Let `fit` find at once what a diagnosis knows after a fit."""
    monkeypatch.setattr(ModelDiagnosis, "fit", lambda self, X, y: vars(self).update(fitted) or self)


def run(args):
    return CliRunner().invoke(main, args)


# -- errors ----------------------------------------------------------------------------------------

BUGS = [np.linalg.LinAlgError("SVD did not converge"), ValueError("cannot reshape"), KeyError("v")]


@pytest.mark.parametrize("error", BUGS, ids=lambda e: type(e).__name__)
def test_a_bug_of_ours_is_called_one(tmp_path, breaking, error):
    args = write(tmp_path)
    breaking(error)
    result = run([*args, "--quiet"])
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1
    for text in ("a bug in sklearn-pgnn", f"{type(error).__name__}: {error}", "--debug", "report"):
        assert text in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("error", [RecordError("too short"), SimulationError("left the numbers")])
def test_our_own_errors_are_about_the_input(tmp_path, breaking, error):
    args = write(tmp_path)
    breaking(error)
    result = run([*args, "--quiet"])
    assert result.exit_code == 2
    assert result.stderr.startswith(f"Error: {error} (see: sklearn-pgnn explain ")


def test_debug_shows_the_traceback_with_the_same_exit_code(tmp_path, breaking):
    args = write(tmp_path)
    for error, code in ((ZeroDivisionError("by zero"), 1), (RecordError("too short"), 2)):
        breaking(error)
        result = run([*args, "--debug"])
        assert result.exit_code == code
        assert "Traceback" in result.stderr
        assert "in fit" in result.stderr
        assert result.stderr.splitlines()[-1].startswith("Error: ")


def test_what_was_found_before_a_bug_is_kept(tmp_path, breaking, fitted):
    args = write(tmp_path)
    why = "unexpected LinAlgError: SVD did not converge, at 'cause 2'"
    breaking(np.linalg.LinAlgError("SVD did not converge"), {**fitted, "stopped_": why})
    result = run([*args, "--quiet"])
    assert result.exit_code == 3
    assert len(result.stderr.splitlines()) == 1
    assert "LinAlgError: SVD did not converge" in result.stderr
    assert f"The results so far are in {tmp_path / 'out'}: {', '.join(FILES)}." in result.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    data = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert data["stopped"] == why
    assert data["causes"][0]["effect"] == "coulomb_friction"


def test_a_bug_in_the_report_leaves_the_other_files(tmp_path, monkeypatch, found):
    args = write(tmp_path)
    monkeypatch.setattr("sklearn_pgnn.cli.diagnose.render_report", lambda *_: 1 / 0)
    result = run([*args, "--quiet"])
    assert result.exit_code == 3
    assert "ZeroDivisionError" in result.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES[:2]


@pytest.mark.parametrize("lost", ["all_members", "residual_tests", "dot_plot", "correlation"])
def test_a_part_of_the_report_that_fails_leaves_the_rest_of_it(tmp_path, monkeypatch, found, lost):
    args = write(tmp_path)
    monkeypatch.setattr(f"sklearn_pgnn.inspection.report.content.{lost}", lambda *_: 1 / 0)
    result = run([*args, "--quiet"])
    assert result.exit_code == 3
    assert "ZeroDivisionError" in result.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    assert "Coulomb friction" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_full_disk_is_no_bug(tmp_path, monkeypatch, found):
    args = write(tmp_path)

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_text", full)
    result = run([*args, "--quiet"])
    assert result.exit_code == 2
    assert "No space left on device" in result.stderr
    assert not (tmp_path / "out").exists()


# -- signals ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows ends a process without asking it")
@pytest.mark.parametrize(
    ("number", "at"),
    [
        (signal.SIGINT, "loading"),
        (signal.SIGTERM, "reading"),
        (signal.SIGTERM, "cause 1"),
        (signal.SIGINT, "cause 1"),
        (signal.SIGTERM, "writing the report"),
    ],
    ids=lambda value: getattr(value, "name", str(value).split()[0]),
)
def test_a_signal_leaves_nothing_behind(tmp_path, number, at):
    args = write(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    command = [sys.executable, "-c", CALL, *args]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as job:
        assert any(at in line for line in job.stderr)
        job.send_signal(number)
        out, err = job.communicate(timeout=120)
    assert job.returncode == 128 + number
    assert out == ""
    assert err.splitlines()[-1] == f"Stopped by {number.name}."
    assert ("--time-limit SECONDS" in err) == (at == "cause 1")
    assert "Traceback" not in err
    assert sorted(tmp_path.rglob("*")) == before


def come():
    signal.raise_signal(signal.SIGTERM)


def test_a_signal_waits_for_what_must_be_whole():
    done = []

    def work():
        with stoppable():
            with held():
                come()
                done.append("whole")
            done.append("more")

    with pytest.raises(SystemExit) as end:
        work()
    assert end.value.code == 128 + signal.SIGTERM
    assert done == ["whole"]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_signal_that_was_swallowed_is_heard_later():
    class Final:
        def __del__(self):
            come()

    def work():
        with stoppable():
            final = Final()
            del final
            check()
            raise AssertionError("went on")

    with pytest.raises(SystemExit):
        work()


def test_handlers_are_as_before_afterwards_and_what_is_ignored_stays_so():
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with stoppable():
            come()
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job may ignore it
    try:
        with stoppable():
            assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_nothing_is_left_of_results_that_a_signal_ended(tmp_path):
    def work():
        with stoppable(), result_folder(tmp_path / "out") as folder:
            (folder / "a.txt").write_text("a")
            come()

    with pytest.raises(SystemExit):
        work()
    assert list(tmp_path.iterdir()) == []


def test_results_are_whole_though_a_signal_comes_while_they_are_put_in_place(tmp_path, monkeypatch):
    def move(file, target):
        come()
        file.rename(target)

    def work():
        with stoppable(), result_folder(tmp_path / "out") as folder:
            for name in "ab":
                (folder / name).write_text(name)

    monkeypatch.setattr("sklearn_pgnn.cli.output._move", move)
    with pytest.raises(SystemExit):
        work()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a", "b"]


# -- progress --------------------------------------------------------------------------------------


def test_the_first_word_comes_before_the_libraries():
    code = (
        "import sys\n"
        "from sklearn_pgnn.cli.guard import show_progress\n"
        "with show_progress(False) as progress: progress('loading the libraries')\n"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "loading the libraries ...\n"
    assert {"numba", "sympy", "pandas", "numpy", "scipy"}.isdisjoint(done.stdout.split())


def test_a_pipe_gets_a_line_a_stage_and_no_flood():
    lines, now = [], [0.0]
    show = Lines(lines.append, clock=lambda: now[0])
    show("reading", 0, None)
    for step in range(1001):
        now[0] += 0.01
        show("cause 1", step, 1000)
        show("folds", step % 3, 3)
    assert lines[:3] == ["reading ...", "cause 1: 0 of 1000 ...", "folds: 0 of 3 ..."]
    assert 3 < len(lines) <= 3 + 10 / EVERY
    assert ", 5 s ..." in lines[3]  # how long it has been, where nothing else moves
    assert all(
        re.fullmatch(r"(cause 1: \d+ of 1000|folds: \d of 3)(, \d+ s)? \.\.\.", x)
        for x in lines[1:]
    )


def test_the_best_so_far_is_a_line_of_its_own():
    lines = []
    show = Lines(lines.append)
    show("cause 1", 0, 9)
    show("best candidate so far: error 1.20 times the noise with drag", 0, None)
    assert lines[1:] == ["best candidate so far: error 1.20 times the noise with drag"]


def test_a_terminal_shows_the_present_stage_below_what_is_done():
    console = Console(width=100, file=io.StringIO())
    bars, now = _bars(console), [0.0]
    show = _Live(bars, clock=lambda: now[0])
    for stage, done, total in (("reading", 0, None), ("cause [1]", 3, 9), ("cause [1]", 4, 7)):
        show(stage, done, total)
        now[0] += 1.5
    show("best candidate so far: error 1.20 times the noise with drag", 0, None)
    console.print(bars.get_renderable())
    show.finish()
    done, best, present, last = console.file.getvalue().splitlines()
    assert done == "   1.5 s  reading"
    assert best.strip() == "best candidate so far: error 1.20 times the noise with drag"
    assert re.search(r"cause \[1\] .*4/7 .*0:0\d", present)
    assert last == "   3.0 s  cause [1]"
