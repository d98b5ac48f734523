"""Select the terms of a library that describe a missing part, by their effect on the outputs."""

import numpy as np

from sklearn_pgnn.diagnosis.leading_terms import leading_terms
from sklearn_pgnn.estimation.budgets import MOST_TERMS, OWN, RESOLUTION
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.small_step import small_step
from sklearn_pgnn.simulation.linear_response import linear_responses, without_states
from sklearn_pgnn.simulation.windows import evaluate


def telling_terms(
    problem: EstimationProblem, base: FittedHypothesis, channel: str, columns: np.ndarray
) -> list[np.ndarray]:
    """Select terms by their effect on the outputs, with the effect of re-tuning projected out."""
    windows, fit = problem.windows, base.fit
    responses, by_state = linear_responses(fit.model, windows, fit.evaluation.x0, channel, columns)
    tuned = [_slope_by(problem, base, place) for place in range(len(fit.freedoms))]
    block = np.concatenate([responses, np.stack(tuned, axis=-1)] if tuned else [responses], axis=-1)
    table = np.concatenate([fit.evaluation.residual[..., None], block], axis=-1)
    table = without_states(windows, table, by_state)
    target, moved, known = np.split(table, [1, 1 + columns.shape[1]], axis=1)
    basis = np.linalg.qr(known / np.maximum(np.linalg.norm(known, axis=0), 1e-300))[0]
    before = np.linalg.norm(moved, axis=0)
    moved, target = (part - basis @ (basis.T @ part) for part in (moved, target))
    seen = np.flatnonzero(np.linalg.norm(moved, axis=0) > OWN * before)
    path = leading_terms(moved[:, seen], target[:, 0], MOST_TERMS)
    full = np.zeros((len(path), columns.shape[1]))
    full[:, seen] = path
    return list(full)


def _slope_by(problem, base, place) -> np.ndarray:
    """Return the derivative of the outputs by a parameter, from a small step."""
    fit, freedom = base.fit, base.fit.freedoms[place]
    value = fit.model.parameters[freedom.name].value
    moved = freedom.beside(value, small_step(problem.windows, fit, place))
    model = fit.model.with_parameters(**{freedom.name: moved})
    change = fit.evaluation.residual - evaluate(model, problem.windows, fit.x0, ()).residual
    return change / (moved - value)


def independent(columns: np.ndarray) -> list[int]:
    """Return the columns that are not linear combinations of those before them.

    Examples
    --------
    >>> independent(np.array([[1.0, 2.0, 1.0], [0.0, 0.0, 1.0]]))
    [0, 2]
    """
    own: list[int] = []
    basis = np.empty((len(columns), 0))
    for i, column in enumerate(columns.T):
        size = np.linalg.norm(column)
        rest = column - basis @ (basis.T @ column)
        rest = rest - basis @ (basis.T @ rest)
        if np.isfinite(size) and np.linalg.norm(rest) > RESOLUTION * size:
            own.append(i)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return own
