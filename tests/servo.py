"""Records of a servo that is late, and whose gain falls from 1 Hz to 5 Hz; its model is a lag."""

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from sklearn_pgnn import PhysicsModel

PARAMETERS = {"G": {"value": 1.0, "spread": 0.5}, "T": {"value": 0.005, "spread": 1.0}}
SERVO = PhysicsModel({"w": "rad/s"}, {"w": "(G*command - w)/T"}, PARAMETERS, {"command": "rad/s"})
STEP, LATE, NOISE = 0.002, 2, 0.03


def follow_sines(frequencies=(1, 3, 5), samples=2500):
    """Return X and y of a record a frequency."""
    tables, speeds = [], []
    t, slow = STEP * np.arange(samples), STEP / 0.08
    for record, frequency in enumerate(frequencies):
        command = 2 * np.sin(2 * np.pi * frequency * t)
        seen = np.concatenate([np.zeros(LATE), command[:-LATE]])
        seen = 0.84 * seen + 0.16 * lfilter([slow], [1, slow - 1], seen)
        noise = NOISE * np.random.default_rng(record).normal(size=t.size)
        speeds.append(lfilter([0.0, 0.49], [1, -0.51], seen) + noise)
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "command": command}))
    return pd.concat(tables, ignore_index=True), pd.DataFrame({"w": np.concatenate(speeds)})
