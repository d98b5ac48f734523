"""A step within bounds satisfies the conditions of optimality; rounding moves nothing."""

import numpy as np
import pytest

from sklearn_pgnn.simulation import bounded_step as module
from sklearn_pgnn.simulation.bounded_step import bounded_step

pytestmark = pytest.mark.core


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
