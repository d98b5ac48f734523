"""A target that is scaled contradicts the initial states in X, and that is told."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import Ridge
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn import GreyBoxRegressor, PhysicsModelRegressor, ResidualRegressor, systems
from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.contradicted_states import (
    warn_of_contradicted_states,
    warn_of_unknown_starts,
)

CART = systems.cart_on_spring()


def records(noise=0.0):
    rng = np.random.default_rng(1)
    tables, outputs = [], []
    for i in range(3):
        t, start = np.arange(100) * 0.05, rng.normal(size=2) * 0.3
        force = np.sin(t + i)
        y = CART.simulate(t, force, start, substeps=4).y[:, 0]
        table = {"trajectory": i, "t": t, "force": force, "x": start[0], "v": start[1]}
        tables.append(pd.DataFrame(table))
        outputs.append(y + noise * rng.normal(size=t.size))
    return pd.concat(tables, ignore_index=True), np.concatenate(outputs)


X, Y = records()
MESSAGE = r"y: output 'position' is the state 'x', but in \d of 3 .* row 0, y is .* Remedy: let y"


@pytest.mark.parametrize(
    "estimator", [PhysicsModelRegressor(CART), ResidualRegressor(CART, Ridge())]
)
def test_a_scaled_target_is_told(estimator):
    scaled = TransformedTargetRegressor(estimator, transformer=StandardScaler())
    with pytest.warns(RecordWarning, match=MESSAGE):
        scaled.fit(X, Y)


def test_a_network_tells_of_it_too():
    pgnnl = pytest.importorskip("sklearn_pgnn.estimators.pgnnl")
    net = pgnnl.PGNNLRegressor(CART, max_epochs=1, refine=None)
    with pytest.warns(RecordWarning, match=MESSAGE):
        net.fit(X, 10 * Y)


def test_a_target_whose_outputs_are_all_scaled_is_told_once():
    both = CART.replace(outputs={"position": "x", "speed": "v", "again": "x"})
    y = 10 * np.column_stack([Y, np.repeat(X.v[::100], 100), Y])
    with pytest.warns(RecordWarning) as caught:
        warn_of_contradicted_states(both, read_records(both, X, y))
    (said,) = [str(each.message) for each in caught]
    assert "y: output 'position' is the state 'x', but in 3 of 3 trajectories it begins" in said
    assert "So does output 'speed' (state 'v'), output 'again' (state 'x'). Remedy: let y" in said


MISSING = (
    "X: no initial state is given for 'x', 'v' in trajectory '1', row 100 (1 of 3 trajectories), "
    "though every trajectory of fit had it: the prediction starts where the model does, at "
    "'x' = 0, 'v' = 0. Remedy: the states in the first row of every trajectory of X; "
    "GreyBoxRegressor(initial_window=20).predict_from(X, y) estimates them."
)


@pytest.mark.parametrize(
    "estimator", [PhysicsModelRegressor(CART), GreyBoxRegressor(CART, depths=("prior", "fitted"))]
)
def test_a_start_that_only_a_prediction_lacks_is_told(estimator):
    estimator.fit(X, Y)
    lacking = X.assign(x=X.x.where(X.trajectory != 1), v=X.v.where(X.trajectory != 1))
    for ask in (estimator.predict, estimator.predict_states, estimator.predict_interval):
        with pytest.warns(RecordWarning) as caught:
            ask(lacking)
        assert [str(each.message) for each in caught] == [MISSING]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ask(X)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimator.predict_ahead(lacking, Y)  # the measurements tell


def test_a_start_that_the_fit_lacked_as_well_is_told_there_only():
    table = X.drop(columns=["x", "v"])
    with pytest.warns(RecordWarning, match="no initial state is given"):
        estimator = PhysicsModelRegressor(CART).fit(table, Y)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimator.predict(table)


@pytest.mark.parametrize(
    ("table", "y"),
    [
        (X, Y),
        records(noise=0.05),
        (X.drop(columns=["x", "v"]), 10 * Y),
        (X, np.where(X.t, Y, np.nan)),
    ],
    ids=["as told", "noisy", "not told", "not measured"],
)
def test_starts_that_agree_or_are_not_known_are_not(table, y):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_contradicted_states(CART, read_records(CART, table, y))


UNKNOWN = r"X: no initial state is given for 'x', .* in \d of 3 .* row \d+, y is .* Remedy: columns"


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART),
        ResidualRegressor(CART, Ridge()),
        GreyBoxRegressor(CART, depths=("prior", "fitted")),
    ],
)
def test_predictions_that_start_elsewhere_than_y_are_told_once(estimator):
    with pytest.warns(RecordWarning, match=UNKNOWN) as caught:
        estimator.fit(X.drop(columns=["x", "v"]), Y)
    assert len([each for each in caught if "no initial state" in str(each.message)]) == 1


def test_a_network_and_a_sparse_regression_tell_of_unknown_starts_too():
    pgnnl = pytest.importorskip("sklearn_pgnn.estimators.pgnnl")
    sindyc = pytest.importorskip("sklearn_pgnn.estimators.sindyc")
    net = pgnnl.PGNNLRegressor(CART, max_epochs=1, refine=None)
    for estimator in (net, sindyc.SINDYcRegressor(CART, library="model")):
        with pytest.warns(RecordWarning, match=UNKNOWN):
            estimator.fit(X.drop(columns=["x", "v"]), Y)


def test_pieces_cut_from_the_middle_of_trajectories_are_told():
    middle = X.t > 2  # where X has the initial state of the whole trajectory only
    pieces = X.assign(x=np.nan, v=np.nan)[middle]
    with pytest.warns(RecordWarning, match="no initial state is given"):
        PhysicsModelRegressor(CART).fit(pieces, Y[middle])


def test_known_starts_and_machines_at_rest_are_not_told():
    t = np.arange(100) * 0.05
    rest = pd.DataFrame({"t": t, "force": np.sin(t)})
    y = CART.simulate(t, rest["force"], substeps=4).y[:, 0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_unknown_starts(CART, read_records(CART, rest, y))
        warn_of_unknown_starts(CART, read_records(CART, X, Y))
