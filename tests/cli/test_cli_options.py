"""The options of the command line: what they say to a diagnosis, and how they are refused."""

import json
import re
import subprocess
import sys
import warnings

import pytest
from click.testing import CliRunner
from test_cli import table, write

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, __version__, effects
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.inputs import check_candidates, read_noise
from sklearn_pgnn.exceptions import OptionError, RecordWarning

TWO = """\
name: cart
states: {x: m, v: m/s}
inputs: {F: N}
outputs: {speed: v, position: x}
parameters: {m: {value: 2.0, unit: kg}, d: {value: 0.5, unit: N s/m}}
equations: {x: v, v: "(F - d*v)/m"}
inertia: {v: m}
"""


class Stop(RuntimeError):
    """Ends a job before it costs anything."""


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Return what a command line asks of a diagnosis."""

    def ask(*options):
        params = {}

        def fit(self, X, y):
            params.update(self.get_params())
            raise Stop

        monkeypatch.setattr(ModelDiagnosis, "fit", fit)
        result = CliRunner().invoke(main, [*write(tmp_path), *options])
        assert result.exit_code == 1, result.output
        return params

    return ask


def test_options_reach_the_diagnosis(asked):
    params = asked(
        *("--noise", "0.002", "--substeps", "3", "--hold", "foh", "--window", "0.7"),
        *("--catalogue", "coulomb_friction, input_bias", "--catalogue", "viscous_friction"),
        *("--exclude", "input_bias", "--targets", "v", "--max-causes", "2", "--seed", "5"),
        *("--time-limit", "60", "--alpha", "0.001", "--smallest-share", "0.1"),
    )
    assert params["noise_std"] == [0.002]
    assert params["substeps"] == 3
    assert params["hold"] == "foh"
    assert params["window_length"] == 0.7
    assert params["catalogue"] == (effects.CoulombFriction, effects.ViscousFriction)
    assert params["targets"] == ["v"]
    assert params["max_causes"] == 2
    assert params["random_state"] == 5
    assert 50.0 < params["time_limit"] < 60.0  # less the reading
    assert params["alpha"] == 0.001
    assert params["smallest_share"] == 0.1
    assert params["n_jobs"] == 1


def test_without_options_a_diagnosis_has_its_defaults(asked):
    params = asked()
    given = ModelDiagnosis(None).get_params()
    for name in set(given) - {"model", "catalogue", "n_jobs", "progress"}:
        assert params[name] == given[name], name
    assert params["catalogue"] == effects.CATALOGUE


def test_noise_is_given_by_the_names_of_the_outputs():
    outputs = ["speed", "position"]
    assert read_noise(["position=1e-4", "speed=0.1"], outputs) == [0.1, 1e-4]
    assert read_noise([], outputs) is None


def test_what_is_known_of_a_channel_may_leave_nothing_to_try():
    cart = PhysicsModel({"v": "m/s"}, {"v": "F - v"}, inputs={"F": "N"}, name="cart")
    check_candidates(cart, [effects.ActuatorLag], ["F"])
    said = "actuator_lag cannot act on F in the model 'cart', by what its channels are."
    with pytest.raises(OptionError, match=re.escape(said)):
        check_candidates(cart.replace(channels={"F": "measured"}), [effects.ActuatorLag], ["F"])


REFUSED = {
    "an effect misspelled": (
        ["--catalogue", "coulom_friction"],
        "'coulom_friction'; did you mean 'coulomb_friction'?",
    ),
    "an excluded effect misspelled": (["--exclude", "input_bais"], "did you mean 'input_bias'?"),
    "nothing left": (
        ["--catalogue", "leak", "--exclude", "leak"],
        "expected at least one effect to remain",
    ),
    "nothing to act on": (["--catalogue", "leak"], "leak cannot act in the model 'cart'"),
    "a target misspelled": (["--targets", "vv"], "got 'vv'; did you mean 'v'?"),
    "noise that is no number": (["--noise", "loud"], "expected a number > 0"),
    "noise below zero": (["--noise", "speed=-1"], "expected a number > 0"),
    "noise of something else": (["--noise", "sped=1"], "--noise speed=NUMBER"),
    "noise twice": (["--noise", "1", "--noise", "2"], "once"),
    "no thread": (["--jobs", "0"], "expected 1 or more, or -1"),
    "no step": (["--substeps", "0"], "--substeps"),
    "no time": (["--time-limit", "0"], "--time-limit"),
    "a false-alarm rate of 0": (["--alpha", "0"], "--alpha"),
    "a false-alarm rate of 1": (["--alpha", "1"], "--alpha"),
    "a share above 1": (["--smallest-share", "1.5"], "--smallest-share"),
    "no window": (["--window", "-1"], "--window"),
}


@pytest.mark.parametrize(("options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_an_option_cannot_mean_is_refused(tmp_path, options, said):
    result = CliRunner().invoke(main, [*write(tmp_path), "--quiet", *options])
    assert result.exit_code == 2
    assert said in result.stderr.splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_noise_of_one_output_only_is_refused(tmp_path):
    args = write(tmp_path, model=TWO)
    for noise in ("0.1", "speed=0.1"):
        result = CliRunner().invoke(main, [*args, "--quiet", "--noise", noise])
        assert result.exit_code == 2
        assert "--noise speed=NUMBER --noise position=NUMBER" in result.stderr


@pytest.mark.slow
def test_a_real_run_does_as_told(tmp_path):
    options = ("--catalogue", "input_bias", "--hold", "foh", "--window", "1", "--substeps", "2")
    args = [*write(tmp_path), "--quiet", "--noise", "0.001", *options]
    result = CliRunner().invoke(main, args, catch_exceptions=False)
    assert result.exit_code == 0
    data = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert data["hold"] == "foh"
    assert data["window"] == pytest.approx(1.0, rel=0.05)
    assert {cause["effect"] for cause in data["causes"]} <= {"input_bias"}


def test_files_without_a_time_take_a_sample_time(tmp_path, monkeypatch):
    read = []

    def fit(self, X, y):
        read.append(X["t"].to_numpy())
        raise Stop

    monkeypatch.setattr(ModelDiagnosis, "fit", fit)
    tables = {"a.csv": table(0).drop(columns="t")}
    args = write(tmp_path, tables=tables)
    assert CliRunner().invoke(main, [*args, "--sample-time", "0.25"]).exit_code == 1
    assert read[0][:3].tolist() == [0.0, 0.25, 0.5]
    result = CliRunner().invoke(main, args)
    assert result.exit_code == 2
    assert "(--sample-time)" in result.stderr


@pytest.mark.slow
def test_what_is_said_with_a_reservation_is_said_on_the_screen(tmp_path, monkeypatch):
    fit = ModelDiagnosis.fit

    def warned(self, X, y):
        warnings.warn("the clock is strange. Remedy: look at it.", RecordWarning, stacklevel=2)
        warnings.warn("of no concern", DeprecationWarning, stacklevel=2)
        return fit(self, X, y)

    monkeypatch.setattr(ModelDiagnosis, "fit", warned)
    args = [*write(tmp_path), "--catalogue", "input_bias"]
    result = CliRunner().invoke(main, args, catch_exceptions=False)
    assert result.exit_code == 0
    assert "Warning: the clock is strange. Remedy: look at it.\n" in result.stderr
    assert "of no concern" not in result.stderr


def test_when_the_time_is_up_the_best_so_far_is_told(tmp_path):
    args = [*write(tmp_path), "--catalogue", "coulomb_friction", "--time-limit", "1e-6"]
    result = CliRunner().invoke(main, args, catch_exceptions=False)
    assert result.exit_code == 0
    data = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert data["stopped"].startswith("time limit, at ")
    assert "Ended early (time limit" in " ".join(result.stdout.split())


def test_effects_can_be_listed_and_the_package_is_a_program():
    shown = CliRunner().invoke(main, ["diagnose", "--list-effects"]).stdout.splitlines()
    assert [line.split()[0] for line in shown] == [effect.id for effect in effects.CATALOGUE]
    command = [sys.executable, "-m", "sklearn_pgnn", "-V"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.stdout == f"sklearn-pgnn, version {__version__}\n"
