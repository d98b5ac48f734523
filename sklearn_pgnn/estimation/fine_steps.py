"""Integration steps fine enough that no parameter depends on them."""

from sklearn_pgnn.estimation.budgets import SMALL_CHANGE
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import EstimationProblem, with_substeps
from sklearn_pgnn.estimation.window_fitter import WindowFitter
from sklearn_pgnn.simulation.substeps import MAX_SUBSTEPS
from sklearn_pgnn.simulation.uncertainty import standard_errors


def fine_substeps(fitter: WindowFitter, trial: FittedHypothesis) -> int:
    """Return the substeps at which doubling changes no parameter by a tenth of its error.

    The steps of a search change the outputs by a small part of the noise. Many samples determine a
    parameter more accurately than that, and a step over dry friction or a limit has a larger error
    than one over the smooth prior.

    Parameters
    ----------
    fitter : WindowFitter
        The fitter of the hypothesis.
    trial : FittedHypothesis
        The hypothesis, at its minimum.

    Returns
    -------
    int
        Integration steps from sample to sample, at most `MAX_SUBSTEPS`.
    """
    problem = fitter.problem
    substeps = problem.windows.substeps
    while 2 * substeps <= MAX_SUBSTEPS:
        finer = HypothesisFitter(with_substeps(problem, 2 * substeps), fitter.progress)
        moved = finer.refit_two_steps(trial)
        if not moved.fit.usable or _moves_little(problem, trial, moved):
            break
        trial, substeps = moved, 2 * substeps
    return substeps


def _moves_little(
    problem: EstimationProblem, before: FittedHypothesis, after: FittedHypothesis
) -> bool:
    """Return whether no parameter has moved by a tenth of its standard error."""
    expected = problem.states.expected_starts(before.fit.model, problem.windows)
    errors = standard_errors(before.fit, *expected)
    old, new = before.fit.model.parameters, after.fit.model.parameters
    known = ((name, error) for name, error in errors.items() if error > 0.0)
    shares = (abs(new[name].value - old[name].value) / error for name, error in known)
    return bool(max(shares, default=0.0) <= SMALL_CHANGE)
