"""A test rig: excitations, their amplitudes, the response of the machine, and tables of it."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from sklearn_pgnn.datasets.integrator import Plant, integrate

# -- tables `X` and `y` that the estimators read ---------------------------------------------------


def make_tables(model, t, u, x0, y):
    """Write records as X, with the states in the first row of a trajectory, and y, row by row."""
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
    """Add white Gaussian noise to outputs (n_records, n_samples, n_outputs), common or by name."""
    return y + noise_levels(model, noise) * rng.standard_normal(y.shape)


def noise_levels(model, noise):
    """Return the standard deviation of the noise of every output; one in no mapping has none."""
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


# -- the response ----------------------------------------------------------------------------------

#: reach: how far the first output may move from its start, by unit; 1 for any other
REACH = {"rad": 1.2, "deg": 70.0}
#: excursion, as a fraction of the reach, above which a record's amplitude is lowered, and below
#: which it is raised
TOO_FAR, HARDLY = 1.2, 0.15
#: least fraction of a record's amplitude: an effect may shift the machine at any amplitude
KEPT = 0.3
#: iterations of the search for amplitudes, and their tolerance
ROUNDS, NEAR = 8, 0.3


@dataclass(frozen=True)
class Rig:
    """The commanded inputs of a set of records: waves of size 1, about an offset."""

    t: np.ndarray
    waves: np.ndarray
    offset: np.ndarray
    substeps: int = 1

    def inputs(self, amplitudes):
        """Return inputs (n_records, n_samples, n_inputs) of an amplitude [input] a record."""
        return self.offset + amplitudes[:, None, None] * self.waves

    def run(self, plant, amplitudes, *, states=()):
        """Drive a machine; return states and outputs without noise, (n_records, n_samples, n)."""
        start = np.array([list(plant.initial_state.values())] * len(amplitudes))
        start = settled(plant, states or plant.states, start, self.offset)
        return integrate(plant, self.t, self.inputs(amplitudes), start, substeps=self.substeps)


def resting_input(model):
    """Return the inputs nearest to holding a machine at rest, :math:`f(0, x_0, u) = 0`.

    >>> from sklearn_pgnn.physics import systems
    >>> resting_input(systems.two_tanks()).round(6)
    array([3.])
    """
    plant, n = Plant(model), len(model.inputs)
    x = np.tile(np.array(list(model.initial_state.values()))[:, None], n + 1)
    u = np.hstack([np.zeros((n, 1)), np.eye(n)])
    rates = plant.rates(0.0, x, list(u), plant.sides(x))
    return -np.linalg.pinv(rates[:, 1:] - rates[:, :1]) @ rates[:, 0]


def settled(plant, known, x, u):
    """Set unknown states (n_records, n_states) to where a rate, affine in its own, is zero."""
    x, unknown = x.copy(), [i for i, name in enumerate(plant.states) if name not in known]
    if not unknown:
        return x
    rates = Plant(plant)
    u = list(np.broadcast_to(u, (len(x), np.shape(u)[-1])).T)
    for i in unknown:
        at = []
        for value in (0.0, 1.0):
            x[:, i] = value
            at.append(rates.rates(0.0, x.T, u, rates.sides(x.T))[i])
        slope = at[1] - at[0]
        x[:, i] = np.where(slope != 0, -at[0] / np.where(slope != 0, slope, 1.0), 0.0)
        for acting in u:  # a bounded rate is affine only near the input that it follows
            rest = rates.rates(0.0, x.T, u, rates.sides(x.T))[i]
            there = x.copy()
            there[:, i] = acting
            other = rates.rates(0.0, there.T, u, rates.sides(there.T))[i]
            x[:, i] = np.where(np.abs(other) < np.abs(rest), acting, x[:, i])
    return x


def excursion(model, y):
    """Return the largest excursion of the first output, relative to its reach, of every record."""
    reach = REACH.get(model.unit(next(iter(model.outputs))), 1.0)
    moved = np.abs(y[..., 0] - y[:, :1, 0]).max(axis=1)
    return np.where(np.isfinite(y).all(axis=(1, 2)), moved, np.inf) / reach


def find_amplitudes(rig: Rig, model, goals):
    """Find the amplitudes [input] with which every record reaches its share of the reach."""
    amplitudes = np.full(goals.size, max(1.0, np.abs(rig.offset).max(initial=0.0)))
    for _ in range(ROUNDS):
        moved = np.maximum(excursion(model, rig.run(model, amplitudes)[1]), 1e-9)
        if np.abs(moved / goals - 1).max() < NEAR:
            break
        amplitudes = amplitudes * np.clip((goals / moved) ** 0.8, 0.1, 5.0)
    return amplitudes


def run_bounded(rig: Rig, plant, model, amplitudes):
    """Drive a machine with amplitudes [input] adjusted where it moves too far or hardly."""
    x, y = rig.run(plant, amplitudes, states=model.states)
    least, amplitudes = KEPT * amplitudes, amplitudes.copy()
    for _ in range(ROUNDS):
        moved = excursion(plant, y)
        hardly = moved < HARDLY
        again = np.flatnonzero((moved > TOO_FAR) & (amplitudes > least) | hardly)
        if not again.size:
            break
        amplitudes[again] *= np.where(hardly[again], 1.5, 0.7)
        part = replace(rig, waves=rig.waves[again])
        x[again], y[again] = part.run(plant, amplitudes[again], states=model.states)
    return amplitudes, x, y
