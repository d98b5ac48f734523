"""Machines with what their models lack, written out by hand and integrated here: no part of it is
the package's. Dry friction is smoothed, and the steps are fine."""

import numpy as np
import pandas as pd

STEPS = 8


def integrate(rates, x0, t, u, steps=STEPS):
    """Return the states of records that run together, by Runge-Kutta steps with held inputs.

    `rates` maps the time, states and inputs, each a row of records, to the states' rates.
    """
    x, kept = np.array(x0, dtype=float), []
    step = (t[1] - t[0]) / steps
    for k in range(t.size):
        kept.append(x)
        for _ in range(steps):
            a = np.array(rates(x, u[:, k]))
            b = np.array(rates(x + step / 2 * a, u[:, k]))
            c = np.array(rates(x + step / 2 * b, u[:, k]))
            d = np.array(rates(x + step * c, u[:, k]))
            x = x + step / 6 * (a + 2 * b + 2 * c + d)
    return np.stack(kept, axis=-1)


def waves(t, rng, count, lines):
    """Return sums of sines at some frequencies [Hz], of about one as their largest value."""
    phases = rng.uniform(0, 2 * np.pi, (count, len(lines), 1))
    sizes = rng.uniform(0.5, 1.0, (count, len(lines), 1)) / len(lines) ** 0.5
    return (sizes * np.sin(2 * np.pi * np.array(lines)[None, :, None] * t + phases)).sum(axis=1)


def tables(t, u, y):
    """Return X and y of records; `u` and `y` map names to arrays of records and samples."""
    count = len(next(iter(y.values())))
    X = [
        pd.DataFrame({"trajectory": i, "t": t, **{name: each[i] for name, each in u.items()}})
        for i in range(count)
    ]
    return pd.concat(X, ignore_index=True), pd.DataFrame({n: e.ravel() for n, e in y.items()})
