"""Something unmeasured acts, or states begin anew in every window: neither gets a name."""

import numpy as np
import pandas as pd
import pytest
from disturbed_cart import CART, RECORDS, drive, slow_noise

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, datasets, effects, systems
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.diagnosis.formula_selection import FormulaSelection
from sklearn_pgnn.diagnosis.moves import Moves
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.trajectories import read_records


def leaking_tanks():
    """Let water that nothing measures come and go in the lower tank; give the prior, X and y."""
    model, rng = systems.two_tanks(), np.random.default_rng(11)
    options = {"n_records": RECORDS, "duration": 600.0, "sample_rate": 0.5, "noise": 1e-2}
    shape = {"excitation": ("multisine", "chirp"), "amplitude": 2.7, "random_state": 11}
    calm = datasets.make_hidden_effect(model, None, **options, **shape)
    records = [rows for _, rows in calm.X.groupby("trajectory")]
    t = records[0]["t"].to_numpy()
    u = np.stack([rows[list(model.inputs)] for rows in records])
    x0 = np.stack([rows[list(model.states)].iloc[0] for rows in records])
    x, y = integrate(model, t, u, x0)
    flow = slow_noise(rng, np.exp(-50 / t.size), u.shape[:2])
    flow *= 0.1 * np.std(np.gradient(x[..., 1], t, axis=1))
    rates = {**model.equations, "x2": model.equations["x2"] + symbol("flow")}
    rig = model.replace(equations=rates, inputs={**model.inputs, "flow": ""})
    _, disturbed = integrate(rig, t, np.concatenate([u, flow[..., None]], axis=2), x0)
    return calm.prior, calm.X, calm.y + (disturbed - y).reshape(calm.y.shape)


@pytest.mark.slow
def test_a_disturbance_gets_no_name_though_windows_tell_for_one(monkeypatch):
    prior, X, y = leaking_tanks()
    catalogue = ("parameter_slope", "parameter_saturation", "leak", "overflow", "state_limit")
    diagnosis = ModelDiagnosis(prior, catalogue=catalogue).fit(X, y)
    assert (diagnosis.verdict_, diagnosis.remaining_.kind) == ("nothing_found", "disturbance")
    monkeypatch.setattr(Moves, "drop_disturbed", lambda *_: None)
    monkeypatch.setattr(FormulaSelection, "choose", lambda _, search, result, left: (result, None))
    assert ModelDiagnosis(prior, catalogue=catalogue).fit(X, y).causes_


@pytest.mark.slow
@pytest.mark.parametrize(
    "hidden",
    [
        effects.CoulombFriction("v", level=0.5),
        effects.QuadraticDrag("v", 0.8),
        effects.ActuatorLag("F", 0.08),
    ],
)
def test_what_is_hidden_is_named_beside_a_disturbance(hidden):
    catalogue = ("coulomb_friction", "quadratic_drag", "actuator_lag", "cubic_stiffness")
    diagnosis = ModelDiagnosis(CART, catalogue=catalogue)
    (cause,) = diagnosis.fit(*drive(CART + hidden, 0.2)).causes_
    assert (cause.effect, cause.target) == (hidden.id, hidden.target)
    assert cause.probability > 0.99 * (1.0 - cause.outside)  # much is left, of no one knows what
    assert diagnosis.remaining_.kind == "disturbance"


@pytest.mark.slow
@pytest.mark.parametrize("short", [4, 15])
def test_a_short_record_changes_no_name(short):
    X, y = drive(CART + effects.CoulombFriction("v", level=0.5), 0.2)
    X = pd.concat([X, X[:short].assign(trajectory=RECORDS)], ignore_index=True)
    diagnosis = ModelDiagnosis(CART, catalogue=("coulomb_friction", "quadratic_drag"))
    (cause,) = diagnosis.fit(X, np.concatenate([y, y[:short]])).causes_
    assert cause.effect == "coulomb_friction"
    assert cause.probability > 0.99 * (1.0 - cause.outside)


