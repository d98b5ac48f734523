"""Records as one plain table."""

import sys

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.grey_box.tables import plain_table
from sklearn_pgnn.trajectories import read_records


def test_joblib_sees_that_a_table_holds_records():
    lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    t = np.arange(500) * 0.1
    table = plain_table(lag, read_records(lag, np.column_stack([t, np.sin(t)]), np.cos(t)))
    assert sys.getsizeof(table) > 3 * t.nbytes  # time, input and output
    sizeof = pytest.importorskip("dask.sizeof").sizeof
    assert sizeof(table) > 1e3  # what joblib sends to a cluster once is larger
