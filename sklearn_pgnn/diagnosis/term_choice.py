"""Select the terms of a library that describe a missing part, by their effect on the outputs."""

import numpy as np

from sklearn_pgnn.estimation.budgets import MOST_TERMS, OWN, RESOLUTION
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.likely_places import windows_looked_at
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.screening import small_step
from sklearn_pgnn.simulation.linear_response import linear_responses, without_states
from sklearn_pgnn.simulation.windows import evaluate

#: share of a column's power below which its remainder after earlier terms counts as rounding error
EPSILON = np.finfo(float).eps


def leading_terms(columns: np.ndarray, target: np.ndarray, count: int) -> list[np.ndarray]:
    r"""Fit a quantity with one, two, and more of the columns of a library.

    The columns are selected by forward regression with orthogonal least squares,
    :math:`\min_\xi |d - \Theta\xi|^2` with :math:`|\xi|_0 = 1, 2, \dots`: the next column is the
    one that, together with those selected before, lowers the squares most. (Orthogonal matching
    pursuit selects the column most correlated with the residual, and is misled by columns that are
    nearly collinear.)

    .. [1] S. Chen, S. A. Billings, W. Luo, "Orthogonal least squares methods and their application
       to non-linear system identification", International Journal of Control 50(5), 1989,
       :doi:`10.1080/00207178908953472`.
    """
    own = columns / np.linalg.norm(columns, axis=0)
    moved = np.empty_like(own)
    taken: list[int] = []
    found: list[np.ndarray] = []
    while len(taken) < count:
        power = np.einsum("ki,ki->i", own, own)
        is_free = power > EPSILON
        if not is_free.any():
            break
        none = np.full_like(power, -np.inf)
        falls = np.divide((target @ own) ** 2, power, out=none, where=is_free)
        taken.append(int(np.argmax(falls)))
        direction = own[:, taken[-1]] / np.sqrt(power[taken[-1]])
        own -= np.outer(direction, direction @ own, out=moved)
        found.append(np.zeros(columns.shape[1]))
        found[-1][taken] = np.linalg.lstsq(columns[:, taken], target, rcond=None)[0]
    return found


#: terms whose responses are found at a time. More take more memory
BLOCK = 128
#: rows a column by which columns are told apart. More are safer beside noise, and there is none
ROWS = 4


def telling_terms(
    problem: EstimationProblem, base: FittedHypothesis, channel: str, columns: np.ndarray
) -> list[np.ndarray]:
    """Select terms by their effect on the outputs, with the effect of re-tuning projected out."""
    fit = base.fit
    some = windows_looked_at(problem.windows, fit.evaluation.squares, len(fit.model.states))
    windows, x0 = problem.windows.select(some), fit.evaluation.x0[some]
    tuned = [_slope_by(problem, base, place) for place in range(len(fit.freedoms))]
    table = np.stack([fit.evaluation.residual, *tuned], axis=-1)
    basis, target = np.empty((0, 0)), np.empty(0)
    found: list[np.ndarray] = []
    before: list[np.ndarray] = []
    for block in np.array_split(columns, -(-columns.shape[1] // BLOCK), axis=1):
        responses, by_state = linear_responses(fit.model, windows, x0, channel, block)
        if not found:
            target, known = np.split(without_states(windows, table, by_state), [1], axis=1)
            basis = np.linalg.qr(known / np.maximum(np.linalg.norm(known, axis=0), 1e-300))[0]
            target = target - basis @ (basis.T @ target)
        part = without_states(windows, responses, by_state)
        before.append(np.linalg.norm(part, axis=0))
        part -= basis @ (basis.T @ part)
        found.append(part)
    moved = np.hstack(found)
    seen = np.flatnonzero(np.linalg.norm(moved, axis=0) > OWN * np.concatenate(before))
    path = leading_terms(moved[:, seen], target[:, 0], MOST_TERMS)
    full = np.zeros((len(path), columns.shape[1]))
    full[:, seen] = path
    return list(full)


def _slope_by(problem: EstimationProblem, base: FittedHypothesis, place: int) -> np.ndarray:
    """Return the derivative of the outputs by a parameter, from a small step."""
    fit, freedom = base.fit, base.fit.freedoms[place]
    value = fit.model.parameters[freedom.name].value
    moved = freedom.beside(value, small_step(problem.windows, fit, place))
    model = fit.model.with_parameters(**{freedom.name: moved})
    change = fit.evaluation.residual - evaluate(model, problem.windows, fit.x0, ()).residual
    return change / (moved - value)


def independent(columns: np.ndarray) -> list[int]:
    """Return the columns that are not linear combinations of those before them.

    >>> independent(np.array([[1.0, 2.0, 1.0], [0.0, 0.0, 1.0]]))
    [0, 2]
    """
    own: list[int] = []
    columns = columns[:: max(1, len(columns) // (ROWS * columns.shape[1]))]
    directions = np.empty((columns.shape[1], len(columns)))  # a row each
    for i, column in enumerate(columns.T):
        size, basis = np.linalg.norm(column), directions[: len(own)]
        rest = column - (basis @ column) @ basis
        rest = rest - (basis @ rest) @ basis
        if np.isfinite(size) and np.linalg.norm(rest) > RESOLUTION * size:
            directions[len(own)] = rest / np.linalg.norm(rest)
            own.append(i)
    return own