OVEN = PhysicsModel(
    {"T": "K"}, {"T": "(P - L*T)/C"}, {"C": 500.0, "L": 4.0}, {"P": "W"}, {"probe": "T"}
)
RIG = {"n_records": 4, "duration": 2000.0, "sample_rate": 0.25, "amplitude": 60.0, "noise": 0.05}
LAGS = {("sensor_lag", "probe"), ("actuator_lag", "P")}


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["sensor_lag", "actuator_lag"])
@pytest.mark.parametrize("seed", [3, 4])
def test_a_lag_of_the_only_sensor_and_one_of_the_only_actuator_are_the_same_motion(effect, seed):
    hidden = make_hidden_effect(OVEN, effect, random_state=seed, **RIG)
    (cause,) = ModelDiagnosis(hidden.prior).fit(hidden.X, hidden.y).causes_
    found = {(cause.effect, cause.target), *((c.effect, c.target) for c in cause.confused_with)}
    assert found >= LAGS
    assert cause.probability < 0.9


@pytest.mark.slow
def test_no_memory_stands_for_a_force_and_a_spring_that_a_model_lacks():
    cart = systems.cart_on_spring()
    (force,) = cart.inputs
    hidden = make_hidden_effect(cart, None, n_records=4, random_state=5)
    lacking = cart.replace(equations={"x": "v", "v": "-d*v/m"}, energy={})
    found = ModelDiagnosis(lacking).fit(hidden.X, hidden.y)
    assert found.verdict_ == "unexplained"
    assert found.causes_ == ()
    assert {"x", force} <= set(found.discrepancy_.quantities)


@pytest.mark.slow
def test_a_falling_ball_with_drag_has_no_spring_with_memory():
    ball = PhysicsModel({"h": "m", "v": "m/s"}, {"h": "v", "v": "-9.81"}, outputs={"height": "h"})
    rng, t = np.random.default_rng(0), np.arange(50) / 15.0
    drag = PhysicsModel(ball.states, {"h": "v", "v": "-9.81 - 0.5*v"}, outputs={"height": "h"})
    X, y = [], []
    for i in range(4):
        run = drag.simulate(t, x0=[30.0 + i, 0.0])
        X.append(pd.DataFrame({"trajectory": i, "t": t}))
        y.append(run.y[:, 0] + rng.normal(0.0, 0.03, t.size))
    found = ModelDiagnosis(ball).fit(pd.concat(X), np.concatenate(y))
    assert [cause.effect for cause in found.causes_] == ["viscous_friction"]


def judged_branch(rig, disturbance):
    """Return no cause, a creeping spring beside the cart's own, and the rule that judges it."""
    records = read_records(CART, *drive(rig, disturbance, noise=1e-4))
    fitter = HypothesisFitter(build_problem(CART, records))
    branch = fitter.first_fit(fitter.subsample(fitter.base()), effects.MaxwellBranch("v"))
    found = fitter.polish(fitter.fit_all(fitter.converge(branch), fitter.base()))
    return fitter.base(), found, Comparison(fitter, SelectionCriterion(0.01, 0.01, 50))


def test_a_slow_force_from_outside_is_no_spring_that_creeps():
    """The branch explains much, by what it begins with in every window: it may not creep."""
    none, found, compare = judged_branch(CART, disturbance=0.1)
    assert compare.evidence(none, found) > compare.criterion.to_name
    assert compare.only_begins(none, found)
    assert not compare.names(none, found)
    assert not compare.refutes(found, none)


def test_a_spring_that_creeps_within_a_window_is_named():
    rig = CART + effects.MaxwellBranch("v", 6.0, 0.15)
    none, found, compare = judged_branch(rig, disturbance=0.0)
    assert not compare.only_begins(none, found)
    assert compare.names(none, found)
    assert compare.refutes(found, none)
