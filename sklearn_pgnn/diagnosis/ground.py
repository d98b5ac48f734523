"""The ground that records ask for: how long windows are, and how inputs run between samples."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sklearn_pgnn.diagnosis.judge import is_fall
from sklearn_pgnn.estimation.fitting import HypothesisFitter, Trial, block_squares
from sklearn_pgnn.estimation.problem import ROUGH_SAMPLES, EstimationProblem, longer, recut, shorter
from sklearn_pgnn.estimation.progress import Progress
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.window_fit import fit_windows

#: windows are as long as the re-tuned prior can follow: its error, in units of the noise, at which
#: they are halved, and below which they are doubled
TOO_LARGE, SMALL = 30.0, 3.0
#: shorter windows must lower the error to this share of it; longer ones may raise it so many times
HELPS, HARDLY_HARDER = 0.75, 1.15
#: time constants in which a state forgets where it started; windows that are so many times as long
#: are worth another look
FORGOTTEN, LONGER = 5.0, 1.5
#: inputs that run straight between samples must lower a fit's squares to this share, and its errors
#: by so many of their standard errors
NEARER, SURE = 0.95, 3.0
#: steps in which a fit gets used to it
STEPS = 8


def fit_window_length(
    problem: EstimationProblem, progress: Progress | None = None
) -> HypothesisFitter:
    """Make windows as long as the re-tuned prior can follow, and as it forgets its start.

    Parameters
    ----------
    problem : EstimationProblem
        The ground with windows of the usual length.
    progress : Progress, optional
        Told of every step of a fit.

    Returns
    -------
    HypothesisFitter
        The fitter, on windows of the length that the records ask for.
    """
    fitter = HypothesisFitter(problem, progress)
    while fitter.base_error() > TOO_LARGE and (cut := shorter(fitter.problem)) is not None:
        nearer = HypothesisFitter(cut, progress)
        if nearer.base_error() > HELPS * fitter.base_error():
            break
        fitter = nearer
    while (joined := longer(fitter.problem)) is not None:
        further = HypothesisFitter(joined, progress)
        if not (_follows(fitter, further) or _forgets(fitter, further)):
            break
        fitter = further
    return fitter


def _follows(fitter: HypothesisFitter, further: HypothesisFitter) -> bool:
    """Tell whether the re-tuned prior is near the records, and stays so in longer windows."""
    return fitter.base_error() < SMALL and further.base_error() <= TOO_LARGE


def _forgets(fitter: HypothesisFitter, further: HypothesisFitter) -> bool:
    """Return whether longer windows are hardly harder."""
    return further.base_error() < HARDLY_HARDER * fitter.base_error()


def look_further(fitter: HypothesisFitter) -> HypothesisFitter | None:
    """Make windows so long that they forget where their hidden states start.

    The initial value of a state that nobody sees is fitted in every window. Where the state is
    slow, that takes up what is wrong with it.

    Parameters
    ----------
    fitter : HypothesisFitter
        The fitter, on windows of the usual length.

    Returns
    -------
    HypothesisFitter or None
        The fitter on longer windows; None where the usual ones, or the records, are as long.
    """
    problem = fitter.problem
    length, least = FORGOTTEN * _slowest(fitter), LONGER * problem.scales.window
    further = recut(problem, length) if length >= least else None
    return (
        None
        if further is None or further.scales.window < least
        else HypothesisFitter(further, fitter.progress)
    )


def _slowest(fitter: HypothesisFitter) -> float:
    """Give the longest time constant of the hidden states of the re-tuned prior [s]."""
    model, states = fitter.base().fit.model, fitter.problem.states
    windows, x = fitter.problem.windows, states.estimate(model).x
    table = sample_table(model, windows, x)
    slopes = [model.equations[s].diff(symbol(s)) for s in states.hidden(model)]
    decays = [-np.median(evaluate_samples(slope, table, len(x))) for slope in slopes]
    return max((1.0 / decay for decay in decays if decay > 0), default=0.0)


def check_prior(fitter: HypothesisFitter, names: Sequence[str]) -> None:
    """Raise `RecordError` where the prior cannot be simulated, whatever its parameters.

    Parameters
    ----------
    fitter : HypothesisFitter
        The fitter.
    names : sequence of str
        What the records are called.
    """
    fit, windows = fitter.base().fit, fitter.problem.windows
    lost = np.flatnonzero(~np.isfinite(fit.evaluation.squares))
    if not lost.size:
        return
    first, states = lost[0], list(fit.model.states)
    start = zip(states, fit.x0[first], strict=True)
    raise RecordError(
        f"expected a model that can be simulated on the records, but {fit.model.name!r} leaves the "
        f"finite numbers in {lost.size} of {len(windows)} windows, first in trajectory "
        f"{names[windows.record[first]]!r} from t = {windows.t[windows.starts[first]]:g} s with "
        f"{', '.join(f'{name} = {value:.3g}' for name, value in start)}. Remedy: say where the "
        f"trajectories start (columns {', '.join(states)} of X), raise substeps (now "
        f"{windows.substeps}), or check the parameters and that no root, logarithm or quotient "
        f"meets a value that it is not made for."
    )


def speaks_for_slopes(fitter: HypothesisFitter, trial: Trial) -> bool:
    """Tell whether the records say that inputs are not held, but run straight between samples.

    Parameters
    ----------
    fitter : HypothesisFitter
        The fitter, on whose windows inputs are held.
    trial : Trial
        A hypothesis, fitted on these windows.

    Returns
    -------
    bool
        Whether the hypothesis is clearly nearer to the records with inputs that are not held.
    """
    problem, windows = fitter.problem, fitter.problem.windows
    some = np.arange(0, len(windows), -(-windows.lengths.sum() // ROUGH_SAMPLES))
    straight = replace(windows, hold="foh")
    held, sloped = (
        _squares(fitter, replace(problem, windows=w), trial, some) for w in (windows, straight)
    )
    return sloped.sum() < NEARER * held.sum() and is_fall(held, sloped, SURE)


def _squares(
    fitter: HypothesisFitter, problem: EstimationProblem, trial: Trial, some: np.ndarray
) -> np.ndarray:
    """Fit a hypothesis to some windows, from where it is, and give the squares of their pieces."""
    start = problem.states.estimate(trial.fit.model)
    fit = fit_windows(
        trial.fit.model,
        problem.windows.select(some),
        trial.fit.freedoms,
        start.x[problem.windows.starts[some]],
        start.spread,
        x0_start=trial.fit.x0[some],
        max_steps=STEPS,
        each_step=fitter.progress.tick,
    )
    return block_squares(problem, fit, some).sum(axis=-1)
