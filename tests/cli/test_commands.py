"""The commands around a diagnosis: a new user's way from a template to a fitted model."""

import json

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from schemas import faults
from scipy.integrate import solve_ivp
from test_cli import MODEL, table

from sklearn_pgnn import PhysicsModel, systems
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.options import SYSTEMS, make_system

pytestmark = pytest.mark.core


def run(*args, code=0):
    result = CliRunner().invoke(main, [*map(str, args)])
    assert result.exit_code == code, result.output
    return result


@pytest.fixture
def files(tmp_path):
    """A model file, and two files of records."""
    (tmp_path / "cart.yaml").write_text(MODEL)
    for seed, name in enumerate("ab"):
        table(seed, level=0.0).to_csv(tmp_path / f"{name}.csv", index=False)
    return tmp_path


def given(files, *names):
    return ("--model", files / "cart.yaml", *(files / name for name in names or ("a.csv", "b.csv")))


# -- init ------------------------------------------------------------------------------------------


def test_the_command_line_names_every_ready_system():
    assert sorted(name.replace("-", "_") for name in SYSTEMS) == sorted(systems.__all__)


@pytest.mark.parametrize("like", SYSTEMS)
def test_a_template_is_the_model_of_a_ready_system_with_comments(tmp_path, like):
    path = tmp_path / "mine.yaml"
    said = run("init", path, "--like", like).stdout
    assert f"sklearn-pgnn check --model {path}" in said
    assert PhysicsModel.from_yaml(path) == make_system(like)
    assert path.read_text().count("# ") > 10


def test_the_optional_parts_of_a_template_can_be_taken_in(tmp_path):
    path = tmp_path / "mine.yaml"
    run("init", path)
    parts = ("channels", "columns", "delays", "initial_state", "simulation")
    text = path.read_text()
    for part in (*parts, "tau_force"):
        text = text.replace(f"# {part}:", f"{part}:")
    path.write_text(text)
    model = PhysicsModel.from_yaml(path)
    assert all(getattr(model, part) for part in parts)
    assert model.delays == {"force": "tau_force"}
    assert model.parameters["tau_force"].unit == "s"


@pytest.mark.parametrize("like", SYSTEMS)
def test_the_delay_of_a_template_is_no_parameter_of_another_kind(tmp_path, like):
    path = tmp_path / "mine.yaml"
    run("init", path, "--like", like)
    said = [line for line in path.read_text().splitlines() if line.startswith("# delays:")]
    units = {name: p.unit for name, p in make_system(like).parameters.items()}
    for line in said:
        delay = line.partition(": {")[2].partition("}")[0].partition(": ")[2]
        assert units.get(delay, "s") == "s"


def test_a_template_lists_the_columns_of_a_file_and_replaces_nothing_unasked(files):
    path = files / "mine.yaml"
    table(0).rename(columns={"F": "force_act"}).to_csv(files / "rig.csv", index=False)
    run("init", path, "--records", files / "rig.csv")
    text = path.read_text()
    assert "# The columns of your file: t, force_act, speed." in text
    assert "# columns: {force: force_act}" in text  # a speed is not like a position
    path.write_text("mine")
    assert "expected a new file" in run("init", path, code=2).stderr
    assert path.read_text() == "mine"
    run("init", path, "--force", "--quiet")
    assert path.read_text() != "mine"


# -- check -----------------------------------------------------------------------------------------


def test_a_check_shows_ranges_and_a_first_simulation(files):
    text = " ".join(run("check", *given(files)).stdout.split())
    assert "The model of the cart (1 state, 1 input, 1 output, 2 free parameters)" in text
    assert "can be used" in text
    for what in ("a 300 14.95 s 0.05 s", "F input", "speed output", "speed 100 %"):
        assert what in text
    assert "Warnings" not in text


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows.assign(speed=3.6 * rows.speed), "factor 3.6 on speed"),
        (lambda rows: rows.assign(speed=-rows.speed), "reversed polarity of speed"),
        (lambda rows: rows.assign(F=1.5), "input 'F' is 1.5 N in every sample"),
        (lambda rows: rows.assign(speed=np.sin(40 * rows.t)), "predicts the records no better"),
    ],
)
def test_a_check_says_what_looks_wrong(files, change, said):
    change(table(0, level=0.0)).to_csv(files / "odd.csv", index=False)
    result = run("check", *given(files, "odd.csv"), "--quiet")
    assert "with warnings" in " ".join(result.stdout.split())
    assert said in result.stdout


