"""A cart on a spring whose plant loses more energy than its model, and records of it."""

import numpy as np
import pandas as pd

from sklearn_pgnn import PhysicsModel

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(force - d*v - k*x)/m"},
    {"m": 1.0, "d": 0.2, "k": 4.0},
    {"force": "N"},
    outputs={"x": "x", "v": "v"},
    inertia={"v": "m"},
    energy={"stored": "m*v**2/2 + k*x**2/2", "dissipated": "d*v**2", "supplied": "force*v"},
)
BRAKED = CART.replace(equations={"x": "v", "v": "(force - d*v - 0.5*v*abs(v) - k*x)/m"})
QUICK = {"max_epochs": 15, "module__neurons": 4, "refine_max_iter": 40, "substeps": 1}


def records(plant=BRAKED, n=3, n_samples=150, seed=0):
    """Return X and Y of some trajectories of a plant under forces drawn at random."""
    rng = np.random.default_rng(seed)
    frames, outputs = [], []
    for i in range(n):
        t = 0.05 * np.arange(n_samples)
        force = 3 * np.repeat(rng.normal(size=n_samples // 15 + 1), 15)[:n_samples]
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.0, "v": 0.0}))
        outputs.append(plant.simulate(t, force, [0.0, 0.0], substeps=4).y)
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)
