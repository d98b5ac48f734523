"""y is read by place: names that say another order are refused, wherever y goes in."""

import numpy as np
import pandas as pd
import pytest
from sklearn.model_selection import cross_val_score

from sklearn_pgnn import (
    ConformalRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
)
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.model_selection import TrajectoryKFold
from sklearn_pgnn.trajectories import read_file, read_files, read_records
from sklearn_pgnn.trajectories.reader import read_outputs

pytestmark = pytest.mark.core

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "F - d*v - 9*x"},
    {"d": 0.5},
    {"F": "N"},
    columns={"x": "position"},
)
ORDER = (
    r"^y: expected the outputs in the model's order, x, v; got the columns {}. Predictions are "
    r"compared with y by place. Remedy: y\[\['x', 'v'\]\].$"
)


def records():
    t = np.tile(np.arange(100) * 0.05, 3)
    force = np.sin(t * np.repeat([1.0, 2.0, 3.0], 100))
    runs = [CART.with_parameters(d=0.8).simulate(t[:100], part).y for part in force.reshape(3, 100)]
    return pd.DataFrame({"F": force, "t": t}), pd.DataFrame(
        np.concatenate(runs), columns=["x", "v"]
    )


X, Y = records()
SWAPPED, WIDER = Y[["v", "x"]], Y.assign(temp=20.0)


@pytest.mark.parametrize(("y", "got"), [(SWAPPED, "v, x"), (WIDER, "x, v, temp")])
@pytest.mark.parametrize("estimator", [PhysicsModelRegressor(CART), ResidualRegressor(CART)])
def test_names_in_another_order_are_refused_wherever_y_goes_in(estimator, y, got):
    with pytest.raises(RecordError, match=ORDER.format(got)):
        estimator.fit(X, y)
    estimator.fit(X, Y)
    with pytest.raises(RecordError, match=ORDER.format(got)):
        estimator.score(X, y)
    with pytest.raises(RecordError, match=ORDER.format(got)):
        estimator.predict_ahead(X, y)


def test_what_compares_by_place_never_sees_another_order():
    folds = TrajectoryKFold(3)
    with pytest.raises(RecordError, match="in the model's order"):
        cross_val_score(PhysicsModelRegressor(CART), X, SWAPPED, cv=folds, error_score="raise")
    with pytest.raises(RecordError, match="in the model's order"):
        ConformalRegressor(ResidualRegressor(CART)).fit(X, SWAPPED)
    assert cross_val_score(PhysicsModelRegressor(CART), X, Y, cv=folds).min() > 0.99


def test_names_of_the_table_count_and_those_of_no_table_do_not():
    named = Y.rename(columns={"x": "position"})
    for y in (named, Y, Y.to_numpy(), pd.DataFrame(Y.to_numpy()), Y.to_numpy().tolist()):
        np.testing.assert_array_equal(read_outputs(CART, y, len(X)), Y)
    with pytest.raises(RecordError, match=r"order, position, v; .* y\[\['position', 'v'\]\]"):
        read_outputs(CART, named[["v", "position"]], len(X))
    one = CART.replace(outputs={"x": "x"})
    with pytest.raises(RecordError, match=r"order, x; got the columns x, v"):
        read_records(one, X, Y)


@pytest.mark.parametrize("name", ["v", "temp"])
def test_a_single_column_of_another_name_is_refused(name):
    one = CART.replace(outputs={"x": "x"})
    with pytest.raises(RecordError) as caught:
        ResidualRegressor(one).fit(X, WIDER[[name]])
    assert str(caught.value) == (
        f"y: output 'x' is missing; the columns are {name}. Remedy: name the column in the "
        f"model's 'columns', or y.to_numpy() if only the name is wrong."
    )


@pytest.mark.parametrize("name", ["x", "sensor 3", "F", None])
def test_a_series_may_have_any_name_for_it_keeps_that_of_what_it_was_computed_from(name):
    one = CART.replace(outputs={"place": "x"})
    np.testing.assert_array_equal(read_outputs(one, Y["x"].rename(name), len(X)), Y[["x"]])


def test_without_a_model_columns_may_be_any():
    np.testing.assert_array_equal(read_outputs(None, WIDER, len(X)), WIDER)
    with pytest.raises(RecordError, match=r"expected shape \(7, 2\)"):
        read_outputs(None, Y, 7)


# -- a record may lack one of several outputs, in files as in tables -------------------------------

MODEL = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - v)/m"},
    {"m": 2.0},
    {"F": "N"},
    outputs={"place": "x", "speed": "v"},
)
RUN = pd.DataFrame({"t": np.arange(6.0), "F": 1.0, "place": np.arange(6.0), "speed": 1.0})


@pytest.mark.parametrize("lacks", [["place"], ["speed"]])
@pytest.mark.parametrize("empty", [True, False], ids=["empty", "absent"])
def test_one_file_of_several_may_lack_an_output(tmp_path, lacks, empty):
    without = RUN.assign(**dict.fromkeys(lacks, np.nan)) if empty else RUN.drop(columns=lacks)
    for order in (0, 1):
        tables = [RUN, without][:: 1 - 2 * order]
        paths = [tmp_path / f"run_{k}.csv" for k in range(2)]
        for path, table in zip(paths, tables, strict=True):
            table.to_csv(path, index=False)
        X, y = read_files(paths, MODEL)
        assert list(y) == ["place", "speed"]
        expected = pd.concat([table.reindex(columns=list(y)) for table in tables])
        np.testing.assert_array_equal(y, expected)
        assert len(read_records(MODEL, X, y)) == 2


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ([RUN.drop(columns="speed")] * 2, r"run_0.csv:1: column 'speed': missing; .* Remedy: add"),
        ([RUN.assign(speed=np.nan)] * 2, r"run_0.csv:2: column 'speed': expected a measured value"),
        ([RUN, RUN.drop(columns=["place", "speed"])], r"run_1.csv:1: column 'place': missing"),
    ],
)
def test_every_output_needs_a_file_and_every_file_an_output(tmp_path, tables, said):
    paths = [tmp_path / f"run_{k}.csv" for k in range(2)]
    for path, table in zip(paths, tables, strict=True):
        table.to_csv(path, index=False)
    with pytest.raises(RecordError, match=said):
        read_files(paths, MODEL)


def test_of_a_single_file_every_output_is_needed(tmp_path):
    RUN.assign(speed=np.nan).to_csv(tmp_path / "run.csv", index=False)
    with pytest.raises(RecordError, match="Remedy: take the output out of the model, or give with"):
        read_file(tmp_path / "run.csv", MODEL)
