"""What residuals remember does not depend on rows in which nothing was measured."""

import numpy as np
import pytest

from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times, white_power

pytestmark = pytest.mark.core


def test_rows_without_a_measured_value_change_nothing():
    rng = np.random.default_rng(0)
    rest = np.cumsum(rng.normal(size=(400, 1)), axis=0) % 3.0
    sparse = np.full((800, 1), np.nan)
    sparse[::2] = rest
    segment, starts = np.repeat([0, 1], 200), np.array([0, 200])
    assert np.allclose(white_power(sparse, 2 * starts), white_power(rest, starts))
    assert np.allclose(
        autocorrelation_times(sparse, np.repeat(segment, 2)), autocorrelation_times(rest, segment)
    )


def test_what_stays_all_through_a_window_counts_once_for_it():
    """The mean over windows is then as uncertain as of one sample in each."""
    constant = np.repeat(np.random.default_rng(0).normal(size=50), 40)[:, None]
    (time,) = autocorrelation_times(constant, np.repeat(np.arange(50), 40))
    assert time == pytest.approx(40.0)
