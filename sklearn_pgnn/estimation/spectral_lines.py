r"""What repeats in the part of a rate that a model lacks: tones in time, ripples over position.

A fit of a wave has a local minimum at every frequency, so it must begin near the right one. What
a model lacks of a velocity's rate, :math:`\dot v - f(x, u, p)`, is taken from the estimated states;
what re-tuned parameters could explain of it is projected out, and the lines that stand out in the
spectrum of the rest are where to begin; so are those of what the re-tuned model leaves of the
outputs.
"""

import numpy as np
import sympy
from scipy.ndimage import median_filter
from scipy.signal import argrelmax, lombscargle

from sklearn_pgnn.estimation.budgets import BACKGROUND, CYCLE_STEP, LINES, ROUNDING, SAMPLES
from sklearn_pgnn.physics.effects.rates import is_velocity
from sklearn_pgnn.physics.effects.springs import MOST_CYCLES
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.windows import ShootingWindows


def missing_rate(
    model: PhysicsModel, windows: ShootingWindows, x: np.ndarray, state: str
) -> np.ndarray:
    """Return what a model lacks of a state's rate, less what its parameters could explain.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    windows : ShootingWindows
        The records.
    x : ndarray of shape (n_samples, n_states)
        Estimated states.
    state : str
        The state.

    Returns
    -------
    ndarray of shape (n_samples,)
        The missing rate [state per second].
    """
    size, rate = windows.t.size, model.equations[state]
    table = sample_table(model, windows, x)
    explained = [sympy.Integer(1), *(sympy.diff(rate, symbol(n)) for n in model.free_parameters)]
    columns = np.column_stack([evaluate_samples(e, table, size) for e in explained])
    missing = _slopes(windows, table[state]) - evaluate_samples(rate, table, size)
    known = np.isfinite(columns).all(axis=1) & np.isfinite(missing)
    columns, missing = np.where(known[:, None], columns, 0.0), np.where(known, missing, 0.0)
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    return missing - columns / scale @ np.linalg.lstsq(columns / scale, missing, rcond=ROUNDING)[0]


def _slopes(windows, values):
    slopes = [
        np.gradient(values[a:b], windows.t[a:b])
        for a, b in zip(windows.bounds[:-1], windows.bounds[1:], strict=True)
    ]
    return np.concatenate(slopes)


def find_lines(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray) -> tuple[dict, dict]:
    """Find the tones and the ripples in what a model lacks of its velocities' rates.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    windows : ShootingWindows
        The records.
    x : ndarray of shape (n_samples, n_states)
        Estimated states.

    Returns
    -------
    tones : dict of str to tuple of float
        Frequencies [Hz] by velocity.
    ripples : dict of str to tuple of float
        Periods [unit of the position] by velocity.
    """
    tones, ripples = {}, {}
    pairs = model.kinematic_pairs
    for state in model.states:
        if not is_velocity(model, state):
            continue
        missing = missing_rate(model, windows, x, state)
        tones[state] = _tones(windows, missing)
        if state in pairs:
            position = x[:, list(model.states).index(pairs[state])]
            ripples[state] = _ripples(position, missing)
    return tones, ripples


def tones_left(windows: ShootingWindows, residual: np.ndarray) -> tuple[float, ...]:
    """Find the tones in what a fitted model leaves of the outputs.

    They stand out where those of the rate are lost in the noise of its derivatives.

    Parameters
    ----------
    windows : ShootingWindows
        The records.
    residual : ndarray of shape (n_samples, n_outputs)
        Measured minus simulated outputs; NaN where nothing was measured.

    Returns
    -------
    tuple of float
        Frequencies [Hz].
    """
    return tuple(t for column in np.nan_to_num(residual).T for t in _tones(windows, column))


def _tones(windows, signal) -> tuple[float, ...]:
    """Return the frequencies that stand out, the records' spectra summed."""
    step = float(np.median(np.diff(windows.t)[np.diff(windows.t) > 0]))
    spans = list(zip(windows.bounds[:-1], windows.bounds[1:], strict=True))
    size = 2 * max(b - a for a, b in spans)
    power = np.zeros(size // 2 + 1)
    for a, b in spans:
        clock = np.arange(windows.t[a], windows.t[b - 1], step)
        even = np.interp(clock, windows.t[a:b], signal[a:b])[:size]
        power += np.abs(np.fft.rfft(even * np.hanning(even.size), size)) ** 2
    frequency = np.fft.rfftfreq(size, step)
    best = _outstanding(power, first=2)
    return tuple(float(f) for f in frequency[best])


def _ripples(position, missing) -> tuple[float, ...]:
    """Return the periods over position that stand out."""
    travel = np.ptp(position)
    if not travel > 0:
        return ()
    some = slice(None, None, max(1, position.size // SAMPLES))
    cycles = np.arange(1.0, MOST_CYCLES, CYCLE_STEP)
    waves = 2 * np.pi * cycles / travel
    power = lombscargle(position[some], missing[some], waves, floating_mean=True)
    return tuple(float(travel / c) for c in cycles[_outstanding(power, first=0)])


def _outstanding(power, first) -> np.ndarray:
    """Return the highest local maxima: half of them as they are, half above their background."""
    peaks = argrelmax(power[first:], mode="clip")[0] + first
    if not peaks.size:
        return np.array([int(np.argmax(power))])
    above = power / np.maximum(median_filter(power, BACKGROUND), np.finfo(float).tiny)
    highest = [peaks[np.argsort(-height[peaks])[: LINES // 2]] for height in (power, above)]
    return np.array(list(dict.fromkeys(np.concatenate(highest).tolist())))
