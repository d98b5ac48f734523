r"""Periodic components of a missing rate: tones in time, ripples over position.

A fit of a wave has a local minimum at every frequency, so it must start near the right one. The
missing part of the rate of a velocity, :math:`\dot v - f(x, u, p)`, is taken from the estimated
states; the part that re-tuned parameters could explain is projected out, and the peaks in the
spectrum of the rest are the starting values. That rate is not available if a sensor is noisy or a
state has no sensor, so peaks are also searched in the residuals of the re-tuned model.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import sympy
from scipy.ndimage import median_filter
from scipy.signal import argrelmax, lombscargle

from sklearn_pgnn.estimation.budgets import BACKGROUND, CYCLE_STEP, LINES, ROUNDING, SAMPLES
from sklearn_pgnn.physics.effects.rates import is_moving
from sklearn_pgnn.physics.effects.springs import MOST_CYCLES
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.simulation.added_response import AddedResponse, Addition, Gains, gains_at
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows


def missing_rate(
    model: PhysicsModel, windows: ShootingWindows, x: np.ndarray, flow: sympy.Expr
) -> np.ndarray:
    """Return the missing rate of a flow, less the part that the parameters could explain."""
    slopes = {state: flow.diff(symbol(state)) for state in model.states}
    rate = sympy.Add(*(slope * model.equations[state] for state, slope in slopes.items()))
    size = windows.t.size
    table = sample_table(model, windows, x)
    explained = [sympy.Integer(1), *(sympy.diff(rate, symbol(n)) for n in model.free_parameters)]
    columns = np.column_stack([evaluate_samples(e, table, size) for e in explained])
    measured = slopes_by_record(windows, evaluate_samples(flow, table, size))
    missing = measured - evaluate_samples(rate, table, size)
    known = np.isfinite(columns).all(axis=1) & np.isfinite(missing)
    columns, missing = np.where(known[:, None], columns, 0.0), np.where(known, missing, 0.0)
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    return missing - columns / scale @ np.linalg.lstsq(columns / scale, missing, rcond=ROUNDING)[0]


def slopes_by_record(windows: ShootingWindows, values: np.ndarray) -> np.ndarray:
    """Return the slope of a signal at every sample, by differences within its record."""
    slopes = [np.gradient(values[a:b], windows.t[a:b]) for a, b in pairwise(windows.bounds)]
    return np.concatenate(slopes)


def find_lines(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray) -> tuple[dict, dict]:
    """Find the tones and the ripples in the missing rates of the velocities at a model's ports."""
    tones, ripples = {}, {}
    for name, port in _moving_ports(model).items():
        missing = missing_rate(model, windows, x, port.flow)
        tones[name] = _tones(windows, missing)
        if port.displacement is not None:
            ripples[name] = _ripples(_path(model, windows, x, port), missing)
    return tones, ripples


def _moving_ports(model: PhysicsModel) -> dict[str, Port]:
    return {name: port for name, port in model.ports.items() if is_moving(model, port)}


def _path(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray, port: Port) -> np.ndarray:
    """Return the displacement at a port at every sample."""
    table = sample_table(model, windows, x)
    return evaluate_samples(sympy.sympify(port.displacement), table, windows.t.size)


def tones_left(windows: ShootingWindows, residual: np.ndarray) -> tuple[float, ...]:
    """Find the tones in the residuals of a fitted model."""
    return tuple(t for column in np.nan_to_num(residual).T for t in _tones(windows, column))


def ripples_left(
    windows: ShootingWindows, fit: WindowFit, x: np.ndarray, which: np.ndarray
) -> dict[str, tuple[float, ...]]:
    r"""Find the ripples that would explain most of the residuals of a fitted model.

    A force :math:`a \cos(2 \pi x/P) + b \sin(2 \pi x/P)` changes the outputs linearly; with the
    initial state of every window free, it explains as much as a regression on its two responses.
    """
    some, x0, found = windows.select(which), fit.evaluation.x0[which], {}
    some = replace(some, y=fit.evaluation.residual)
    response = AddedResponse(fit.model, some, x0)
    if not response.is_finite:
        return {}
    for name, port in _moving_ports(fit.model).items():
        if port.displacement is not None:
            path = _path(fit.model, windows, x, port)
            found[name] = _ripples_left(response, gains_at(response, name), path)
    return found


