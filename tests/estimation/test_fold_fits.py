"""A fold's fit keeps what the other folds tell, and moves only what they do not."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sklearn_pgnn.estimation.fold_fits import keep_taught


def told(rng, n, rank):
    """Return the information of so many directions."""
    some = rng.normal(size=(n, rank))
    return some @ some.T


@given(st.integers(2, 6), st.integers(0, 99))
def test_a_fold_moves_only_what_the_others_do_not_tell(n, seed):
    """In any units of the parameters."""
    rng = np.random.default_rng(seed)
    fold, others = np.eye(n) + told(rng, n, n), 1e4 * told(rng, n, n - 1)
    sharp, directions = np.linalg.eigh(others)
    assume(sharp[1] > 10 * np.linalg.eigvalsh(fold)[-1])
    precision = keep_taught(fold, others)
    step = np.linalg.solve(fold + precision, fold @ rng.normal(size=n))
    across = directions[:, 1:].T @ step
    assert np.linalg.norm(across) < 1e-3 * np.linalg.norm(step)
    units = 10.0 ** rng.uniform(-3, 3, n)
    outer = np.outer(units, units)
    scaled = keep_taught(outer * fold, outer * others)
    np.testing.assert_allclose(scaled / outer, precision, rtol=1e-4, atol=1e-4 * sharp[-1])


@pytest.mark.parametrize("share", [0.2, 1.0, 50.0])
def test_a_fold_moves_nothing_where_the_others_tell_a_tenth_of_what_it_does(share):
    fold = told(np.random.default_rng(0), 4, 4)
    assert keep_taught(fold, share * fold) is None
    assert keep_taught(np.zeros((4, 4)), fold) is None
    assert keep_taught(fold, 0.05 * fold) is not None
