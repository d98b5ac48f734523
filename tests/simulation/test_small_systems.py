"""Small systems: rounding moves nothing, bounds hold, and eigenvalues are those of LAPACK."""

import numpy as np
import pytest
from numba import njit

from sklearn_pgnn.simulation import bounded_step as module
from sklearn_pgnn.simulation.bounded_step import bounded_step
from sklearn_pgnn.simulation.normal_equations import diagonalise, follow, project

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


@njit
def run(matrix, vectors):
    """Call what only compiled code can call."""
    diagonalise(matrix, vectors)


@pytest.mark.parametrize("n", range(1, 12))
def test_a_diagonalised_matrix_has_the_eigenvalues_of_lapack(n):
    rng = np.random.default_rng(n)
    for spread in (0.0, 3.0, 8.0):
        axes = np.linalg.qr(rng.normal(size=(n, n)))[0]
        matrix = axes @ np.diag(10.0 ** rng.uniform(-spread, 0, n)) @ axes.T
        matrix = 0.5 * (matrix + matrix.T)
        found, vectors = matrix.copy(), np.empty((n, n))
        run(found, vectors)
        size = np.abs(matrix).max()
        assert np.sort(np.diag(found)) == pytest.approx(
            np.linalg.eigvalsh(matrix), abs=1e-14 * size
        )
        assert vectors.T @ vectors == pytest.approx(np.eye(n), abs=1e-13)
        again = vectors @ np.diag(np.diag(found)) @ vectors.T
        assert again == pytest.approx(matrix, abs=1e-13 * size)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_zeros_and_what_is_not_finite_are_left_as_they_are(value):
    matrix, vectors = np.full((3, 3), value), np.empty((3, 3))
    run(matrix, vectors)
    assert np.array_equal(matrix, np.full((3, 3), value), equal_nan=True)
    assert np.array_equal(vectors, np.eye(3))


@pytest.mark.parametrize("hessian", [[[-1e-20]], [[-1e35]], [[0.0]]])
def test_what_rounding_has_made_of_a_hessian_moves_nothing(hessian):
    step = bounded_step(np.array(hessian), np.array([1e-3]), 0.0, np.array([-1.0]), np.ones(1))
    assert step.tolist() == [0.0]


def test_a_step_within_bounds_satisfies_the_conditions_of_optimality():
    """A convex problem: what no value inside the bounds, nor one leaving them, can lower, is it."""
    rng = np.random.default_rng(0)
    for collinear in (0.0, 0.999) * 200:
        n = int(rng.integers(1, 12))
        table = rng.normal(size=(n + 3, n)) * 10.0 ** rng.uniform(-3, 3, n)
        table += collinear * table[:, :1] * np.sign(rng.normal(size=n))
        hessian, size = table.T @ table, np.linalg.norm(table, axis=0)
        gradient = size * rng.normal(size=n)
        low, high = -np.abs(rng.normal(size=n)) / size, np.abs(rng.normal(size=n)) / size
        step = bounded_step(hessian, gradient, 1e-3, low, high)
        slope = (gradient - hessian @ step) / size - 1e-3 * size * step
        small = 1e-9 * max(1.0, np.abs(gradient / size).max(), np.abs(slope).max())
        at_low, at_high = np.isclose(step, low, rtol=1e-9), np.isclose(step, high, rtol=1e-9)
        assert ((low <= step + 1e-9 / size) & (step <= high + 1e-9 / size)).all()
        assert (np.abs(slope[~at_low & ~at_high]) < small).all()
        assert (slope[at_low] < small).all()
        assert (slope[at_high] > -small).all()


def test_a_step_whose_set_of_bounds_cycles_is_found_as_well(monkeypatch):
    used = []
    solve = module.lsq_linear
    monkeypatch.setattr(module, "lsq_linear", lambda *a, **o: used.append(1) or solve(*a, **o))
    test_a_step_within_bounds_satisfies_the_conditions_of_optimality()
    assert used


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_equations_that_are_not_finite_are_refused(value):
    far = np.full(2, np.inf)
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        bounded_step(np.eye(2), np.array([1.0, value]), 0.0, -far, far)
