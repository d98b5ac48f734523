"""Something unmeasured acts on the machine: it gets no name, and hides none."""

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from sklearn_pgnn import ModelDiagnosis, PhysicsModel

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - c*x)/m"},
    {"m": 2.0, "d": 0.8, "c": 6.0},
    {"F": "N"},
    outputs={"position": "x"},
    inertia={"v": "m"},
)
CATALOGUE = ("coulomb_friction", "quadratic_drag", "actuator_lag", "cubic_stiffness")
STEP, SIZE, RECORDS = 0.02, 600, 4


def drive(rig, disturbance, seed):
    """Drive a rig on which a slow force of so many newtons acts."""
    rng, X, y = np.random.default_rng(seed), [], []
    kept = np.exp(-STEP / 0.5)
    for i in range(RECORDS):
        t = STEP * np.arange(SIZE)
        force = 4.0 * np.sin(1.3 * t + i) + 2.0 * np.sin(0.5 * t * t)
        slow = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(SIZE))
        run = rig.simulate(t, force + disturbance * slow, substeps=5).check()
        X.append(pd.DataFrame({"trajectory": i, "t": t, "F": force}))
        y.append(run.y[:, 0] + 1e-3 * rng.standard_normal(SIZE))
    return pd.concat(X, ignore_index=True), np.concatenate(y)


def diagnose(rig, disturbance, seed):
    """Diagnose the cart's records."""
    return ModelDiagnosis(CART, catalogue=CATALOGUE).fit(*drive(rig, disturbance, seed))
