"""Results as plain data: what JSON holds, to the last number."""

import math

import numpy as np
import pytest

from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.diagnosis.verdict import Remaining
from sklearn_pgnn.estimation.plain_data import finite, plain
from sklearn_pgnn.simulation.uncertainty import Estimate

pytestmark = pytest.mark.core


def test_a_number_that_is_not_finite_is_none_however_deep_it_lies():
    left = plain(
        Remaining("structure", {"y": math.inf, "z": 2.0}, Structure("v", 0.9, 0.0, ("v",)))
    )
    assert left["times_noise"] == {"y": None, "z": 2.0}
    assert (left["kind"], left["law"]["depends_on"]) == ("structure", ["v"])
    assert plain(Estimate(0.5, -math.inf, math.nan))["low"] is None
    assert finite([{"a": (1.0, [{"b": -math.inf}])}]) == [{"a": [1.0, [{"b": None}]]}]


def test_numbers_of_numpy_become_plain_ones():
    found = finite({"count": np.int64(3), "is_it": np.bool_(True), "share": np.float64("nan")})
    assert found == {"count": 3, "is_it": True, "share": None}
    assert type(found["count"]) is int
