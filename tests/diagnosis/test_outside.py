"""What is not in the catalogue takes probability from what stands in for it."""

import numpy as np
import pandas as pd
import pytest
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.diagnosis.outside import OPEN, other_places

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - k*x)/m"},
    {"m": 2.0, "d": 0.5, "k": 8.0},
    {"F": "N"},
    {"x": "x", "speed": "v"},
    inertia={"v": "m"},
)


def test_only_a_sensor_and_time_have_other_places_in_the_plant():
    places = {
        cause: other_places(CART, cause)
        for cause in (
            effects.SensorBias("speed", 0.1),
            effects.SensorCurvature("x", 0.1),
            effects.ParameterDrift("d", 0.1),
            effects.CoulombFriction("v", 0.1),
            effects.InputBias("F", 0.1),
            effects.WrongParameter("m"),
        )
    }
    assert list(places.values()) == [("v",), ("v",), ("v",), (), (), ()]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_a_cause_beside_which_only_noise_is_left_keeps_its_probability(noise):
    rig = SLEDGE + effects.CoulombFriction("v", 0.4)
    found = ModelDiagnosis(SLEDGE).fit(*drive(rig, noise=noise * NOISE))
    (cause,) = found.causes_
    assert (cause.effect, found.verdict_) == ("coulomb_friction", "cause_named")
    assert cause.outside < 1e-3
    assert cause.probability > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [effects.ConstantLoad("v", 2.0), effects.SensorBias("x", -0.25)])
def test_of_a_load_on_a_spring_and_a_bias_the_load_comes_first_and_the_bias_is_its_rival(hidden):
    """Over the spring's zero the two are the same in the equations, whatever is recorded."""
    cart = CART.replace(outputs={"x": "x"})
    rng, t = np.random.default_rng(3), np.arange(500) * 0.02
    X, y = [], []
    for record in range(3):
        force = 9 * np.sin((0.8 + 0.3 * record) * t + record) + 4 * np.sin((2.3 + record) * t)
        X.append(pd.DataFrame({"trajectory": record, "t": t, "F": force}))
        y.append((cart + hidden).simulate(t, force).y[:, 0] + 2e-3 * rng.normal(size=t.size))
    catalogue = ("sensor_bias", "constant_load", "coulomb_friction")
    found = ModelDiagnosis(cart, catalogue=catalogue).fit(pd.concat(X), np.concatenate(y))
    (cause,) = found.causes_
    assert (cause.effect, found.verdict_) == ("constant_load", "ambiguous")
    (rival,) = cause.confused_with
    assert rival.effect == "sensor_bias"
    assert cause.probability + rival.probability + cause.outside == pytest.approx(1.0)
    told = found.to_dict()["causes"][0]
    shares = [told["probability"], told["outside_catalogue"]]
    shares += [each["probability"] for each in told["confused_with"]]
    assert sum(shares) == pytest.approx(1.0)


@pytest.mark.slow
def test_a_true_sensor_effect_is_not_doubted_for_a_law_of_the_plant():
    rig = SLEDGE + effects.SensorSaturation("v", upper=0.9, lower=-0.9)
    X, y = drive(rig)
    found = ModelDiagnosis(SLEDGE, catalogue=("sensor_saturation", "sensor_curvature")).fit(X, y)
    assert found.causes_[0].effect == "sensor_saturation"
    assert found.causes_[0].outside < OPEN


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_no_name_is_sure_beside_which_much_is_left_that_no_name_covers(seed):
    """A drag that turns with the speed: no power of it, no dry friction, no sensor."""
    rig = PhysicsModel(
        {"v": "m/s"}, {"v": "(F - d*v - 0.8*sin(4*v))/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}
    )
    catalogue = ("sensor_curvature", "sensor_saturation", "parameter_drift", "input_gain")
    found = ModelDiagnosis(SLEDGE, catalogue=catalogue).fit(*drive(rig, seed=seed))
    assert found.remaining_.is_much or not found.causes_
    assert all(cause.probability < 0.9 for cause in found.causes_)
    assert found.verdict_ in ("ambiguous", "unexplained", "nothing_found")
