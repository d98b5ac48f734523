"""Simulated records of a fitted machine with one effect more, to try the diagnosis itself on."""

from dataclasses import replace

import numpy as np
import pandas as pd
from sklearn.base import clone

from sklearn_pgnn.diagnosis.detectability import SMALLEST, Detectable, PowerAnalysis
from sklearn_pgnn.diagnosis.effect_size import main_field, sized
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY


def inject(analysis: PowerAnalysis, effect: Effect | None, random_state=0):
    """Simulate the records of a diagnosis with an effect in the machine.

    Parameters
    ----------
    analysis : PowerAnalysis
        The fitted model on the records.
    effect : Effect or None
        What is put in.
    random_state : int, default=0
        Draws the noise: like what the extended model leaves, with random phases.

    Returns
    -------
    X : DataFrame
        Trajectory, time, inputs, and the initial states where they were known.
    y : DataFrame
        Outputs with noise.

    References
    ----------
    .. [1] J. Theiler et al., "Testing for nonlinearity in time series: the method of surrogate
       data", Physica D 58, 1992, :doi:`10.1016/0167-2789(92)90102-S`.
    """
    rng, windows = np.random.default_rng(random_state), analysis.windows
    model = analysis.model if effect is None else effect.apply(analysis.model)
    x0, record = analysis.start(model), windows.record
    tables, outputs = [], []
    for r, (a, b) in enumerate(zip(windows.bounds[:-1], windows.bounds[1:], strict=True)):
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
    for i, (name, told) in enumerate(analysis.records.problem.states.starts[r].items()):
        table[name] = np.nan
        if np.isfinite(told):
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


def verified(diagnosis, analysis: PowerAnalysis, row: Detectable, catalogue) -> Detectable:
    """Run the diagnosis itself on records with an effect of its smallest size.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The fitted diagnosis.
    analysis : PowerAnalysis
        The fitted model on the records.
    row : Detectable
        The effect and its smallest size.
    catalogue : sequence of type[Effect]
        The effects to think of.

    Returns
    -------
    Detectable
        The row, saying whether the effect was named, alone or in a group that cannot be told
        apart.
    """
    if not np.isfinite(row.smallest):
        return row
    kind = next(effect for effect in catalogue if effect.id == row.effect)
    effect = of_main_size(analysis, kind, row.target, row.smallest)
    X, y = inject(analysis, effect, analysis.seed)
    prior = diagnosis.extended_model_
    again = clone(diagnosis).set_params(
        model=prior, catalogue=catalogue, time_column=None, progress=None
    )
    named = [
        {(cause.effect, cause.target), *((o.effect, o.target) for o in cause.confused_with)}
        for cause in again.fit(X, y).causes_
    ]
    return replace(row, found=any((row.effect, row.target) in names for names in named))


def of_main_size(analysis: PowerAnalysis, kind: type[Effect], target: str, value: float) -> Effect:
    """Give an effect whose main quantity has a value, its other quantities in step.

    Parameters
    ----------
    analysis : PowerAnalysis
        The fitted model on the records.
    kind : type of Effect
        The effect.
    target : str
        What it acts on.
    value : float
        Value of `main_field`.

    Returns
    -------
    Effect
        The effect.
    """
    of_size, field = (
        sized(kind, target, analysis.model, analysis.records.problem.scales),
        main_field(kind),
    )
    sizes = np.geomspace(SMALLEST, 1.0, 2001)
    values = np.array([getattr(of_size(size), field) for size in sizes])
    nearest = of_size(float(sizes[np.argmin(np.abs(values - value))]))
    rest = {f.name: getattr(nearest, f.name) for f in kind.quantities()}
    return kind(target, **{**rest, field: value})
