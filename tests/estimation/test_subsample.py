"""Laws of the samples that first fits are made on."""

import numpy as np
import pytest
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn.estimation.budgets import SAMPLES
from sklearn_pgnn.estimation.problem import build_problem, subsample_windows
from sklearn_pgnn.trajectories import read_records


def subsample_of(n_records, samples, length, noise=NOISE):
    """Return the windows of such a length [s], and those that first fits take."""
    drives = drive(n_records=n_records, samples=samples, noise=noise)
    records = read_records(SLEDGE, *drives)
    problem = build_problem(SLEDGE, records, window_length=length)
    return problem.windows, subsample_windows(problem, np.arange(len(problem.windows), dtype=float))


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
