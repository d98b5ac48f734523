"""Records of a sledge: one speed, one force, so small that a diagnosis of them is quick."""

from functools import lru_cache

import numpy as np
import pandas as pd

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects

SLEDGE = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}, inertia={"v": "m"}
)
STEP, NOISE = 0.02, 2e-3


def drive(rig=SLEDGE, n_records=4, samples=500, noise=NOISE, seed=0):
    """Return X and y of a sledge that is pushed to and fro."""
    rng, X, y = np.random.default_rng(seed), [], []
    for record in range(n_records):
        t = np.arange(samples) * STEP
        force = 2 * np.sin((0.7 + 0.2 * record) * t + record) + np.sin((1.9 + record) * t)
        X.append(pd.DataFrame({"trajectory": record, "t": t, "F": force}))
        y.append(rig.simulate(t, force, substeps=5).y[:, 0] + noise * rng.normal(size=t.size))
    return pd.concat(X, ignore_index=True), pd.DataFrame({"v": np.concatenate(y)})


@lru_cache(maxsize=1)
def rough_sledge():
    """Return a diagnosis, its model without the dry friction, and the X and y it was fitted on."""
    X, y = drive(SLEDGE + effects.CoulombFriction("v", level=0.3))
    catalogue = (effects.CoulombFriction, effects.InputBias, effects.QuadraticDrag)
    return ModelDiagnosis(SLEDGE, catalogue=catalogue).fit(X, y), X, y
