"""Wiring: another sign, order or unit is found where it is wrong, and doubted nowhere else."""

import warnings

import numpy as np
import pandas as pd
import pytest
import sympy
from ruamel.yaml import YAML

from sklearn_pgnn import PhysicsModel, datasets, effects, systems
from sklearn_pgnn.physics.effects.wiring import (
    ExchangedInputs,
    ExchangedOutputs,
    InputFactor,
    OtherClock,
    OutputFactor,
    ReversedInput,
    ReversedOutput,
    ReversedTerm,
)
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.record_quality import wiring as wiring_module
from sklearn_pgnn.record_quality.wiring import find_wiring
from sklearn_pgnn.trajectories import read_records

yaml = YAML(typ="safe")
MOTOR = PhysicsModel(
    {"w": "rad/s"},
    {"w": "(volt - kv*w)/ka"},
    {"kv": 0.4, "ka": 0.1},
    {"volt": "V"},
    {"speed": "w"},
    name="motor",
    inertia={"w": "ka"},
)
PAIR = PhysicsModel(
    {"a": "K", "b": "K"},
    {"a": "(3*left - a + c*(b - a))/T1", "b": "(right - b + c*(a - b))/T2"},
    {"c": 0.5, "T1": 2.0, "T2": 4.0},
    {"left": "kW", "right": "kW"},
    {"near": "a", "far": "b"},
    name="pair",
)
TWIN = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(left + right - d*v - k*x)/m"},
    {"d": 0.8, "k": 20.0, "m": 2.0},
    {"left": "N", "right": "N"},
    {"x": "x"},
    name="twin",
)
DISC = PhysicsModel(
    {"angle": "deg"}, {"angle": "(u - angle)/T"}, {"T": 0.7}, {"u": "deg"}, name="disc"
)
CART = systems.cart_on_spring()


