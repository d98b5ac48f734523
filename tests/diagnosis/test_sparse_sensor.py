"""A sensor that is read at every twentieth sample only, beside a fast one of the same state."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects

CATALOGUE = ["sensor_bias", "sensor_gain", "coulomb_friction", "actuator_lag"]


@pytest.mark.slow
def test_the_bias_of_the_fast_sensor_is_named_beside_a_slow_one():
    spring = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "-k*x - d*v + u"},
        {"k": 30.0, "d": 0.6},
        {"u": "N"},
        outputs={"p": "x", "q": "x"},
    )
    t = np.arange(1500) * 0.02
    u = 16 * np.repeat(np.random.default_rng(0).normal(size=75), 20)
    y = (spring + effects.SensorBias("p", 0.2)).simulate(t, u, substeps=8).y
    y += 0.01 * np.std(y, axis=0) * np.random.default_rng(1).normal(size=y.shape)
    y[np.arange(1500) % 20 != 0, 1] = np.nan
    diagnosis = ModelDiagnosis(spring, max_causes=1, catalogue=CATALOGUE)
    diagnosis.fit(pd.DataFrame({"t": t, "u": u}), y)
    (cause,) = diagnosis.causes_
    assert (cause.effect, cause.target) == ("sensor_bias", "p")
    assert diagnosis.gain_["p"].extended < 1.1 * diagnosis.gain_["p"].noise
