"""Depths of the recipe see what is visible, and nothing behind it."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.grey_box.depth import FittedDepth, fit_network
from sklearn_pgnn.grey_box.tables import PlainTable

LAG = PhysicsModel({"v": "V"}, {"v": "(u - v)/T"}, {"T": 1.0}, {"u": "V"})


class Witness(BaseEstimator):
    """An estimator that keeps what it was given."""

    def __init__(self, model=None):
        self.model = model

    def fit(self, X, y):
        """Keep it."""
        self.X_, self.y_ = X, y
        return self


def test_a_network_gets_a_trajectory_until_its_last_visible_measurement():
    X = pd.DataFrame({"trajectory": np.repeat([0, 1, 2], 5), "t": np.tile(np.arange(5.0), 3)})
    X["u"] = 0.0
    table = PlainTable(X, np.arange(15.0)[:, None], np.zeros((3, 1)))
    visible = np.ones(15, dtype=bool)
    visible[[3, 4]] = False  # the end of the first
    visible[6] = False  # within the second
    visible[10:] = False  # the whole third
    physics = SimpleNamespace(model_=LAG)
    fitted = FittedDepth(None, physics, np.array([[1.0], [2.0], [np.nan]]))
    got = fit_network(Witness(), fitted, table, visible).estimator
    assert got.X_["trajectory"].tolist() == [0] * 3 + [1] * 5
    assert got.X_["v"].dropna().tolist() == [1.0, 2.0]
    np.testing.assert_array_equal(got.y_.ravel(), [0, 1, 2, 5, np.nan, 7, 8, 9])
    assert got.model is not None
