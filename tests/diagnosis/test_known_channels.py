"""What is known of a channel leaves out what it cannot have, and nothing else."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects

ROOM = PhysicsModel(
    {"T": "degC"},
    {"T": "(Q - G*(T - Ta))/C"},
    {"G": {"value": 9.0, "unit": "W/K"}, "C": {"value": 450.0, "unit": "J/K"}},
    inputs={"Q": "W", "Ta": "degC"},
    outputs={"T": "T"},
    initial_state={"T": 20.0},
)
CATALOGUE = ("actuator_lag", "input_gain", "input_bias", "input_dead_zone", "sensor_saturation")


def diagnosed(hidden, seed=0, **channels):
    """Diagnose a room under a changing sky, of whose channels something is known."""
    rng, t = np.random.default_rng(seed), 2.0 * np.arange(400)
    X, y = [], []
    for number in range(3):
        heat = np.repeat(rng.uniform(0.0, 200.0, 16), 25)
        sky = 10.0 + np.repeat(rng.uniform(-6.0, 6.0, 20), 20)
        run = (ROOM + hidden).simulate(t, np.column_stack([heat, sky])).y[:, 0]
        X.append(np.column_stack([np.full(t.size, number), t, heat, sky]))
        y.append(run + 0.01 * rng.normal(size=t.size))
    table = dict(zip(("trajectory", "t", "Q", "Ta"), np.vstack(X).T, strict=True))
    model = ROOM.replace(channels=channels)
    return ModelDiagnosis(model, catalogue=CATALOGUE).fit(pd.DataFrame(table), np.concatenate(y))


@pytest.mark.slow
def test_a_lag_of_what_is_measured_is_not_taken_for_an_actuator():
    lag = effects.ActuatorLag("Ta", 30.0)
    named = [(c.effect, c.target) for c in diagnosed(lag).causes_]
    assert named == [("actuator_lag", "Ta")]
    known = diagnosed(lag, Ta="measured", Q="commanded")
    every = [*known.causes_, *(r for cause in known.causes_ for r in cause.confused_with)]
    assert not [each for each in every if each.effect == "actuator_lag" and each.target == "Ta"]
    assert known.verdict_ != "model_adequate"  # the lag is still there, and without a name


@pytest.mark.slow
def test_the_scale_of_a_measured_input_is_named_as_a_sensors():
    (cause,) = diagnosed(effects.InputGain("Ta", 0.3), Ta="thermocouple").causes_
    assert (cause.effect, cause.target) == ("input_gain", "Ta")
    assert cause.parameters["error"].value == pytest.approx(0.3, abs=0.03)
    assert cause.summary.startswith("The scale of the sensor is off")
    assert "second instrument" in cause.check
