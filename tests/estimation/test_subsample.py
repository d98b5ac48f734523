"""Laws of the samples that first fits are made on."""

import numpy as np
import pytest
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn.estimation.budgets import SAMPLES
from sklearn_pgnn.estimation.problem import build_problem, subsample_windows
from sklearn_pgnn.trajectories import read_records


def subsample_of(n_records, samples, length, noise=NOISE, error=lambda windows: 1.0):
    """Return the windows of such a length [s], and those that first fits take."""
    drives = drive(n_records=n_records, samples=samples, noise=noise)
    records = read_records(SLEDGE, *drives)
    problem = build_problem(SLEDGE, records, window_length=length)
    residual = np.broadcast_to(error(problem.windows), problem.windows.y.shape)
    return problem.windows, subsample_windows(problem, residual)


@pytest.mark.parametrize("noise", [NOISE, 1e-7])  # with so little all samples tell
@pytest.mark.parametrize("length", [0.6, 10.0, 60.0])
def test_first_fits_take_few_samples_however_long_windows_are(length, noise):
    windows, some = subsample_of(8, 3000, length, noise)
    assert windows.lengths.sum() > 3 * SAMPLES
    assert some.windows.lengths.sum() <= 1.5 * SAMPLES
    starts = windows.t[windows.starts[some.which]]
    np.testing.assert_array_equal(some.windows.t[some.windows.starts], starts)


def test_of_short_records_first_fits_take_all():
    windows, some = subsample_of(4, 500, 2.5)
    assert some.factor == 1
    np.testing.assert_array_equal(some.windows.lengths, windows.lengths)


def test_what_is_wrong_late_in_long_windows_is_among_the_samples_of_first_fits():
    def late(windows):
        share = np.zeros((windows.t.size, 1))
        for start, length in zip(windows.starts, windows.lengths, strict=True):
            share[start + length - 100 : start + length] = 1.0
        return share

    _, some = subsample_of(8, 3000, 60.0, 1e-7)
    windows, all_of_them = subsample_of(8, 3000, 60.0, 1e-7, late)
    assert some.windows.lengths.sum() < all_of_them.windows.lengths.sum()
    np.testing.assert_array_equal(
        all_of_them.factor * all_of_them.windows.lengths, windows.lengths[all_of_them.which]
    )
