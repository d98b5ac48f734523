"""Conversion of simulated arrays to the tables `X` and `y` that the estimators read."""

import numpy as np
import pandas as pd


def make_tables(model, t, u, x0, y):
    """Write records as two tables, one row per sample, one trajectory after the other.

    X has the columns ``trajectory``, ``t``, the inputs and the states; the states are known in the
    first row of a trajectory and NaN in the others. Times [s] are common to the records, over which
    the first axis of `u`, `x0` and `y` runs.
    """
    n_records, n_samples = u.shape[:2]
    x = np.full((n_records, n_samples, len(model.states)), np.nan)
    x[:, 0] = x0
    columns = {
        "trajectory": np.repeat(np.arange(n_records), n_samples),
        "t": np.tile(t, n_records),
        **_columns(model.inputs, u),
        **_columns(model.states, x),
    }
    return pd.DataFrame(columns), pd.DataFrame(_columns(model.outputs, y))


def add_noise(model, y, noise, rng):
    """Add white Gaussian noise to the outputs.

    Their shape is (n_records, n_samples, n_outputs). The standard deviation `noise` is common, or
    per output by name.
    """
    return y + noise_levels(model, noise) * rng.standard_normal(y.shape)


def noise_levels(model, noise):
    """Return the standard deviation of the noise of every output.

    `noise` is common, or per output; outputs missing from a mapping have no noise.
    """
    levels = noise if hasattr(noise, "get") else dict.fromkeys(model.outputs, noise)
    unknown = [name for name in levels if name not in model.outputs]
    values = np.array([float(levels.get(name, 0.0)) for name in model.outputs])
    if unknown or (values < 0).any():
        raise ValueError(
            f"noise: expected a number >= 0, or one for each of {', '.join(model.outputs)}, "
            f"got {noise!r}."
        )
    return values


def _columns(names, values):
    """Name the last axis and stack the records."""
    return {name: values[..., i].ravel() for i, name in enumerate(names)}
