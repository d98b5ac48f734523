"""Laws of autocorrelation times: known ones are met, and rows without a value do not count."""

import numpy as np
import pytest
from scipy.signal import lfilter

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


@pytest.mark.parametrize("kept", [0.0, 0.5, 0.9, 0.97])
def test_the_autocorrelation_time_of_a_first_order_process_is_the_known_one(kept):
    draws = np.random.default_rng(0).standard_normal((200_000, 1))
    noise = lfilter([1], [1, -kept], draws, axis=0)
    time = autocorrelation_times(noise, np.zeros(len(noise)))
    assert time[0] == pytest.approx((1 + kept) / (1 - kept), rel=0.12)


def test_a_segment_knows_nothing_of_the_next_one():
    noise = np.repeat(np.random.default_rng(0).standard_normal((2000, 1)), 2, axis=0)
    alone = np.arange(len(noise))
    assert autocorrelation_times(noise, alone) == 1.0
    assert autocorrelation_times(noise, np.zeros(len(noise)))[0] == pytest.approx(2.0, rel=0.15)
