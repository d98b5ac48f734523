"""Tables of any library, and clocks of any kind, are the same records."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import (
    ModelDiagnosis,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    SINDYcRegressor,
)
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.model_selection import TrajectoryKFold
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.tables import take_rows

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 0.05}, {"u": "V"})
T = np.tile(np.arange(60) * 0.005, 3)
RUN = np.repeat(["a", "b", "c"], 60)
U = np.sin(40 * T) + np.cos(25 * T) * np.repeat([1.0, 2.0, 3.0], 60)


def to_polars(table):
    pl = pytest.importorskip("polars")
    return pl.DataFrame({name: table[name].to_numpy() for name in table})


def to_arrow(table):
    return pytest.importorskip("pyarrow").table({name: table[name].to_numpy() for name in table})


@pytest.fixture
def tables():
    """X with its columns in an order that is not the array's, and y in the model's order."""
    two = LAG.replace(outputs={"first": "y", "second": "2*y"})
    X = pd.DataFrame({"other": 7.0, "u": U, "t": T, "y": 0.25})
    y = pd.DataFrame({"first": np.cos(T), "second": 2 * np.cos(T)})
    return two, X, y


def assert_same(found, expected):
    assert len(found) == len(expected) == 3
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.t, other.t, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(one.u, other.u)
        np.testing.assert_array_equal(one.x0, other.x0)
        np.testing.assert_array_equal(one.rows, other.rows)
        if one.y is not None:
            np.testing.assert_array_equal(one.y, other.y)


@pytest.mark.parametrize("kind", [to_polars, to_arrow])
def test_every_library_is_read_by_name(tables, kind):
    model, X, y = tables
    found = read_records(model, kind(X), kind(y))
    assert_same(found, read_records(model, X, y))
    np.testing.assert_array_equal(found[1].u[:, 0], U[60:120])


def test_numbers_may_come_in_the_byte_order_of_other_machines(tables):
    model, X, y = tables
    X = X[["t", "u", "y"]]
    expected = read_records(model, X, y)
    foreign = X.astype(">f8")
    assert_same(read_records(model, foreign.to_numpy(), y.to_numpy().astype(">f8")), expected)
    assert_same(read_records(model, foreign, y.astype(">f8")), expected)
    assert foreign.dtypes.eq(np.dtype(">f8")).all()
    fitted = ResidualRegressor(model).fit(X, y)
    np.testing.assert_array_equal(
        ResidualRegressor(model).fit(X.to_numpy().astype(">f8"), y).predict(X.to_numpy()),
        fitted.predict(X),
    )


@pytest.mark.parametrize("kind", [to_polars, to_arrow])
def test_a_lost_column_is_missed_by_name(tables, kind):
    model, X, _ = tables
    with pytest.raises(RecordError, match="input 'u' is missing; the columns are other, t, y"):
        read_records(model, kind(X.drop(columns="u")))


@pytest.mark.parametrize("kind", [to_polars, to_arrow])
@pytest.mark.parametrize(
    "estimator", [PhysicsModelRegressor(LAG), ResidualRegressor(LAG), SINDYcRegressor(LAG)]
)
def test_estimators_read_every_library_by_name(kind, estimator):
    X = pd.DataFrame({"u": U, "t": T, "y": 0.0})
    y = pd.DataFrame({"y": LAG.simulate(T[:60], U[:60]).y.ravel().tolist() * 3})
    expected = estimator.fit(X, y).predict(X)
    found = estimator.fit(kind(X), kind(y))
    assert found.feature_names_in_.tolist() == ["u", "t", "y"]
    np.testing.assert_array_equal(found.predict(kind(X)), expected)
    with pytest.raises(ValueError, match="feature names"):
        found.predict(kind(X[["t", "u", "y"]]))


def test_sindyc_names_its_states_after_the_columns_of_any_library():
    pytest.importorskip("pysindy")
    X = pd.DataFrame({"u": U, "t": T})
    found = SINDYcRegressor().fit(to_polars(X), to_polars(pd.DataFrame({"level": np.cos(T)})))
    assert list(found.model_.states) == ["level"]
    assert list(found.model_.inputs) == ["u"]


@pytest.mark.slow
def test_a_network_without_a_model_sees_trajectories_in_a_table_of_polars():
    pytest.importorskip("skorch")
    from sklearn_pgnn import PGNNLRegressor

    X = pd.DataFrame({"u": U, "t": T, "start": np.cos(T)})
    options = {"states": ["start"], "max_epochs": 1, "module__neurons": 2, "random_state": 0}
    plain = PGNNLRegressor(**options).fit(X, np.cos(T)).predict(X)
    found = PGNNLRegressor(**options).fit(to_polars(X), np.cos(T))
    assert found.feature_names_in_.tolist() == ["u", "t", "start"]
    np.testing.assert_array_equal(found.predict(to_polars(X)), plain)
    # of the states only each trajectory's first row is read: there is nothing to copy y from
    late = np.tile(np.arange(60) > 0, 3)
    blind = X.assign(start=X["start"].where(~late))
    np.testing.assert_array_equal(found.predict(to_polars(blind)), plain)


@pytest.mark.parametrize("kind", [to_polars, to_arrow])
def test_splits_keep_tables_what_they_are(kind):
    X = pd.DataFrame({"u": U, "t": T})
    folds = list(TrajectoryKFold(3).split(X))
    for (train, test), (train_of, test_of) in zip(
        folds, TrajectoryKFold(3).split(kind(X)), strict=True
    ):
        np.testing.assert_array_equal(train, train_of)
        np.testing.assert_array_equal(test, test_of)
    part = take_rows(kind(X), folds[0][1])
    assert type(part) is type(kind(X))
    np.testing.assert_array_equal(np.asarray(part["u"]), U[folds[0][1]])


# -- clocks ----------------------------------------------------------------------------------------


def stamps(unit="ns", zone=None):
    """Date every sample; the trajectories follow each other by days."""
    days = np.repeat(np.arange(3) * 5, 60)
    start = pd.Timestamp("2026-01-31 12:00:00", tz=zone)
    index = start + pd.to_timedelta(days, unit="D") + pd.to_timedelta(np.rint(T * 1e6), unit="us")
    return index.as_unit(unit)


EXPECTED = pd.DataFrame({"trajectory": RUN, "t": T, "u": U})


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_dates_are_a_time(unit, zone):
    dates = stamps(unit, zone)
    expected = read_records(LAG, EXPECTED)
    column = EXPECTED.assign(t=dates)
    assert_same(read_records(LAG, column), expected)
    assert_same(read_records(LAG, EXPECTED.drop(columns="t").set_index(dates)), expected)
    renamed = column.rename(columns={"t": "Zeit"})
    assert_same(read_records(LAG, renamed, time_column="Zeit"), expected)
    assert_same(read_records(LAG.replace(columns={"t": "Zeit"}), renamed), expected)


def test_time_differences_are_a_time():
    differences = pd.to_timedelta(np.rint(T * 1e6), unit="us") + pd.Timedelta(days=3)
    expected = read_records(LAG, EXPECTED)
    assert_same(read_records(LAG, EXPECTED.assign(t=differences)), expected)
    indexed = EXPECTED.drop(columns=["t", "trajectory"]).set_index(differences)
    assert_same(read_records(LAG, indexed), expected)


def test_dates_and_time_differences_of_polars_are_a_time():
    pl = pytest.importorskip("polars")
    expected = read_records(LAG, EXPECTED)
    table = pl.DataFrame({"u": U, "trajectory": RUN, "t": stamps().to_numpy()})
    assert_same(read_records(LAG, table), expected)
    zoned = table.with_columns(pl.col("t").dt.replace_time_zone("Europe/Berlin"))
    assert_same(read_records(LAG, zoned), expected)
    since = table.with_columns(pl.col("t") - pl.col("t").min())
    assert_same(read_records(LAG, since), expected)


def test_nanoseconds_are_kept():
    start = pd.Timestamp("2026-01-31 12:00:00.000000001")
    dates = pd.DatetimeIndex([start + pd.Timedelta(k, unit="ns") for k in (0, 1, 3, 7)])
    (record,) = read_records(LAG, pd.DataFrame({"u": 0.0}, index=dates))
    np.testing.assert_allclose(record.t, [0.0, 1e-9, 3e-9, 7e-9], rtol=1e-12)


def test_a_missing_date_is_refused_with_its_row():
    table = pd.DataFrame({"t": stamps().to_numpy(), "u": U})
    table.loc[17, "t"] = pd.NaT
    with pytest.raises(RecordError, match=r"X: time 't' is NaT in row 17; expected a time\. Rem"):
        read_records(LAG, table)
    with pytest.raises(RecordError, match=r"NaT in row 17"):
        list(TrajectoryKFold(2).split(table))


def test_a_date_is_no_input():
    with pytest.raises(RecordError, match="input 'u': expected real numbers, got datetime64"):
        read_records(LAG, EXPECTED.assign(u=stamps()))


def test_estimators_take_dates_for_a_time():
    y = LAG.simulate(T[:60], U[:60]).y.ravel().tolist() * 3
    dated = EXPECTED[["u"]].set_index(stamps())
    dated["trajectory"] = RUN
    plain = PhysicsModelRegressor(LAG).fit(EXPECTED, y)
    found = PhysicsModelRegressor(LAG).fit(dated, y)
    np.testing.assert_allclose(found.predict(dated), plain.predict(EXPECTED), atol=1e-9)
    assert found.feature_names_in_.tolist() == ["t", "u", "trajectory"]
    assert len(list(TrajectoryKFold(3).split(dated))) == 3
    passed = PhysicsModelTransformer(LAG).fit_transform(dated.drop(columns="trajectory")[:60])
    np.testing.assert_allclose(passed["t"], T[:60], atol=1e-12)


def test_a_diagnosis_of_dates_is_that_of_seconds():
    t = np.arange(400) * 0.01
    u = np.sign(np.sin(3 * t))
    y = LAG.simulate(t, u).y + 1e-3 * np.random.default_rng(0).normal(size=(400, 1))
    dates = pd.Timestamp("2026-01-31") + pd.to_timedelta(np.rint(t * 1e3), unit="ms")
    options = {"catalogue": ["input_bias"]}
    plain = ModelDiagnosis(LAG, **options).fit(pd.DataFrame({"t": t, "u": u}), y)
    found = ModelDiagnosis(LAG, **options).fit(pd.DataFrame({"u": u}, index=dates), y)
    assert found.verdict_ == plain.verdict_
    assert found.gain_["y"].extended == pytest.approx(plain.gain_["y"].extended, rel=1e-6)
