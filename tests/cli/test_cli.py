"""The command line: what it writes and prints, and how it refuses unusable input."""

import json
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from schemas import faults
from sledge import SLEDGE

from sklearn_pgnn import PhysicsModel, __version__, effects
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.output import result_folder
from sklearn_pgnn.cli.screen import described_files
from sklearn_pgnn.diagnosis import NamedCause

pytestmark = pytest.mark.core

MODEL = """\
name: cart
states: {v: m/s}
inputs: {F: N}
outputs: {speed: v}
parameters:
  m: {value: 2.0, unit: kg, bounds: [0.1, 10]}
  d: {value: 0.5, unit: N s/m}
equations: {v: "(F - d*v)/m"}
inertia: {v: m}
"""
FILES = ["diagnosis.json", "extended_model.yaml", "report.html"]


def table(seed=0, level=0.4):
    rng = np.random.default_rng(seed)
    t = np.arange(0, 15, 0.05)
    force = 2 * np.sin((0.7 + 0.2 * seed) * t) + np.sin(1.9 * t)
    rig = SLEDGE + effects.CoulombFriction("v", level=level)
    speed = rig.simulate(t, force, substeps=5).y[:, 0] + 1e-3 * rng.standard_normal(t.size)
    return pd.DataFrame({"t": t, "F": force, "speed": speed})


def write(folder, model=MODEL, tables=None):
    """Write a model file and CSV files; give the command's arguments."""
    (folder / "cart.yaml").write_text(model)
    tables = {"a.csv": table(0), "b.csv": table(1)} if tables is None else tables
    for name, content in tables.items():
        if isinstance(content, pd.DataFrame):
            content = content.to_csv(index=False).encode()
        (folder / name).write_bytes(content)
    data = [str(folder / name) for name in tables]
    options = ["--output", str(folder / "out"), "--jobs", "1"]
    return ["diagnose", "--model", str(folder / "cart.yaml"), *data, *options]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cart")
    result = CliRunner().invoke(main, write(folder), catch_exceptions=False)
    return folder / "out", result


# -- what it does ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_diagnosis_writes_its_three_files_and_nothing_else(done):
    out, result = done
    assert result.exit_code == 0
    assert sorted(path.name for path in out.iterdir()) == FILES
    assert {path.name for path in out.parent.iterdir()} == {"a.csv", "b.csv", "cart.yaml", "out"}


@pytest.mark.slow
def test_it_says_what_was_found_and_where_it_is(done):
    out, result = done
    text = " ".join(result.stdout.split())
    for what in ("Coulomb friction on v", "level", "N", "check on the rig", "held-out"):
        assert what in text
    assert "What is left is white noise." in text
    assert all(str(out / name) in result.stdout for name in FILES)
    assert not any(line != line.rstrip() for line in result.stdout.splitlines() if line.strip())
    assert "cause 1, fitting the candidates: 0 of" in result.stderr
    assert "of 1 ..." not in result.stderr


@pytest.mark.slow
def test_the_json_is_strict_and_complete(done):
    def refuse(constant):
        raise AssertionError(constant)

    data = json.loads((done[0] / "diagnosis.json").read_text(), parse_constant=refuse)
    assert faults("diagnosis", data) == []
    assert faults("diagnosis", {**data, "cause": []})
    assert data["version"] == __version__
    assert data["verdict"] in {"cause_named", "ambiguous"}
    cause = data["causes"][0]
    assert (cause["effect"], cause["target"]) == ("coulomb_friction", "v")
    assert cause["gain_percent"] > 50
    assert 0.9 < cause["probability"] <= 1.0
    assert all({"probability", "equivalent"} <= set(other) for other in cause["confused_with"])
    left = {"kind", "times_noise", "in_free_run", "law", "predicts_nothing"}
    assert set(data["remaining"]) == left
    assert data["remaining"]["kind"] == "noise"
    assert {"prior", "refitted", "extended"} <= set(data["free_run"]["speed"])
    level = cause["parameters"]["level"]
    assert level["low"] <= level["value"] <= level["high"]
    assert level["value"] == pytest.approx(0.4, rel=0.05)
    assert level["unit"] == "N"
    assert set(data["parameters"]["m"]) == {"prior", "value", "low", "high", "unit", "changed"}
    errors = {"prior", "refitted", "extended", "free_run_refitted", "free_run_extended", "noise"}
    assert errors | {"explained_share", "low", "high"} <= set(data["gain"]["speed"])


