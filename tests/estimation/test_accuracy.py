"""Laws of the comparison of two simulations' accuracy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import norm

from sklearn_pgnn.estimation.accuracy import accuracy_gained
from sklearn_pgnn.estimation.residuals import Residuals

pytestmark = pytest.mark.core


def simulated(errors):
    """Return what a free run with these errors leaves."""
    squares, counts = np.array([np.sum(errors**2)]), np.array([float(errors.size)])
    segment = np.zeros(errors.size, dtype=int)
    return Residuals(squares, counts, np.ones(1), errors[:, None], segment)


def test_simulations_of_equal_accuracy_are_taken_for_different_as_often_as_alpha():
    rng, beyond = np.random.default_rng(0), 0
    for _ in range(400):
        slow = lfilter([1.0], [1.0, -0.95], rng.normal(size=(2, 2000)), axis=1)
        beyond += accuracy_gained(simulated(slow[0]), simulated(slow[1])) < -norm.ppf(1 - 0.05)
    assert 0.02 < beyond / 400 < 0.1


@given(st.floats(1e-6, 1e6))
def test_the_gain_of_accuracy_knows_no_units_and_no_favourite(unit):
    near, far = np.random.default_rng(0).normal(size=(2, 500)) * [[1.0], [1.5]]
    gained = accuracy_gained(simulated(far), simulated(near))
    assert gained > 3.0
    assert accuracy_gained(simulated(near), simulated(far)) == pytest.approx(-gained)
    scaled = accuracy_gained(simulated(unit * far), simulated(unit * near))
    assert scaled == pytest.approx(gained, rel=1e-6)


def test_a_simulation_that_diverges_is_the_worse_one():
    errors = np.random.default_rng(0).normal(size=500)
    finite, lost = simulated(errors), simulated(np.append(errors[1:], np.inf))
    assert accuracy_gained(finite, lost) == -np.inf
    assert accuracy_gained(lost, finite) == np.inf
    assert accuracy_gained(lost, lost) == 0.0
