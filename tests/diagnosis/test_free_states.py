"""States that begin anew in every window explain nothing by that alone."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, systems
from sklearn_pgnn.datasets import make_hidden_effect

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
