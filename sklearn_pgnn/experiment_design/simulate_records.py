"""Simulated records of a fitted machine with one more effect, for testing the diagnosis itself."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd

from sklearn_pgnn.experiment_design.detectability import Detectable
from sklearn_pgnn.experiment_design.power import PowerAnalysis
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY


def inject(analysis: PowerAnalysis, effect: Effect | None, random_state=0):
    """Simulate the records of a diagnosis with an effect added to the machine.

    Return X with trajectory, time, inputs, and the initial states where they were known, and y with
    noise: like the residuals of the extended model, with random phases.

    References
    ----------
    .. [1] J. Theiler et al., "Testing for nonlinearity in time series: the method of surrogate
       data", Physica D 58, 1992, :doi:`10.1016/0167-2789(92)90102-S`.
    """
    rng, windows = np.random.default_rng(random_state), analysis.windows
    model = analysis.model if effect is None else effect.apply(analysis.model)
    x0, record = analysis.start(model), windows.record
    tables, outputs = [], []
    for r, (a, b) in enumerate(pairwise(windows.bounds)):
        start = x0[np.flatnonzero(record == r)[0]]
        y = free_run(model, windows, a, b, start).check().y
        rest = analysis.records.fits["extended"].residual[a:b]
        outputs.append(y + _alike(rest, analysis.white, rng))
        tables.append(_table(analysis, r, windows.t[a:b], windows.u[a:b], start))
    y = pd.DataFrame(np.concatenate(outputs), columns=list(model.outputs))
    return pd.concat(tables, ignore_index=True), y.where(np.isfinite(windows.y))


def _table(analysis, r, t, u, start) -> pd.DataFrame:
    model = analysis.records.problem.prior
    table = pd.DataFrame(u, columns=list(model.inputs))
    table.insert(0, TIME, t)
    table.insert(0, TRAJECTORY, analysis.records.names[r])
    told = analysis.records.problem.states.told[r]
    for i, name in enumerate(model.states):
        table[name] = np.nan
        if name in told:
            table.loc[0, name] = start[i]
    return table


def _alike(rest, white, rng) -> np.ndarray:
    """Draw noise with the power of a residual and, unless white, its spectrum."""
    rest = np.nan_to_num(rest)
    noise = rng.standard_normal(rest.shape)
    if white:
        return noise * np.sqrt(np.mean(rest**2, axis=0))
    phases = np.exp(1j * np.angle(np.fft.rfft(noise, axis=0)))
    return np.fft.irfft(np.abs(np.fft.rfft(rest, axis=0)) * phases, n=len(rest), axis=0)


def with_verdict(
    analysis: PowerAnalysis,
    row: Detectable,
    diagnose: Callable[[pd.DataFrame, pd.DataFrame], Iterable[Collection[tuple[str, str]]]],
) -> Detectable:
    """Run the diagnosis itself on records with an effect at its smallest size."""
    if row.at_smallest is None:
        return row
    groups = diagnose(*inject(analysis, row.at_smallest, analysis.seed))
    return replace(row, found=any((row.effect, row.target) in group for group in groups))