@pytest.mark.slow
def test_the_extended_model_is_a_model_file(done):
    model = PhysicsModel.from_yaml(done[0] / "extended_model.yaml")
    assert model.parameters["Fc_v"].value == pytest.approx(0.4, rel=0.05)


def test_an_earlier_result_is_not_overwritten(tmp_path):
    args = write(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").write_text("old")
    refused(args, tmp_path, "expected no earlier result, got report.html. Remedy: another folder")
    assert (tmp_path / "out" / "report.html").read_text() == "old"
    refused(["demo", "--output", str(tmp_path / "out")], tmp_path, "or --force to replace it")


@pytest.mark.slow
def test_a_forced_run_replaces_the_results_and_leaves_the_rest(tmp_path):
    args = [*write(tmp_path), "--force"]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "notes.txt").write_text("mine")
    (tmp_path / "out" / "report.html").write_text("old")
    result = CliRunner().invoke(main, [*args, "--quiet", "--max-causes", "1"])
    assert result.exit_code == 0
    assert result.stderr == ""
    assert "Coulomb friction on v" in " ".join(result.stdout.split())
    assert "Written" not in result.stdout
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted([*FILES, "notes.txt"])
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"
    assert (tmp_path / "out" / "report.html").read_text() != "old"


@pytest.mark.slow
def test_it_says_that_an_earlier_result_was_replaced(done, tmp_path):
    _, first = done
    assert "Replaced" not in first.stderr
    args = [*write(tmp_path), "--catalogue", "input_bias", "--force"]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").write_text("old")
    result = CliRunner().invoke(main, args, catch_exceptions=False)
    said = f"Replaced the files of an earlier diagnosis in {tmp_path / 'out'}."
    assert said in result.stderr.splitlines()


@pytest.mark.slow
def test_json_is_printed_in_place_of_words_and_the_report_opened(tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("click.launch", opened.append)
    args = [*write(tmp_path), "--catalogue", "input_bias", "--json", "--open"]
    result = CliRunner().invoke(main, args, catch_exceptions=False)
    assert result.stdout == (tmp_path / "out" / "diagnosis.json").read_text()
    assert opened == [str(tmp_path / "out" / "report.html")]


@pytest.mark.parametrize(
    ("causes", "missing", "said"),
    [
        (1, None, "the model, re-tuned and extended by what was named; a model file again"),
        (0, None, "the model, re-tuned only; a model file again"),
        (0, 1, "the model, re-tuned, with the formula for what no cause explains; a model file"),
    ],
)
def test_the_model_file_is_called_what_it_is(causes, missing, said):
    named = causes * (NamedCause("input_bias", "F", {}, 90.0, ()),)
    plain = SimpleNamespace(opaque_functions=())
    diagnosis = SimpleNamespace(causes_=named, discrepancy_=missing, model=plain)
    assert described_files(diagnosis)["extended_model.yaml"].startswith(said)


@pytest.mark.slow
def test_rivals_have_files_and_those_of_an_earlier_result_go(tmp_path):
    biased = table(0, level=0.0)
    biased["F"] -= 0.3
    args = write(tmp_path, tables={"a.csv": biased})
    candidates = ["--catalogue", "input_bias,constant_load"]
    CliRunner().invoke(main, [*args, *candidates], catch_exceptions=False)
    out = tmp_path / "out"
    assert len(list(out.glob("extended_model_with_*_for_*.yaml"))) == 1
    CliRunner().invoke(main, [*args, "--catalogue", "input_bias", "--force"])
    assert sorted(file.name for file in out.iterdir()) == FILES


def test_help_has_an_example_and_the_version_is_told():
    for args in (["--help"], ["diagnose", "--help"]):
        assert "sklearn-pgnn diagnose --model model.yaml" in CliRunner().invoke(main, args).stdout
    assert __version__ in CliRunner().invoke(main, ["--version"]).stdout


def test_help_is_quick_to_import():
    code = "import sys, sklearn_pgnn.cli; print(*{n.split('.')[0] for n in sys.modules})"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"numba", "sympy", "matplotlib", "pandas"}.isdisjoint(shown.stdout.split())


# -- unusable input: one line that says what and where, exit 2, nothing written --------------------