def test_a_check_of_several_records_tells_the_fit_of_each(files):
    table(1).assign(speed=lambda run: -run["speed"]).to_csv(files / "wrong.csv", index=False)
    said = run("check", *given(files, "a.csv", "wrong.csv")).stdout
    rows = {line.split()[0]: line for line in said.splitlines() if line.strip()}
    assert "fit of speed" in said
    assert int(rows["a"].split()[-2]) > 90
    assert int(rows["wrong"].split()[-2]) < 0
    assert "fit of speed" not in run("check", *given(files, "a.csv")).stdout


def test_a_file_whose_folder_is_missing_is_refused_before_anything_is_simulated(files):
    said = run("simulate", *given(files), "--output", files / "no" / "run.csv", code=2).stderr
    assert "expected its folder to exist. Remedy: create it first." in said
    assert "simulating" not in said


def test_a_check_names_what_is_not_used_and_every_column_that_is_missing(files):
    table(0).assign(temperature=20).to_csv(files / "more.csv", index=False)
    assert "Not used: temperature." in run("check", *given(files, "more.csv")).stdout
    names = {"t": "Time", "F": "F_cmd", "speed": "v_meas [m/s]"}
    table(0).rename(columns=names).assign(foo=1).to_csv(files / "other.csv", index=False)
    said = run("check", *given(files, "other.csv"), code=2).stderr
    assert "columns: {t: Time, speed: v_meas, F: F_cmd}" in said


def test_a_check_says_what_is_converted_and_which_term_does_not_fit(files):
    rows = table(0, level=0.0).rename(columns={"speed": "speed [mm/s]"})
    rows.assign(**{"speed [mm/s]": 1000 * rows["speed [mm/s]"]}).to_csv(files / "mm.csv")
    (files / "cart.yaml").write_text(MODEL.replace("N s/m", "N/m"))
    result = run("check", *given(files, "mm.csv"))
    assert "Converted: speed from mm/s to m/s." in result.stdout
    assert "cart.yaml:8:13: equations.v: the term -d*v is in N/s, expected N." in result.stdout
    assert "speed 100 %" in " ".join(result.stdout.split())
    said = run("simulate", *given(files), "--output", files / "s.csv").stderr
    assert "Warning: " in said
    assert "the term -d*v" in said


def test_a_check_says_what_the_records_can_tell(files):
    path = files / "cart.yaml"
    path.write_text(MODEL.replace("F - d*v", "gain*F - d*v").replace("  d:", "  gain: 1\n  d:"))
    said = " ".join(run("check", *given(files)).stdout.split())
    assert "What these records can tell" in said
    assert "collinear with" in said
    told = json.loads(run("check", *given(files), "--json").stdout)["identifiability"]
    assert {each["verdict"] for each in told["parameters"]} == {"not"}
    assert "can tell" not in run("check", *given(files), "--quiet").stdout


def test_a_check_says_what_is_assumed_of_the_channels(files):
    of_none = (
        "Assumed of the channels: of F, speed nothing is known, and every fault is considered."
    )
    assert of_none in " ".join(run("check", *given(files)).stdout.split())
    path = files / "cart.yaml"
    path.write_text(path.read_text() + "channels: {speed: tachometer}\n")
    said = " ".join(run("check", *given(files)).stdout.split())
    assert "Assumed of the channels: speed is read by a tachometer; of F nothing is known" in said
    seen = json.loads(run("check", *given(files), "--json").stdout)["quantities"]
    assert {q["name"]: q["channel"] for q in seen} == {"F": "", "speed": "tachometer"}
    path.write_text(path.read_text().replace("tachometer", "tacho"))
    assert "got 'tacho'. Remedy: write tachometer." in run("check", *given(files), code=2).stderr


def test_a_check_as_json_is_strict(files):
    data = json.loads(run("check", *given(files), "--json").stdout)
    assert data["outputs"][0]["fit"] > 99
    assert data["findings"] == data["unused_columns"] == faults("check", data) == []
    assert faults("check", {**data, "warnings": []})


# -- simulate --------------------------------------------------------------------------------------


