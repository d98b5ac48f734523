"""Without a model quantities get names: never those of columns that hold something else."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import PGNNLRegressor, SINDYcRegressor
from sklearn_pgnn.estimators.table_names import blank_model

T = np.tile(np.arange(150) * 0.05, 2)
F = np.sin(T * np.repeat([1.0, 2.0], 150))
Y = np.concatenate([np.cumsum(F[:150]), np.cumsum(F[150:])]) * 0.05
QUICK = {"max_epochs": 2, "module__neurons": 2, "refine_max_iter": 3, "random_state": 0}


@pytest.mark.parametrize("name", ["x0", "v0", "u0", "u1", "y0"])
@pytest.mark.parametrize("estimator", [SINDYcRegressor(degree=1), PGNNLRegressor(**QUICK)])
def test_an_input_may_have_any_name(estimator, name):
    if isinstance(estimator, SINDYcRegressor):
        pytest.importorskip("pysindy")
    as_it_is, renamed = (pd.DataFrame({"t": T, "other": 0.5 * F**2, c: F}) for c in ("F", name))
    expected = estimator.fit(as_it_is, Y).predict(as_it_is)
    np.testing.assert_allclose(estimator.fit(renamed, Y).predict(renamed), expected, rtol=1e-9)
    assert len(estimator.model_.inputs) == 2


def test_a_name_that_is_changed_is_no_other_columns():
    X = pd.DataFrame({"t": T, "phi_rad": F})
    model = blank_model(X, pd.DataFrame({"phi [rad]": Y}), None)
    assert dict(model.columns) == {"phi_rad_": "phi [rad]"}
    assert list(model.inputs) == ["phi_rad"]


def test_a_state_that_y_names_is_still_read_from_its_column():
    X = pd.DataFrame({"t": T, "F": F, "x0": Y})
    assert list(blank_model(X, pd.DataFrame({"x0": Y}), None).inputs) == ["F"]
    assert list(blank_model(X, pd.Series(Y, name="x0"), None).inputs) == ["F"]


def test_the_time_by_its_place_is_no_input():
    X = pd.DataFrame({"F": F, "clock": T})
    assert list(blank_model(X, Y, 1).inputs) == ["F"]
    by_place, by_name = (PGNNLRegressor(time_column=c, **QUICK).fit(X, Y) for c in (-1, "clock"))
    np.testing.assert_array_equal(by_place.predict(X), by_name.predict(X))
    array = X.to_numpy()
    of_array = PGNNLRegressor(time_column=-1, **QUICK).fit(array, Y)
    np.testing.assert_array_equal(of_array.predict(array), by_name.predict(X))
