"""Normal equations: what is but rounding moves nothing, and is not seen."""

import numpy as np
import pytest

from sklearn_pgnn.simulation.normal_equations import follow, project

pytestmark = pytest.mark.core


def test_what_the_state_explains_but_for_rounding_is_not_seen():
    """Slopes of 1e10 times the noise: their products round to more than all that is known."""
    rng = np.random.default_rng(0)
    state, own, residual = rng.normal(size=(3, 200))
    hidden, seen = 1e10 * state, 1e10 * state + 1e5 * own
    columns = np.stack([hidden, seen, 1e10 * (1 + 1e-3 * rng.random()) * state, residual], axis=1)
    normal = project((columns.T @ columns)[None], 2, np.ones(1), np.zeros((1, 1)))
    assert normal.hessian[0, 0, 0] == normal.gradient[0, 0] == normal.hessian[0, 0, 1] == 0.0
    alone = own - state * (state @ own) / (state @ state)
    assert normal.hessian[0, 1, 1] == pytest.approx(1e10 * alone @ alone, rel=1e-3)


def test_eliminating_the_states_solves_the_whole_problem():
    """The step of parameters and states is the least-squares solution of all windows together."""
    rng = np.random.default_rng(0)
    n, n_p, n_x = 5, 3, 2
    tables = rng.normal(size=(n, 40, n_p + n_x + 1))
    weight, offset = np.array([0.5, 2.0]), rng.normal(size=(n, n_x))
    gram = np.swapaxes(tables, 1, 2) @ tables
    normal = project(gram, n_p, weight, offset)
    by_p = np.linalg.solve(normal.hessian.sum(axis=0), normal.gradient.sum(axis=0))
    by_x, decrease = follow(gram, normal, weight, offset, by_p)

    pulled = n * n_x
    whole, target = np.zeros((n * 40 + pulled, n_p + pulled)), np.zeros(n * 40 + pulled)
    for w in range(n):
        rows, own = slice(40 * w, 40 * w + 40), slice(n_p + n_x * w, n_p + n_x * (w + 1))
        whole[rows, :n_p], whole[rows, own] = tables[w, :, :n_p], tables[w, :, n_p:-1]
        target[rows] = tables[w, :, -1]
    whole[n * 40 :, n_p:] = np.diag(np.tile(np.sqrt(weight), n))
    target[n * 40 :] = -(np.sqrt(weight) * offset).ravel()
    x, left = np.linalg.lstsq(whole, target, rcond=None)[:2]
    assert np.concatenate([by_p, by_x.ravel()]) == pytest.approx(x, rel=1e-9)
    assert decrease.sum() == pytest.approx(target @ target - left[0], rel=1e-9)