def test_a_simulation_is_a_file_of_records_again(files):
    out = files / "simulated.csv"
    said = " ".join(run("simulate", *given(files), "--output", out).stdout.split())
    assert "a 99.8 %" in said or "a 99.9 %" in said
    rows = pd.read_csv(out)
    assert list(rows) == ["trajectory", "t [s]", "F [N]", "v [m/s]", "speed [m/s]"]
    data = json.loads(run("check", *given(files, "simulated.csv"), "--json").stdout)
    assert [record["name"] for record in data["records"]] == ["simulated/a", "simulated/b"]
    assert data["outputs"][0]["fit"] > 99.9
    assert "expected a new file" in run("simulate", *given(files), "--output", out, code=2).stderr


def test_a_simulation_needs_no_outputs(files):
    table(0).drop(columns="speed").to_csv(files / "inputs.csv", index=False)
    out = files / "simulated.csv"
    assert "Fit" not in run("simulate", *given(files, "inputs.csv"), "--output", out).stdout
    speed = pd.read_csv(out)["speed [m/s]"]
    assert speed.iloc[-1] == pytest.approx(table(0, level=0.0).speed.iloc[-1], abs=0.01)


def test_a_simulation_that_diverges_is_refused(files):
    text = (files / "cart.yaml").read_text().replace("F - d*v", "F + 1e6*v**3")
    (files / "cart.yaml").write_text(text)
    out = files / "simulated.csv"
    assert "became non-finite" in run("simulate", *given(files), "--output", out, code=2).stderr
    assert not out.exists()


def test_of_an_output_that_does_not_move_no_percentage_is_told(files):
    table(0).assign(speed=0.5).to_csv(files / "still.csv", index=False)
    said = run("simulate", *given(files, "still.csv"), "--output", files / "run.csv").stdout
    assert "nothing to fit" in said
    assert "nan" not in said


# -- fit -------------------------------------------------------------------------------------------


def test_a_fit_that_ends_at_a_bound_says_so(files):
    text = (files / "cart.yaml").read_text()
    out = files / "fitted.yaml"
    assert "bound" not in run("fit", *given(files), "--output", out, "--quiet").output
    text = text.replace("value: 0.5", "value: 0.2, bounds: [0.1, 0.3]")
    (files / "cart.yaml").write_text(text)
    said = run("fit", *given(files), "--output", out, "--quiet", "--force").stderr
    assert "d ended at a bound (0.1 to 0.3): the records want a value beyond it, or tell" in said


def test_a_fit_writes_a_model_file_and_says_what_it_changed(files):
    text = (files / "cart.yaml").read_text().replace("value: 0.5", "value: 0.8")
    (files / "cart.yaml").write_text(text)
    out = files / "fitted.yaml"
    result = run("fit", *given(files), "--output", out)
    assert PhysicsModel.from_yaml(out).parameters["d"].value == pytest.approx(0.5, rel=0.01)
    assert "N s/m" in result.stdout
    data = json.loads(run("fit", *given(files), "--output", out, "--force", "--json").stdout)
    assert data["parameters"]["d"]["prior"] == 0.8
    assert data["fit_percent"]["fitted"]["speed"] > data["fit_percent"]["as given"]["speed"]


def test_a_fit_leaves_what_is_not_named_and_refuses_what_is_not_there(files):
    out = files / "fitted.yaml"
    run("fit", *given(files), "--output", out, "--free", "d", "--free-run", "--quiet")
    assert PhysicsModel.from_yaml(out).parameters["m"].value == 2.0
    said = run("fit", *given(files), "--output", out, "--free", "q", "--force", code=2).stderr
    assert "--free: expected parameters of the model (m, d), got 'q'." in said


# -- detect ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_detect_tells_the_smallest_size_of_every_effect(files):
    args = ("detect", *given(files), "--catalogue", "coulomb_friction,leak,input_bias")
    result = run(*args)
    text = " ".join(result.stdout.split())
    assert text.startswith(
        "Named with probability 90 % from this size on Coulomb friction on v level"
    )
    assert "effects: 0 of 2" in result.stderr
    rows = json.loads(run(*args, "--json").stdout)["effects"]
    assert [row["effect"] for row in rows] == ["coulomb_friction", "input_bias"]
    assert all(0 < row["smallest"] < 0.1 for row in rows)


@pytest.mark.slow
def test_detect_warns_of_a_model_that_leaves_structure(files):
    table(0, level=0.5).to_csv(files / "rough.csv", index=False)
    args = ("detect", *given(files, "rough.csv"), "--catalogue", "input_bias")
    assert "leaves more than noise, which counts as noise" in run(*args).stdout


