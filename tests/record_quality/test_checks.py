"""Data quality: every fault is found where it was made, and nothing where there is none."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from servo import SERVO, follow_sines, follow_steps

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.cli.screen import print_diagnosis
from sklearn_pgnn.datasets import make_hidden_effect, make_two_tanks
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem, with_hold
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.record_quality.refits import _best_lead, find_early_output, is_better
from sklearn_pgnn.record_quality.sensors import find_dead_sensor, find_outliers
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.trajectories import read_records

NOISE = 2e-3
N_RECORDS = 3


def cart(**parameters):
    model = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F - k*x - d*v)/m"},
        {"m": {"value": 2.0, "unit": "kg"}, "d": 1.0, "k": 10.0},
        {"F": "N"},
        {"position": "x"},
        inertia={"v": "m"},
    )
    return model.with_parameters(**parameters)


def force(t, record=0):
    return 4 * np.sin((1.3 + 0.4 * record) * t) + 3 * np.sin((3.1 + record) * t) + 2 * (t % 3 > 2)


def measure(seed=0, noise=NOISE, machines=None, forces=None, t=None):
    """Return a table of records: a row a sample, with the position as measured."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 8, 0.02) if t is None else t
    tables = []
    for record in range(N_RECORDS):
        machine = cart() if machines is None else machines[record]
        u = force(t, record) if forces is None else forces[record]
        x = machine.simulate(t, u, substeps=8).check().y[:, 0]
        x = x + noise * rng.standard_normal(t.size)
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "F": u, "position": x}))
    return pd.concat(tables, ignore_index=True)


def findings(table, model=None, **options):
    options = {"catalogue": (), **options}
    diagnosis = ModelDiagnosis(cart() if model is None else model, **options)
    return diagnosis.fit(table[["trajectory", "t", "F"]], table[["position"]]).data_quality_


def kinds(table, **options):
    return {(finding.kind, finding.where) for finding in findings(table, **options)}


@pytest.mark.slow
def test_a_faultless_record_has_no_findings():
    assert findings(measure()) == ()


# -- every fault that is made is found, and no other -----------------------------------------------


def clipped(table):
    return table.assign(position=table["position"].clip(upper=0.6 * table["position"].max()))


def quantised(table):
    return table.assign(position=np.round(table["position"] / 0.02) * 0.02)


def with_gaps(table):
    return table.drop(index=[100, 101, 650, 1000]).reset_index(drop=True)


def held(table):
    position = table["position"].to_numpy().copy()
    for k in (60, 130, 700, 705, 1030):
        position[k] = position[k - 1]
    return table.assign(position=position)


def with_outliers(table):
    position = table["position"].to_numpy().copy()
    position[[70, 470, 1100]] += [0.3, -0.4, 0.2]
    return table.assign(position=position)


def noisier(table):
    rng = np.random.default_rng(1)
    more = 3 * NOISE * rng.standard_normal(len(table)) * (table["trajectory"] == 1)
    return table.assign(position=table["position"] + more)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "kind", "where", "text"),
    [
        (clipped, "clipping", "position", "stays at its extreme value"),
        (quantised, "quantisation", "position", "steps of 0.02 m, larger than its noise"),
        (with_gaps, "dropped samples", "t", "4 samples are missing from a clock of 0.02 s"),
        (held, "dropped samples", "position", "repeats the value before it in 5 samples"),
        (with_outliers, "outliers", "position", "3 in all, the first in record 0, sample 70"),
        (noisier, "drift between records", "position", "in record 1 and .* in record"),
    ],
)
def test_a_fault_of_the_record_is_found(fault, kind, where, text):
    found = findings(fault(measure()))
    assert (kind, where) in {(f.kind, f.where) for f in found}
    (finding,) = [f for f in found if (f.kind, f.where) == (kind, where)]
    assert re.search(text, finding.text), finding.text
    assert finding.remedy


@pytest.mark.slow
def test_clipping_without_noise_is_found():
    table = measure(noise=0.0)
    assert ("clipping", "position") in kinds(clipped(table))


