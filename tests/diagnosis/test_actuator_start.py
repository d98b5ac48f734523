"""States that records tell little of: of an actuator at first, behind a seldom read sensor."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects

NOISE, LAG = 0.01, 0.35
SERVO = PhysicsModel(
    {"w": "rad/s"}, {"w": "(K*u - w)/T"}, {"K": 3.0, "T": 0.6}, {"u": "V"}, outputs={"w": "w"}
)
TRUTH = SERVO + effects.ActuatorLag("u", LAG)


def steps(at_rest: bool, seed: int):
    """Three records of a staircase that begins in the first sample; the machine stands still."""
    rng, tables, outputs = np.random.default_rng(seed), [], []
    for record in range(3):
        levels = np.repeat(rng.uniform(1.0, 4.0, 8) * rng.choice([-1, 1], 8), 60)
        t, begun = 0.02 * np.arange(levels.size), 0.0 if at_rest else levels[0]
        run = TRUTH.simulate(t, levels, [0.0, begun], substeps=4)
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "u": levels}))
        outputs.append(run.y[:, 0])
    y = np.concatenate(outputs)
    return pd.concat(tables, ignore_index=True), y + NOISE * rng.normal(size=y.size)


@pytest.mark.slow
@pytest.mark.parametrize("at_rest", [True, False])
def test_a_lag_begins_where_the_records_say(at_rest):
    X, y = steps(at_rest, seed=3)
    found = ModelDiagnosis(SERVO, catalogue=[effects.ActuatorLag], max_causes=1).fit(X, y)
    assert [cause.effect for cause in found.causes_] == ["actuator_lag"]
    first = X.groupby("trajectory")["u"].first().to_numpy()
    begun = 0.0 * first if at_rest else first
    assert found.initial_states_[:, 1] == pytest.approx(begun, abs=0.4)
    assert found.free_run_["w"].extended < 1.5 * NOISE
    further, measured = steps(at_rest, seed=8)
    for _, rows in further.groupby("trajectory"):
        run = found.extended_model_.simulate(rows["t"], rows["u"]).y[:, 0]
        assert np.sqrt(np.mean((run - measured[rows.index]) ** 2)) < 3 * NOISE
    assert ("u_lagged" in found.extended_model_.settled) is not at_rest


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
