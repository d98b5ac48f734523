"""An actuator's own state starts where the first samples tell, at rest or settled."""

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