def test_an_uneven_clock_is_found():
    rng = np.random.default_rng(3)
    even = np.arange(0, 8, 0.02)
    stamps = even + rng.uniform(-0.006, 0.006, even.size)
    table = measure()
    late = table.assign(t=np.tile(stamps, N_RECORDS))
    (finding,) = [f for f in findings(late) if f.kind == "clock jitter"]
    assert finding.value == pytest.approx(np.std(np.diff(stamps)), rel=0.1)


def test_a_constant_and_a_two_valued_input_are_found():
    t = np.arange(0, 8, 0.02)
    still = measure(forces=[np.full(t.size, 3.0)] * 3)
    switched = measure(forces=[np.where(np.sin((1 + r) * t) > 0, 3.0, -3.0) for r in range(3)])
    assert "F has the value 3 N throughout" in {f.text for f in findings(still)}
    assert "F has only the values -3 N and 3 N" in {f.text for f in findings(switched)}


def test_a_parameter_that_the_input_does_not_excite_is_found():
    t = np.arange(0, 8, 0.02)
    slow = measure(forces=[(r + 1) * t / 8 for r in range(3)], noise=0.01)
    found = {f.where for f in findings(slow) if f.kind == "poor excitation"}
    assert "d" in found
    assert "k" not in found


def test_a_parameter_that_no_record_can_fix_is_not_blamed_on_the_record():
    twin = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(a*F - k*x - d*v)/m"},
        {"m": 2.0, "d": 1.0, "k": 10.0, "a": 1.0},
        {"F": "N"},
        {"position": "x"},
    )
    assert findings(measure(), model=twin) == ()


