"""A sample interval is a finite time above 0, whoever asks for it."""

from fractions import Fraction

import numpy as np
import pytest

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.trajectories.clock import check_sample_interval

pytestmark = pytest.mark.core


@pytest.mark.parametrize("value", [0.01, 1, np.float32(0.5), np.int64(2), Fraction(1, 3)])
def test_a_finite_time_above_zero_passes(value):
    check_sample_interval(value)


@pytest.mark.parametrize("value", [0, -0.1, np.nan, np.inf, "0.1", True, None, [0.1]])
def test_anything_else_is_refused_by_the_name_of_the_option(value):
    with pytest.raises(OptionError, match=r"^sample_time: expected .* seconds.* got .* Remedy: x$"):
        check_sample_interval(value, "sample_time", "Remedy: x")
