"""Normal equations: what is but rounding moves nothing, and is not seen."""

import numpy as np
import pytest

from sklearn_pgnn.simulation import normal_equations
from sklearn_pgnn.simulation.normal_equations import bounded_step, project

pytestmark = pytest.mark.core


@pytest.mark.parametrize("hessian", [[[-1e-20]], [[-1e35]], [[0.0]]])
def test_what_rounding_has_made_of_a_hessian_moves_nothing(hessian):
    step = bounded_step(np.array(hessian), np.array([1e-3]), 0.0, np.array([-1.0]), np.ones(1))
    assert step.tolist() == [0.0]


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
    solve = normal_equations.lsq_linear
    monkeypatch.setattr(
        normal_equations, "lsq_linear", lambda *a, **o: used.append(1) or solve(*a, **o)
    )
    test_a_step_within_bounds_satisfies_the_conditions_of_optimality()
    assert used