def closed_loop(gain, seed=0, noise=0.02):
    """Simulate a controller that sees the noisy position."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 8, 0.02)
    tables = []
    for record in range(N_RECORDS):
        goal, state = 0.3 * force(t, record), np.zeros(2)
        u, x = np.zeros(t.size), np.zeros(t.size)
        for k in range(t.size):
            x[k] = state[0] + noise * rng.standard_normal()
            u[k] = goal[k] + gain * (0.5 * goal[k] - x[k])
            step = cart().simulate(t[:2], [u[k], u[k]], state, substeps=4)
            state = step.x[-1]
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "F": u, "position": x}))
    return pd.concat(tables, ignore_index=True)


@pytest.mark.slow
def test_a_closed_loop_is_found():
    (finding,) = [f for f in findings(closed_loop(5.0)) if f.kind == "closed loop"]
    assert finding.where == "F"
    assert "measures position" in finding.text
    assert findings(closed_loop(0.0)) == ()


@pytest.mark.slow
@pytest.mark.parametrize(("lead", "found"), [(5, True), (2, True), (-3, False)])
def test_only_outputs_that_lead_the_inputs_are_not_synchronous(lead, found):
    t = np.arange(0, 8 + 0.4, 0.02)
    table = measure(t=t)
    pieces = []
    for _, rows in table.groupby("trajectory"):
        rows = rows.reset_index(drop=True)
        early = rows["position"].shift(-lead)
        pieces.append(rows.assign(position=early).dropna().assign(t=lambda r: r["t"]))
    moved = pd.concat(pieces, ignore_index=True)
    moved["t"] = moved.groupby("trajectory")["t"].transform(lambda c: c - c.iloc[0])
    late = [f for f in findings(moved) if f.kind == "not synchronous"]
    assert len(late) == found
    if found:
        assert late[0].text.startswith(f"the outputs lead the inputs by {lead} samples")


@pytest.mark.slow
def test_the_lead_is_a_time_on_every_clock():
    """Every other record is sampled half as often; the outputs lead the inputs by 0.08 s."""
    tables = []
    for record, rows in measure(t=np.arange(0, 8.4, 0.02)).groupby("trajectory"):
        early = rows.assign(position=rows["position"].shift(-4)).dropna()
        tables.append(early.iloc[:: 1 + record % 2])
    late = [f for f in findings(pd.concat(tables)) if f.kind == "not synchronous"]
    assert [finding.value for finding in late] == [pytest.approx(0.08)]


@pytest.mark.slow
def test_an_input_delay_is_a_cause_and_no_finding():
    late = [cart() + effects.InputDelay("F", delay=0.1)] * 3
    table = measure(machines=late)
    diagnosis = ModelDiagnosis(cart(), catalogue=(effects.InputDelay, effects.CoulombFriction))
    diagnosis.fit(table[["trajectory", "t", "F"]], table["position"])
    assert [cause.effect for cause in diagnosis.causes_] == ["input_delay"]
    assert diagnosis.data_quality_ == ()


@pytest.mark.slow
def test_a_parameter_that_drifts_between_records_is_found():
    warm = [cart(d=0.7), cart(d=1.0), cart(d=1.5)]
    catalogue = (effects.CoulombFriction,)
    found = findings(measure(machines=warm), catalogue=catalogue, compare_records=False)
    (finding,) = [f for f in found if f.kind == "drift between records"]
    assert finding.where == "d"
    assert "in record 0 to" in finding.text
    assert finding.value == pytest.approx(0.8, rel=0.25)


# -- nothing is found where nothing is wrong -------------------------------------------------------


CLEAN = {
    "golf robot": lambda seed: make_hidden_effect(
        n_records=3, duration=6, sample_rate=100, random_state=seed
    ),
    "golf robot with friction": lambda seed: make_hidden_effect(
        effect="coulomb_friction", n_records=3, duration=6, sample_rate=100, random_state=seed
    ),
    "cart driven by steps": lambda seed: make_hidden_effect(
        systems.cart_on_spring(),
        n_records=3,
        duration=6,
        sample_rate=100,
        excitation="steps",
        random_state=seed,
    ),
    "servo valve": lambda seed: make_hidden_effect(
        systems.servo_valve(), n_records=2, duration=1, sample_rate=2000, random_state=seed
    ),
    "tanks": lambda seed: make_two_tanks(effect=None, n_records=2, random_state=seed),
}


@pytest.mark.slow
@pytest.mark.parametrize("system", CLEAN)
def test_clean_records_of_several_systems_have_no_findings(system):
    for seed in range(2):
        records = CLEAN[system](seed)
        diagnosis = ModelDiagnosis(records.prior, catalogue=(effects.CoulombFriction,))
        assert diagnosis.fit(records.X, records.y).data_quality_ == ()


# -- what comes of it ------------------------------------------------------------------------------


@pytest.mark.slow
def test_findings_are_plain_data():
    table = clipped(measure())
    diagnosis = ModelDiagnosis(cart(), catalogue=())
    diagnosis.fit(table[["trajectory", "t", "F"]], table["position"])
    data = json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))["data_quality"]
    assert set(data[0]) == {"code", "kind", "where", "text", "value", "remedy"}
    assert "clipping" in {finding["kind"] for finding in data}


@pytest.mark.slow
def test_the_report_and_the_screen_begin_with_the_findings(tmp_path, capsys):
    table = clipped(measure())
    diagnosis = ModelDiagnosis(cart(), catalogue=())
    diagnosis.fit(table[["trajectory", "t", "F"]], table["position"])
    diagnosis.to_html(tmp_path / "report.html")
    report = (tmp_path / "report.html").read_text()
    assert report.index("Quality of the records") < report.index("Measured and simulated")
    print_diagnosis(diagnosis, tmp_path, quiet=False)
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "  clipping: " in line]
    assert "position stays at its extreme value" in line
    assert "Remedy: choose a wider range" in line


def retuned(time_constant, X, y):
    """Return a problem with a servo's records, and its prior with this time constant, re-tuned."""
    fixed = {"value": time_constant, "fixed": True}
    prior = SERVO.replace(parameters={"G": {"value": 1.0, "spread": 0.5}, "T": fixed})
    problem = build_problem(prior, read_records(prior, X, y), window_length=1.67)
    return problem, HypothesisFitter(problem).base().fit


