r"""Window length: the longest over which the re-tuned prior tracks the records.

How long an unstable model can be simulated before its error says nothing any more.

An error at the start of a window grows by :math:`e^{T / \tau}` over its length :math:`T`, with the
time constant :math:`\tau` of the instability. An initial state is known as well as the noise
allows. From

.. math:: T = \tau \log(\text{variation of the output} / \text{its noise})

on, the error is as large as the output itself, and a fit has as many local minima as there are
smaller changes that would undo it.
"""

from collections.abc import Sequence
from math import sqrt

import numpy as np

from sklearn_pgnn.estimation.budgets import FOLLOWED, FORGOTTEN, SAMPLES, SHORTEST
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import (
    EstimationProblem,
    longer,
    recut,
    shorter,
    with_few_samples,
)
from sklearn_pgnn.estimation.progress import Progress
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.source import differentiate


def select_windows(
    problem: EstimationProblem, progress: Progress | None = None
) -> HypothesisFitter:
    """Make windows as long as the re-tuned prior can track, and as hidden states need to decay.

    Windows are halved, or doubled, while the error per sample in them is small, or grows with their
    length no faster than that of a model with a random disturbance. Windows in which an unstable
    prior runs away from the records tell nothing: they are halved on, down to a few samples.
    """
    fitter = HypothesisFitter(problem, progress)
    while fitter.base().times_noise > FOLLOWED and (cut := shorter(fitter.problem)) is not None:
        nearer = HypothesisFitter(cut, progress)
        if not _is_lost(nearer, fitter):
            break
        fitter = nearer
    fitter = _before_it_runs_away(fitter)
    while (joined := longer(fitter.problem)) is not None:
        further = HypothesisFitter(joined, progress)
        if _is_lost(fitter, further) or _is_beyond_foresight(further):
            break
        fitter = further
    return _past_hidden_starts(fitter)


def _before_it_runs_away(fitter: HypothesisFitter) -> HypothesisFitter:
    """Return windows so short that the re-tuned prior tells something.

    The error of an unstable prior grows by a constant factor per time constant of the instability,
    and windows of a usual number of samples may hold many of these. In short windows it must
    predict some output better than is possible without a model. Where it does so in none, they are
    as long as its foresight and as it remains finite: a cause may be what it lacks. Where none are
    so short, the shortest are nearest to that, unless it foresees nothing even there. A prior that
    does not even remain finite gets windows in which nothing is seen but that it does.
    """
    tried = [fitter]
    while not _tells(tried[-1]):
        problem, least = tried[-1].problem, SHORTEST if tried[-1].base().fit.usable else 0.0
        cut = shorter(problem) or shorter(with_few_samples(problem), least)
        if cut is None:
            last = tried[-1]
            foresees = _leaves_less_than(last, last.problem.squares_about_mean)
            otherwise = last if foresees else fitter
            finite = (each for each in tried if each.base().fit.usable)
            return next((each for each in finite if not _is_beyond_foresight(each)), otherwise)
        tried.append(HypothesisFitter(cut, fitter.progress))
    return tried[-1]


def _is_lost(shorter_windows: HypothesisFitter, longer_windows: HypothesisFitter) -> bool:
    r"""Return whether the error grows faster with the windows than under a random disturbance.

    In windows of twice the length the error of a random walk is :math:`\sqrt{2}` times as large.
    A prior that does not remain finite in the longer ones is lost there.
    """
    further = longer_windows.base()
    near = sqrt(2.0) * shorter_windows.base().times_noise
    return not further.fit.usable or further.times_noise > near


def _past_hidden_starts(fitter: HypothesisFitter) -> HypothesisFitter:
    """Return windows in which hidden states decay, if the records are long enough.

    The initial value of an unmeasured state is fitted in every window. If the state is slow, this
    value compensates for errors in its equation. Windows in which an unstable prior diverges from
    the records, farther than their mean is, give no information on it.
    """
    length = FORGOTTEN * _slowest(fitter)
    while length > fitter.problem.scales.window:
        further = recut(fitter.problem, length)
        if further is None or further.scales.window <= fitter.problem.scales.window:
            break
        joined = HypothesisFitter(further, fitter.progress)
        if _tells(joined):
            return joined
        length /= 2
    return fitter