# -- all -------------------------------------------------------------------------------------------


def test_help_lists_the_commands_as_one_comes_to_use_them():
    text = run("--help").stdout
    places = [text.index(f"\n  {name} ") for name in ("demo", "init", "check", "fit", "diagnose")]
    assert places == sorted(places)


# -- stiff models ----------------------------------------------------------------------------------

#: a catalyst C that is used and given back: two fast reactions, and a slow one
CATALYSIS = """
name: catalysis
states: {C: mol/L, A: mol/L, CA: mol/L, P: mol/L}
outputs: {product: P}
parameters:
  k1: {value: %s, unit: L/mol/s, bounds: [10, 1.0e+7]}
  k2: {value: %s, unit: 1/s, bounds: [1, 1.0e+7]}
equations:
  C: -k1*C*A + k2*CA
  A: -k1*C*A
  CA: k1*C*A - k2*CA
  P: k2*CA
"""
TRUTH = {"k1": 2.0e5, "k2": 900.0}


def reaction(t, start):
    k1, k2 = TRUTH.values()

    def rates(_, x):
        first, second = k1 * x[0] * x[1], k2 * x[2]
        return [second - first, -first, first - second, second]

    return solve_ivp(rates, (0, t[-1]), start, "Radau", t, rtol=1e-9, atol=1e-13).y.T


@pytest.fixture(scope="module")
def stiff(tmp_path_factory):
    path, rng = tmp_path_factory.mktemp("stiff"), np.random.default_rng(0)
    t = np.arange(0, 0.4, 0.005)
    for k, (c, a) in enumerate([(0.0005, 0.1), (0.001, 0.15), (0.0003, 0.06)]):
        x = reaction(t, [c, a, 0.0, 0.0])
        y = x[:, 3] + 2e-4 * rng.standard_normal(t.size)
        table = {"t": t, "product": y}
        starts = zip(["C", "A", "CA", "P"], [c, a, 0.0, 0.0], strict=True)
        table |= {name: np.where(t == 0, value, np.nan) for name, value in starts}
        pd.DataFrame(table).to_csv(path / f"r_{k}.csv", index=False)
    (path / "given.yaml").write_text(CATALYSIS % (2.0e5, 900.0))
    (path / "start.yaml").write_text(CATALYSIS % (6.0e5, 500.0))
    return path


def test_check_simulates_a_stiff_model(stiff):
    records = sorted(stiff.glob("r_*.csv"))
    found = json.loads(run("check", "--model", stiff / "given.yaml", *records, "--json").stdout)
    assert found["outputs"][0]["fit"] > 98
    assert not [f for f in found["findings"] if "sign" in f["text"] or "non-finite" in f["text"]]


def test_every_column_of_a_fit_is_in_the_steps_that_are_told(stiff, tmp_path):
    records, fits = sorted(stiff.glob("r_*.csv")), []
    for told in ((), ("--substeps", "64")):
        words = ("--output", tmp_path / "o.yaml", "--force", "--json", "--quiet", *told)
        said = run("fit", "--model", stiff / "start.yaml", *records, *words).stdout
        fits.append(json.loads(said)["fit_percent"])
    as_given, fitted = ([fit[which]["product"] for fit in fits] for which in ("as given", "fitted"))
    assert as_given[0] == pytest.approx(as_given[1], abs=0.3)
    assert min(fitted) > 90 > max(as_given)


def test_no_sign_is_told_of_a_run_that_diverges(tmp_path):
    """An exploding model with an output far beyond any unit."""
    t = np.arange(0, 4, 0.02)
    pd.DataFrame({"t": t, "u": np.sin(t), "y": -np.sin(t)}).to_csv(tmp_path / "r.csv", index=False)
    (tmp_path / "m.yaml").write_text(
        "states: {y: V}\ninputs: {u: V}\nparameters: {a: 15.0}\nequations: {y: a*y + u}\n"
    )
    said = run("check", "--model", tmp_path / "m.yaml", tmp_path / "r.csv", "--json").stdout
    found = json.loads(said)
    told = [finding["text"] for finding in found["findings"]]
    assert faults("check", found) == []
    assert not [each for each in told if "opposite sign" in each or "times what" in each]
