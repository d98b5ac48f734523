"""A servo whose model is a lag, and records: as the model says, or of one that is not so."""

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from sklearn_pgnn import PhysicsModel

PARAMETERS = {"G": {"value": 1.0, "spread": 0.5}, "T": {"value": 0.005, "spread": 1.0}}
SERVO = PhysicsModel({"w": "rad/s"}, {"w": "(G*command - w)/T"}, PARAMETERS, {"command": "rad/s"})
STEP, LATE, NOISE = 0.002, 2, 0.03


def follow_steps(servo, records=4, samples=600, noise=0.01):
    """Return X and y of a servo that follows levels drawn at random."""
    tables, speeds, rng = [], [], np.random.default_rng(0)
    t = STEP * np.arange(samples)
    for record in range(records):
        command = np.repeat(rng.uniform(-2, 2, samples // 10), 10)
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "command": command}))
        run = servo.simulate(t, command, substeps=32)
        speeds.append(run.y[:, 0] + noise * rng.normal(size=t.size))
    return pd.concat(tables, ignore_index=True), pd.DataFrame({"w": np.concatenate(speeds)})


def follow_sines(frequencies=(1, 3, 5), samples=2500):
    """Return X and y of a servo that is late, and whose gain falls, a record a frequency [Hz]."""
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