def _ripples_left(response: AddedResponse, gains: Gains, position: np.ndarray) -> tuple[float, ...]:
    travel, y = np.ptp(position), response.windows.y
    if not travel > 0:
        return ()
    cycles = np.arange(1.0, MOST_CYCLES, CYCLE_STEP)
    parts = -(-y.size // SAMPLES)  # of the waves, to limit the memory for their responses
    residual = response.without_states(y[..., None]).reshape(-1, 1)
    explained = [
        _explained(response, residual, gains, 2 * np.pi * position * some[:, None] / travel)
        for some in np.array_split(cycles, parts)
    ]
    power = np.concatenate(explained)
    peaks = argrelmax(power, mode="clip")[0]
    highest = peaks[np.argsort(-power[peaks])[: LINES // 2]]
    return tuple(float(travel / c) for c in cycles[highest])


def _explained(
    response: AddedResponse, r: np.ndarray, gains: Gains, phase: np.ndarray
) -> np.ndarray:
    """Return the squares of residuals that waves at a place explain, by their phases."""
    every = (*np.cos(phase), *np.sin(phase))
    waves = [Addition(tuple((i, gain * wave) for i, gain in gains)) for wave in every]
    c, s = np.split(response.to(waves).reshape(r.size, -1), 2, axis=1)
    pairs = (c, c), (s, s), (c, s), (c, r), (s, r)
    cc, ss, cs, cr, sr = ((one * other).sum(axis=0) for one, other in pairs)
    common = cc * ss - cs**2
    explained = (ss * cr**2 - 2 * cs * cr * sr + cc * sr**2) / np.where(common > 0, common, np.inf)
    return np.nan_to_num(explained)


def _tones(windows: ShootingWindows, signal: np.ndarray) -> tuple[float, ...]:
    """Return the frequencies of peaks in the sum of the records' spectra."""
    step = float(np.median(np.diff(windows.t)[np.diff(windows.t) > 0]))
    spans = list(pairwise(windows.bounds))
    size = 2 * max(b - a for a, b in spans)
    power = np.zeros(size // 2 + 1)
    for a, b in spans:
        clock = np.arange(windows.t[a], windows.t[b - 1], step)
        even = np.interp(clock, windows.t[a:b], signal[a:b])[:size]
        power += np.abs(np.fft.rfft(even * np.hanning(even.size), size)) ** 2
    frequency = np.fft.rfftfreq(size, step)
    best = _outstanding(power, first=2)
    return tuple(float(f) for f in frequency[best])


def _ripples(position: np.ndarray, missing: np.ndarray) -> tuple[float, ...]:
    """Return the periods of peaks over position."""
    travel = np.ptp(position)
    if not travel > 0:
        return ()
    some = slice(None, None, max(1, position.size // SAMPLES))
    cycles = np.arange(1.0, MOST_CYCLES, CYCLE_STEP)
    waves = 2 * np.pi * cycles / travel
    power = lombscargle(position[some], missing[some], waves, floating_mean=True)
    return tuple(float(travel / c) for c in cycles[_outstanding(power, first=0)])


def _outstanding(power: np.ndarray, first: int) -> np.ndarray:
    """Return the highest local maxima: half of them as they are, half above their background."""
    peaks = argrelmax(power[first:], mode="clip")[0] + first
    if not peaks.size:
        return np.array([int(np.argmax(power))])
    above = power / np.maximum(median_filter(power, BACKGROUND), np.finfo(float).tiny)
    highest = [peaks[np.argsort(-height[peaks])[: LINES // 2]] for height in (power, above)]
    return np.array(list(dict.fromkeys(np.concatenate(highest).tolist())))
