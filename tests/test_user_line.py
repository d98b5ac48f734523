"""A warning points to the user's line, however many calls lie in between."""

import re
import warnings
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from sklearn.model_selection import cross_val_predict
from sklearn.pipeline import make_pipeline

import sklearn_pgnn
from sklearn_pgnn import PhysicsModel, PhysicsModelRegressor, ResidualRegressor

pytestmark = pytest.mark.core

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})


def contradicted():
    t = np.arange(9.0)
    return np.column_stack([t, np.ones(9), np.full(9, 5.0)]), 1 - np.exp(-t / 2)


def places_of(call, what):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    return {each.filename for each in caught if what in str(each.message)}


@pytest.mark.parametrize(
    "regressor",
    [
        ResidualRegressor(LAG),
        PhysicsModelRegressor(LAG),
        make_pipeline("passthrough", ResidualRegressor(LAG)),
    ],
    ids=["estimator", "fitted physics", "pipeline"],
)
def test_a_warning_of_a_fit_points_here(regressor):
    assert places_of(partial(regressor.fit, *contradicted()), "begins elsewhere") == {__file__}


def test_a_warning_points_here_through_scikit_learn():
    X, y = contradicted()
    X, y = np.vstack([X, X]), np.concatenate([y, y])
    judged = partial(cross_val_predict, ResidualRegressor(LAG), X, y, cv=2)
    assert places_of(judged, "begins elsewhere") == {__file__}


def test_nothing_in_the_package_counts_levels_itself():
    root = Path(sklearn_pgnn.__file__).parent
    files = [path for path in root.rglob("*.py") if path.name != "user_line.py"]
    counted = [path for path in files if re.search(r"stacklevel=", path.read_text("utf-8"))]
    assert counted == []
