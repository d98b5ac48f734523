"""Where a table holds the time: its place counts in a table with names as in an array."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import (
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
)
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
T = np.arange(0, 20, 0.1)
X = pd.DataFrame({"u": np.sin(T), "clock": T})
Y = LAG.with_parameters(T=3.0).simulate(T, np.sin(T)).y[:, 0]


@pytest.mark.parametrize("place", [1, -1, np.int64(1)])
def test_the_time_may_be_told_by_its_place(place):
    (by_place,), (by_name,) = (read_records(LAG, X, time_column=c) for c in (place, "clock"))
    np.testing.assert_array_equal(by_place.t, by_name.t)
    for make in (PhysicsModelRegressor, ResidualRegressor):
        np.testing.assert_array_equal(
            make(LAG, time_column=place).fit(X, Y).predict(X),
            make(LAG, time_column="clock").fit(X, Y).predict(X),
        )
    pd.testing.assert_frame_equal(
        PhysicsModelTransformer(LAG, time_column=place).fit_transform(X),
        PhysicsModelTransformer(LAG, time_column="clock").fit_transform(X),
    )


@pytest.mark.parametrize("place", [1, -1])
@pytest.mark.parametrize("table", [X, X.to_numpy(), pd.DataFrame(X.to_numpy())])
def test_without_a_model_the_time_is_no_feature(table, place):
    fitted = ResidualRegressor(time_column=place).fit(table, Y)
    assert fitted.regressor_.n_features_in_ == 1
    np.testing.assert_allclose(
        fitted.predict(table), ResidualRegressor().fit(X[["u"]], Y).predict(X[["u"]])
    )


def test_a_place_that_is_not_there():
    with pytest.raises(RecordError, match="expected a column number from 0 to 1, got 2"):
        read_records(LAG, X, time_column=2)
