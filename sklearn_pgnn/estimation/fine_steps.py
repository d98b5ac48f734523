"""Integration steps fine enough that no parameter depends on them."""

from sklearn_pgnn.estimation.budgets import SMALL_CHANGE
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import EstimationProblem, with_substeps
from sklearn_pgnn.estimation.window_fitter import WindowFitter
from sklearn_pgnn.simulation.record_windows import speed_in_windows
from sklearn_pgnn.simulation.substeps import IMPLICIT, MAX_SUBSTEPS, Steps
from sklearn_pgnn.simulation.uncertainty import standard_errors


def fine_steps(fitter: WindowFitter, trial: FittedHypothesis, *, is_told: bool = False) -> Steps:
    """Return the steps at which doubling changes no parameter by a tenth of its error.

    The steps of a search change the outputs by a small part of the noise. Many samples determine a
    parameter more accurately than that, and a step over dry friction or a limit has a larger error
    than one over the smooth prior. A minimum at the limit of stability of explicit steps is none:
    implicit ones move it. Told steps are not doubled.
    """
    problem = fitter.problem
    fast = speed_in_windows(trial.fit.model, problem.windows, trial.fit.evaluation)
    steps = problem.windows.steps
    others = [] if steps.are_stable(fast) else [Steps(IMPLICIT, steps.substeps)]
    while others or (not is_told and 2 * steps.substeps <= MAX_SUBSTEPS):
        other = others.pop() if others else Steps(steps.method, 2 * steps.substeps)
        stepped = with_substeps(problem, other.substeps, other.method)
        moved = HypothesisFitter(stepped, fitter.progress).refit_two_steps(trial)
        if not moved.fit.usable or _moves_little(problem, trial, moved):
            break
        trial, steps = moved, other
    return steps


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