def _tells(fitter: HypothesisFitter) -> bool:
    """Return whether the re-tuned prior says something about some output over windows.

    It does if it predicts it better than its mean does, in windows of fewer samples than usual
    better than is possible without a model, and if windows do not exceed an unstable prior's
    foresight.
    """
    says = _leaves_less_than(fitter, fitter.problem.squares_of_no_use)
    return says and not _is_beyond_foresight(fitter)


def _is_beyond_foresight(fitter: HypothesisFitter) -> bool:
    """Return whether noise at the start of a window grows to the size of the outputs in it."""
    problem = fitter.problem
    return problem.scales.window > horizon(problem, fitter.base().fit.model)


def _leaves_less_than(fitter: HypothesisFitter, squares: np.ndarray) -> bool:
    """Return whether the re-tuned prior leaves less than some squares of any output."""
    fit = fitter.base().fit
    return fit.usable and bool((fitter.squares_by_output(fitter.base()) < squares).any())


def _slowest(fitter: HypothesisFitter) -> float:
    """Return the longest time constant of the hidden states of the re-tuned prior [s]."""
    model, states = fitter.base().fit.model, fitter.problem.states
    windows, x = fitter.problem.windows, states.estimate(model).x
    table = sample_table(model, windows, x)
    slopes = [differentiate(model.equations[s], symbol(s)) for s in states.hidden(model)]
    decays = [-np.median(evaluate_samples(slope, table, len(x))) for slope in slopes]
    return max((1.0 / decay for decay in decays if decay > 0), default=0.0)


def check_prior(fitter: HypothesisFitter, names: Sequence[str]) -> None:
    """Raise `RecordError` if the prior cannot be simulated, whatever its parameters."""
    fit, windows = fitter.base().fit, fitter.problem.windows
    lost = np.flatnonzero(~np.isfinite(fit.evaluation.squares))
    if not lost.size:
        return
    first, states = lost[0], list(fit.model.states)
    start = zip(states, fit.x0[first], strict=True)
    raise RecordError(
        f"expected a model that can be simulated on the records, but {fit.model.name!r} becomes "
        f"non-finite in {lost.size} of {len(windows)} windows, first in trajectory "
        f"{names[windows.record[first]]!r} from t = {windows.t[windows.starts[first]]:g} s with "
        f"{', '.join(f'{name} = {value:.3g}' for name, value in start)}. Remedy: say where the "
        f"trajectories start (columns {', '.join(states)} of X), raise substeps (now "
        f"{windows.substeps}), or check the parameters and that no root, logarithm or quotient "
        f"is evaluated outside its domain."
    )


def horizon(problem: EstimationProblem, model: PhysicsModel) -> float:
    """Return the time after which noise at the start has grown to the size of the outputs [s]."""
    rate = growth_rate(problem, model)
    louder = float(np.max(problem.typical_outputs / problem.windows.scale))
    return np.log(max(louder, 1.0)) / rate if rate > 0 else np.inf


def growth_rate(problem: EstimationProblem, model: PhysicsModel) -> float:
    """Return the rate at which errors grow along the records [1/s], the median over samples.

    It is the largest real part of an eigenvalue of the equations, linearised; negative where
    errors decay.
    """
    if model.opaque_functions:
        return -np.inf
    slopes = _linearised(problem, model)
    slopes = slopes[np.isfinite(slopes).all(axis=(1, 2))]
    if not slopes.size:
        return -np.inf
    return float(np.median(np.linalg.eigvals(slopes).real.max(axis=1)))


def _linearised(problem: EstimationProblem, model: PhysicsModel) -> np.ndarray:
    """Return the derivatives of the rates by the states, of shape (n, n_states, n_states)."""
    x, states = problem.states.estimate(model).x, list(model.states)
    every = slice(None, None, max(1, len(x) // SAMPLES))
    table = sample_table(model, problem.windows, x)
    table = {name: value[every] if np.ndim(value) else value for name, value in table.items()}
    size = len(x[every])
    return np.stack(
        [
            [evaluate_samples(differentiate(rate, symbol(s)), table, size) for s in states]
            for rate in model.equations.values()
        ]
    ).transpose(2, 0, 1)
