"""A cart on a spring on which a slow force acts that nothing measures."""

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from sklearn_pgnn import PhysicsModel

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - c*x)/m"},
    {"m": 2.0, "d": 0.8, "c": 6.0},
    {"F": "N"},
    outputs={"position": "x"},
    inertia={"v": "m"},
)
STEP, SIZE, RECORDS = 0.02, 600, 4


def slow_noise(rng, kept, shape):
    """Draw first-order noise of unit variance along the last axis."""
    return lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(shape))


def drive(rig, disturbance, seed=0, noise=1e-3, substeps=5):
    """Drive a rig on which a slow force of so many newtons acts; give X and y."""
    rng, X, y = np.random.default_rng(seed), [], []
    for i in range(RECORDS):
        t = STEP * np.arange(SIZE)
        force = 4.0 * np.sin(1.3 * t + i) + 2.0 * np.sin(0.5 * t * t)
        slow = disturbance * slow_noise(rng, np.exp(-STEP / 0.5), SIZE)
        run = rig.simulate(t, force + slow, substeps=substeps).check()
        X.append(pd.DataFrame({"trajectory": i, "t": t, "F": force}))
        y.append(run.y[:, 0] + noise * rng.standard_normal(SIZE))
    return pd.concat(X, ignore_index=True), np.concatenate(y)