def records(rig, model, seed=0, dt=0.05, n=400, lost=0.01):
    """Measure a rig as if it were the model: steps of its inputs, noise on its outputs."""
    rng, rows, outputs = np.random.default_rng(seed), [], []
    t = dt * np.arange(n)
    for trajectory in range(3):
        u = np.repeat(rng.normal(2.0, 3.0, (20, len(rig.inputs))), n // 20, axis=0)
        y = rig.simulate(t, u, substeps=8).check().y
        rows.append(np.column_stack([t, u]))
        outputs.append(y)
        assert np.isfinite(y).all(), trajectory
    y = np.vstack(outputs)
    y += lost * y.std(axis=0) * rng.standard_normal(y.shape)
    return read_records(model, np.vstack(rows), y)


@pytest.mark.parametrize(
    ("model", "wiring", "line"),
    [
        (MOTOR, ReversedOutput("speed"), 'outputs: {speed: "-w"}'),
        (PAIR, ReversedInput("left"), "equations: {a: "),
        (PAIR, ReversedOutput("far"), 'outputs: {far: "-b"}'),
        (PAIR, ExchangedInputs("left and right"), "equations: {a: "),
        (PAIR, ExchangedOutputs("near and far"), 'outputs: {near: "b", far: "a"}'),
        (CART, ReversedTerm("-k*x/m in v"), "equations: {v: "),
        (MOTOR, OutputFactor("57.2957795131 on speed"), 'columns: {speed: "speed [deg/s]"}'),
        (MOTOR, OutputFactor("4096 on speed"), 'outputs: {speed: "4096*w"}'),
        (MOTOR, OutputFactor(f"{2048 / (2 * np.pi):.12g} on speed"), 'outputs: {speed: "1024*w/pi'),
        (
            MOTOR,
            OutputFactor(f"{10_000 / (2 * np.pi):.12g} on speed"),
            'outputs: {speed: "5000*w/pi',
        ),
        (DISC, OutputFactor(f"{1024 / 360:.12g} on angle"), 'outputs: {angle: "'),
        (PAIR, InputFactor("0.001 on left"), "equations: {a: "),
    ],
)
def test_a_wrong_wiring_is_said_with_the_line_to_write(model, wiring, line):
    """The rig is the wired model: with the model as given, its wiring is wrong."""
    found = find_wiring(model, records(wiring.apply(model), model))
    assert wiring in found.wirings
    assert found.after < found.before / 3
    told = next(each for each in found.wirings if each == wiring)
    assert told.lines(model).startswith(line)
    finding = found.finding(model)
    assert finding.kind == "wiring"
    assert "the model follows the records with" in finding.text
    assert found.wirings[0].lines(model) in finding.remedy


@pytest.mark.parametrize(("unit", "second"), [("ms", 1e-3), ("min", 60.0), ("d", 86400.0)])
def test_another_unit_of_time_is_found(unit, second):
    t = 0.05 * np.arange(600) * 3
    u = np.repeat(np.random.default_rng(0).normal(size=30), 20)
    y = CART.simulate(t, u, substeps=8).y
    y += 0.01 * y.std() * np.random.default_rng(1).standard_normal(y.shape)
    found = find_wiring(CART, read_records(CART, np.c_[t / second, u], y))
    assert found.wirings[0] == OtherClock(unit)
    assert found.wirings[0].lines(CART) == f'columns: {{t: "t [{unit}]"}}'


def test_what_acts_on_nothing_is_not_fitted():
    """Thousands of constants that no equation uses cost a check nothing."""
    more = {f"p{i}": 1.0 for i in range(50)}
    model = MOTOR.replace(parameters={**MOTOR.parameters, **more})
    assert [each.name for each in wiring_module._freedoms(model, True)] == ["kv", "ka"]


def test_counts_are_told_by_the_turn():
    counts = OutputFactor(f"{4096 / (2 * np.pi):.12g} on speed")
    assert counts.title(counts.target) == "factor 651.9 (4096 counts a turn) on speed"
    assert counts.apply(MOTOR).outputs["speed"] == 2048 * symbol("w") / sympy.pi
    assert InputFactor(f"{500 / (2 * np.pi):.12g} on volt") not in map(
        InputFactor, InputFactor.targets(MOTOR)
    )  # a voltage has no turns


def test_a_wrong_wiring_is_found_beside_missing_friction():
    rig = ReversedOutput("speed").apply(MOTOR + effects.CoulombFriction("w", level=0.6))
    found = find_wiring(MOTOR, records(rig, MOTOR))
    assert found.wirings[:2] == (ReversedOutput("speed"), ReversedInput("volt"))


def test_the_lines_to_write_are_read_again_and_mend_the_model():
    """A model file with the line is the wired model."""
    for wiring in (ExchangedInputs("left and right"), ReversedInput("left")):
        (part, lines), wired = _parsed(wiring.lines(PAIR)), wiring.apply(PAIR)
        written = PAIR.replace(**{part: {**getattr(PAIR, part), **lines}})
        assert find_wiring(written, records(wired, written)) is None
        assert find_wiring(PAIR, records(wired, PAIR)).wirings[0] == wiring


def _parsed(line):
    (part,), (said,) = (list(each) for each in zip(*yaml.load(line).items(), strict=True))
    return part, dict(said)


def off(model, rng):
    """Return a model whose parameters are up to 50 % off."""
    names = model.free_parameters
    wrong = {n: model.parameters[n].value * rng.uniform(0.5, 1.5) for n in names}
    return model.with_parameters(**wrong)


@pytest.mark.slow
def test_a_right_wiring_is_not_doubted_in_99_of_100_draws():
    """With symmetric inputs, noise, parameters that are half off, and friction that is missing."""
    doubted, frictions = [], {"motor": "w", "twin": "v", "cart_on_spring": "v"}
    for seed in range(100):
        rng = np.random.default_rng(seed)
        model = (MOTOR, PAIR, TWIN, CART)[seed % 4]
        target, rig = frictions.get(model.name), model
        if target is not None and seed % 8 >= 4:
            rig = model + effects.CoulombFriction(target, level=rng.uniform(0.1, 1.0))
        given = off(model, rng)
        found = find_wiring(given, records(rig, given, seed, lost=10 ** rng.uniform(-3, -1)))
        doubted += [] if found is None else [(seed, model.name, found.wirings)]
    assert len(doubted) <= 1, doubted


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_missing_physics_is_not_taken_for_a_wire(seed):
    hidden = datasets.make_hidden_effect(
        CART, "random", n_records=3, duration=8, sample_rate=50, random_state=seed
    )
    assert find_wiring(hidden.prior, read_records(hidden.prior, hidden.X, hidden.y)) is None


@pytest.mark.parametrize("rate", ["1e9*v*v", "1e6*v**2 + 1", "v*(v + 1)*(v + 2)*(x + 3)**4"])
def test_a_model_that_ends_at_once_has_no_wiring_and_is_no_bug(rate):
    model = PhysicsModel(
        {"x": "m", "v": "m/s"}, {"x": "v", "v": rate}, inputs={"F": "N"}, outputs={"y": "x"}
    )
    t = 0.02 * np.arange(300)
    X = pd.DataFrame({"t": t, "F": np.sign(np.sin(4 * t))})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert find_wiring(model, read_records(model, X, np.sin(3 * t))) is None


TIED = PhysicsModel(
    {"x": "m", "v": "m/s", "z": "m"},
    {"x": "v", "v": "F - k*x - v", "z": "x - z"},
    {"k": 9.0},
    {"F": "N"},
    outputs={"a": "x", "b": "z"},
)


@pytest.mark.parametrize(
    ("wiring", "outputs"),
    [
        (ReversedOutput("b"), {"b"}),
        (ExchangedOutputs("a and b"), {"a", "b"}),
        (ReversedTerm("-k*x in v"), {"a"}),
        (ReversedTerm("-z in z"), {"b"}),
        (ReversedInput("F"), set()),
    ],
    ids=lambda each: getattr(each, "id", ""),
)
def test_what_a_wiring_spoils_is_told_by_the_outputs_that_change_with_it(wiring, outputs):
    assert set(wiring.seen_at(TIED)) == outputs
    t = np.arange(0, 5, 0.02)
    one, other = (
        model.simulate(t, np.sin(3 * t), x0=[0.3, 0.0, 0.1]).y for model in (TIED, TIED + wiring)
    )
    for output, changed in zip(TIED.outputs, (one != other).any(axis=0), strict=True):
        assert changed or output not in outputs