def test_a_late_servo_leads_no_input_though_a_model_that_is_too_slow_fits_better_so():
    problem, base = retuned(0.05, *follow_sines())
    lead, best = _best_lead(problem, base, problem.windows)
    assert lead >= 2
    assert is_better(base, best, 1)
    assert find_early_output(problem, base, base) is None


def test_a_servo_as_the_model_says_that_leads_is_told():
    X, y = follow_steps(SERVO, samples=1000)
    ahead = y.groupby(X["trajectory"])["w"].shift(-5).ffill()
    problem, base = retuned(0.005, X, ahead.to_frame())
    finding = find_early_output(problem, base, base)
    assert finding.text.startswith("the outputs lead the inputs by 5 samples")


def test_a_command_that_is_written_down_one_sample_late_is_told():
    """Straight in between, it is half a sample late: nearer, but not noise."""
    X, y = follow_steps(SERVO, samples=1000)
    X["command"] = X.groupby("trajectory")["command"].shift(1).bfill()
    problem = with_hold(build_problem(SERVO, read_records(SERVO, X, y)), "foh")
    base = HypothesisFitter(problem).base().fit
    finding = find_early_output(problem, base, base)
    assert finding.text.startswith("the outputs lead the inputs by 1 sample (0.002 s)")


CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - c*x)/m"},
    {"m": 2.0, "d": 0.5, "c": 3.0},
    {"F": "N"},
)
T = np.arange(0, 16, 0.05)


def records(dead=(), at_rest=(), value=0.1):
    """Return X and y of three records: v is dead in some, or the machine at rest, v counted."""
    rng = np.random.default_rng(0)
    tables, outputs = [], []
    for i in range(3):
        F = np.repeat(rng.uniform(-1, 1, 16), 20) * (i not in at_rest)
        y = CART.simulate(T, F).y + 1e-3 * rng.normal(size=(T.size, 2))
        y[:, 1] = value if i in dead else 0.0 if i in at_rest else y[:, 1]
        tables.append(np.column_stack([T, F]))
        outputs.append(y)
    return np.vstack(tables), np.vstack(outputs)


def found(X, y):
    diagnosis = ModelDiagnosis(CART, catalogue=()).fit(X, y)
    return [each for each in diagnosis.data_quality_ if each.kind == "dead sensor"]


def test_a_diagnosis_names_the_dead_sensor_and_its_records():
    (finding,) = found(*records(dead=(0, 2)))
    assert finding.where == "v"
    assert finding.value == 2.0
    assert finding.text == (
        "v has one value only throughout record 0 (0.1 m/s) and record 2 (0.1 m/s), where the "
        "model moves"
    )
    assert "look at the sensor and its cable" in finding.remedy
    assert "(NaN)" in finding.remedy


def test_a_machine_at_rest_has_no_dead_sensor():
    assert found(*records(at_rest=(1,))) == []


def test_a_sensor_that_is_dead_everywhere_is_refused_with_its_value():
    X, y = records(dead=(0, 1, 2))
    with pytest.raises(RecordError) as caught:
        ModelDiagnosis(CART).fit(X, y)
    assert str(caught.value) == (
        "output 'v': expected a signal that changes, got 0.1 m/s in every sample of every record. "
        "Remedy: look at the sensor and its cable; record the machine in motion, or leave the "
        "output out of the model."
    )


def test_dead_records_do_not_hide_the_noise_of_the_others():
    noisy = np.sin(0.1 * np.arange(300)) + 0.1 * np.random.default_rng(0).normal(size=300)
    pieces = [noisy, np.zeros(300), np.zeros(300)]
    signal = Signal("v", "m/s", pieces, [np.arange(300.0)] * 3, ["a", "b", "c"])
    assert signal.noise == pytest.approx(0.1, rel=0.2)
    assert find_outliers(signal, signal) is None
    unseen = Signal("v", "m/s", [noisy, np.full(300, np.nan)], [np.arange(300.0)] * 2, ["a", "b"])
    assert find_dead_sensor(unseen, unseen) is None
