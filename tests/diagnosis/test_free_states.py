"""States that begin anew in every window explain nothing by that alone."""

import numpy as np
import pandas as pd
import pytest
from disturbed_cart import CART, drive

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records

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
