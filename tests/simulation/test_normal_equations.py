"""Normal equations: what is but rounding moves nothing, and is not seen."""

import numpy as np
import pytest

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