def lines_of(frame, change):
    lines = frame.to_csv(index=False).splitlines()
    change(lines)
    return ("\n".join(lines) + "\n").encode()


def cell(row, column, value):
    def change(lines):
        parts = lines[row].split(",")
        parts[column] = value
        lines[row] = ",".join(parts)

    return change


BAD_DATA = {
    "binary": (bytes(range(256)) * 4, "a.csv"),
    "empty": (b"", "a.csv"),
    "header only": (b"t,F,speed\n", "a.csv"),
    "missing column": (table().drop(columns="F"), "'F'"),
    "text in a number column": (lines_of(table(), cell(7, 2, "fast")), "a.csv:8"),
    "NaN in an input": (lines_of(table(), cell(9, 1, "nan")), "a.csv:10"),
    "time running backward": (
        lines_of(table().assign(trajectory="a"), lambda rows: rows.insert(50, rows.pop(51))),
        "a.csv:5",
    ),
    "three samples": (table().head(3), "a.csv"),
    "too few in all": (table().head(10), "samples"),
    "an output that never changes": (table().assign(speed=1.0), "'speed'"),
}
BAD_MODELS = {
    "unknown name": (MODEL.replace("d*v", "q*v"), "cart.yaml:8:"),
    "out of bounds": (MODEL.replace("value: 2.0", "value: 20.0"), "cart.yaml:6:"),
    "reaching for Python": (
        MODEL.replace("(F - d*v)/m", "__import__('os').system('touch owned')"),
        "cart.yaml:8:",
    ),
    "not YAML": (MODEL + "  : [", "cart.yaml"),
    "not a mapping": ("- 1\n- 2\n", "cart.yaml"),
}


def refused(args, folder, place):
    before = sorted(folder.rglob("*"))
    result = CliRunner().invoke(main, [*args, "--quiet"])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert place in result.stderr
    assert "Traceback" not in result.stderr
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize(("content", "place"), BAD_DATA.values(), ids=BAD_DATA)
def test_unusable_records_are_refused_in_one_line(tmp_path, content, place):
    refused(write(tmp_path, tables={"a.csv": content}), tmp_path, place)


@pytest.mark.parametrize(("model", "place"), BAD_MODELS.values(), ids=BAD_MODELS)
def test_unusable_models_are_refused_in_one_line(tmp_path, monkeypatch, model, place):
    monkeypatch.chdir(tmp_path)
    refused(write(tmp_path, model=model), tmp_path, place)


def test_files_that_are_not_there_and_an_output_that_is_one_are_refused(tmp_path):
    args = write(tmp_path)
    refused([*args, str(tmp_path / "none.csv")], tmp_path, "none.csv")
    refused([*args[:2], str(tmp_path / "none.yaml"), *args[3:]], tmp_path, "none.yaml")
    (tmp_path / "out").write_text("a file")
    refused(args, tmp_path, "out")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write")
def test_an_output_that_cannot_be_written_is_refused(tmp_path):
    args = write(tmp_path)
    tmp_path.chmod(0o500)
    refused(args, tmp_path, "out")


# -- what goes wrong on the way --------------------------------------------------------------------


def test_nothing_is_half_written(tmp_path):
    class Stop(Exception):
        pass

    def work():
        with result_folder(tmp_path / "deep" / "out") as folder:
            (folder / "report.html").write_text("half")
            raise Stop

    with pytest.raises(Stop):
        work()
    assert list(tmp_path.iterdir()) == []


# -- the demo --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_demo_shows_its_input_and_names_the_stick_slip(tmp_path):
    out = tmp_path / "demo"
    result = CliRunner().invoke(main, ["demo", "--output", str(out)], catch_exceptions=False)
    assert result.exit_code == 0
    assert {*FILES, "input"} == {path.name for path in out.iterdir()}
    data = json.loads((out / "diagnosis.json").read_text())
    assert data["causes"][0]["effect"] == "stribeck_friction"
    assert data["verdict"] == "cause_named"
    header = (out / "input" / "record_1.csv").read_text().splitlines()[0]
    assert header == "t [s],torque [N m],phi_measured [rad]"
    assert f"--model {out}/input/golf_robot.yaml" in result.stdout
    command = result.stdout.splitlines()[-1]
    assert command.endswith(f" --output {out} --force")  # the folder has just been filled
