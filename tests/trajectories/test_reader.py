"""X and y as records: however a table is cut, joined or named, the records are the same."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories.reader import read_records, rows_in_order, split_rows
from sklearn_pgnn.trajectories.record import Record

pytestmark = pytest.mark.core

MODEL = PhysicsModel(
    states={"q": "m", "v": "m/s"},
    inputs={"tau": "N", "load": "N"},
    outputs={"q_m": "q", "v_m": "v"},
    parameters={"M": 95.0, "Fv": 203.0},
    equations={"q": "v", "v": "(tau - load - Fv*v)/M"},
)
ONE_OUTPUT = MODEL.replace(outputs={"q_m": "q"})
CALLED = {
    "t": "Time",
    "tau": "u_force_N",
    "q": "position",
    "q_m": "encoder",
    "trajectory": "run",
}


def table(*lengths, seed=0):
    """Draw X and y of trajectories of so many samples, unevenly sampled."""
    rng = np.random.default_rng(seed)
    n = sum(lengths)
    t = [np.cumsum(rng.uniform(1e-3, 1.0, size)) - 99 * k for k, size in enumerate(lengths)]
    X = pd.DataFrame(rng.standard_normal((n, 5)), columns=["t", "tau", "load", "q", "v"])
    X["t"] = np.concatenate(t)
    y = pd.DataFrame(rng.standard_normal((n, 2)), columns=["q_m", "v_m"])
    return X, y


def assert_same(found, expected, names=True):
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.t, other.t)
        np.testing.assert_array_equal(one.u, other.u)
        np.testing.assert_array_equal(one.y, other.y)
        np.testing.assert_array_equal(one.x0, other.x0)
        assert one.name == other.name or not names


def refusal(X, y=None, model=MODEL, **options):
    with pytest.raises(RecordError) as refused:
        read_records(model, X, y, **options)
    message = str(refused.value)
    assert "\n" not in message
    return message


lengths = st.lists(st.integers(4, 9), min_size=1, max_size=5)


# -- the same records ------------------------------------------------------------------------------


def test_a_record_holds_what_the_table_says():
    X, y = table(4, 5)
    first, second = read_records(MODEL, X, y)
    assert isinstance(first, Record)
    np.testing.assert_array_equal(second.t, X["t"][4:] - X["t"][4])
    np.testing.assert_array_equal(second.u, X[["tau", "load"]][4:])
    np.testing.assert_array_equal(second.y, y[4:])
    np.testing.assert_array_equal(second.x0, X.loc[4, ["q", "v"]].astype(float))
    np.testing.assert_array_equal(second.rows, range(4, 9))
    assert (first.name, second.name) == ("0", "1")


@given(lengths, st.integers(0, 99))
def test_trajectories_read_together_are_those_read_alone(lengths, seed):
    X, y = table(*lengths, seed=seed)
    edges = pairwise(np.cumsum([0, *lengths]))
    alone = [read_records(MODEL, X[a:b], y[a:b])[0] for a, b in edges]
    assert_same(read_records(MODEL, X, y), alone, names=False)


@pytest.mark.slow
@given(lengths, st.randoms(use_true_random=False))
def test_a_trajectory_column_may_mix_the_rows(lengths, random):
    X, y = table(*lengths)
    X["trajectory"] = np.repeat([f"run {k}" for k in range(len(lengths))], lengths)
    together = read_records(MODEL, X, y)
    turns = list(np.repeat(np.arange(len(lengths)), lengths))
    random.shuffle(turns)
    rows = [list(np.flatnonzero(X["trajectory"] == f"run {k}")) for k in range(len(lengths))]
    order = [rows[k].pop(0) for k in turns]
    mixed = read_records(MODEL, X.iloc[order], y.iloc[order])
    assert_same(sorted(mixed, key=lambda r: r.name), sorted(together, key=lambda r: r.name))


@pytest.mark.slow
@given(lengths)
def test_a_frame_and_an_array_say_the_same(lengths):
    X, y = table(*lengths)
    expected = read_records(MODEL, X, y)
    array = X.to_numpy()
    assert_same(read_records(MODEL, array, y.to_numpy()), expected)
    assert_same(read_records(MODEL, array.tolist(), y.to_numpy().tolist()), expected)
    assert_same(read_records(MODEL, pd.DataFrame(array), y), expected)
    assert_same(read_records(MODEL, np.roll(array, -1, axis=1), y, time_column=4), expected)
    assert_same(read_records(MODEL, np.roll(array, -1, axis=1), y, time_column=-1), expected)


@given(st.permutations(["t", "tau", "load", "q", "v", "extra"]))
def test_columns_of_x_count_by_name(columns):
    X, y = table(5, 4)
    shuffled = X.assign(extra="text")[columns]
    assert_same(read_records(MODEL, shuffled, y), read_records(MODEL, X, y))


def test_a_table_may_use_its_own_names():
    X, y = table(5, 4)
    X["trajectory"] = [*"aaaaa", *"bbbb"]
    X.index = [7] * 9
    model = MODEL.replace(columns=CALLED)
    expected = read_records(MODEL, X, y)
    assert_same(read_records(model, X.rename(columns=CALLED), y.rename(columns=CALLED)), expected)
    assert_same(read_records(model, X, y), expected)
    other = X.rename(columns={"t": "clock"})
    assert_same(read_records(model, other, y, time_column="clock"), expected)


def test_the_name_of_the_table_wins_over_ones_own():
    X, _ = table(4)
    model = MODEL.replace(columns={"tau": "u_force_N", "t": "Time"})
    both = X.assign(u_force_N=7.0, Time=X["t"] + 1)
    (record,) = read_records(model, both)
    np.testing.assert_array_equal(record.u[:, 0], 7.0)
    np.testing.assert_array_equal(record.t, both["Time"] - both["Time"][0])
    assert record.origin == both["Time"][0]
    (record,) = read_records(MODEL, both, time_column="Time")
    assert record.origin == both["Time"][0]
    assert record.u.shape == (4, 2)


def test_only_the_first_row_of_the_states_is_read():
    X, y = table(4, 4)
    first = X.copy()
    first.loc[[1, 2, 3, 5, 6, 7], ["q", "v"]] = np.nan
    assert_same(read_records(MODEL, first, y), read_records(MODEL, X, y))
    one, two = read_records(MODEL, X.drop(columns="v"), y)
    np.testing.assert_array_equal([one.x0, two.x0], [[X["q"][0], np.nan], [X["q"][4], np.nan]])
    for without in (X[["t", "tau", "load"]], X[["t", "tau", "load"]].to_numpy()):
        assert all(np.isnan(record.x0).all() for record in read_records(MODEL, without, y))


def test_one_output_in_any_form():
    X, y = table(4, 5)
    y = y["q_m"]
    expected = read_records(ONE_OUTPUT, X, y.to_frame())
    for form in (y, y.rename("angle"), y.to_numpy(), y.to_list(), y.to_numpy()[:, None]):
        assert_same(read_records(ONE_OUTPUT, X, form), expected)
    numbered = pd.DataFrame(y.to_numpy())
    assert_same(read_records(ONE_OUTPUT, X, numbered), expected)
    assert expected[0].y.shape == (4, 1)


def test_a_gap_in_an_output_is_kept():
    X, y = table(5)
    y.loc[1:3, "q_m"] = np.nan
    (record,) = read_records(MODEL, X, y)
    np.testing.assert_array_equal(record.y, y)


def test_a_model_without_inputs():
    model = PhysicsModel({"x": ""}, {"x": "-x"})
    (record,) = read_records(model, np.arange(5.0)[:, None], np.ones(5))
    assert record.u.shape == (5, 0)


def test_to_simulate_one_sample_is_enough():
    X, _ = table(1)
    (record,) = read_records(MODEL, X)
    assert record.t.size == 1
    assert record.y is None


def test_nothing_is_changed_and_nothing_is_shared():
    X, y = table(4, 5)
    for given_X, given_y in ((X, y), (X.to_numpy(), y.to_numpy())):
        before = given_X.copy(), given_y.copy()
        for record in read_records(MODEL, given_X, given_y):
            for values in (record.t, record.u, record.y, record.x0):
                values[:] = 0
        np.testing.assert_array_equal(given_X, before[0])
        np.testing.assert_array_equal(given_y, before[1])


@given(lengths, st.randoms(use_true_random=False))
def test_rows_come_back_in_the_order_of_the_table(lengths, random):
    X, _ = table(*lengths)
    X["trajectory"] = np.repeat(np.arange(len(lengths)), lengths)
    turns = list(X["trajectory"])
    random.shuffle(turns)
    rows = [list(np.flatnonzero(X["trajectory"] == k)) for k in range(len(lengths))]
    X = X.iloc[[rows[k].pop(0) for k in turns]]
    records = read_records(MODEL, X)
    u = np.concatenate([record.u for record in records])
    np.testing.assert_array_equal(rows_in_order(records, u), X[["tau", "load"]])


def test_split_rows():
    pieces = split_rows(np.array([0.0, 1.0, 1.0, 2.0, 0.5]))
    assert [rows.tolist() for _, rows in pieces] == [[0, 1], [2, 3], [4]]
    pieces = split_rows(np.array([0.0, 0.0, 1.0, 1.0]), ["b", "a", "b", "a"])
    assert [(name, rows.tolist()) for name, rows in pieces] == [("b", [0, 2]), ("a", [1, 3])]


# -- what is refused -------------------------------------------------------------------------------


def test_a_missing_column_lists_the_columns_and_the_remedy():
    X, y = table(4)
    message = refusal(X.drop(columns="load"), y)
    assert message == (
        "X: input 'load' is missing; the columns are t, tau, q, v. Remedy: name the column in the "
        "model's 'columns'."
    )
    assert refusal(X.drop(columns="t"), y).startswith("X: time 't' is missing; the columns are")
    assert refusal(X, y, time_column="clock").startswith(
        "X: time 'clock' is missing; the columns are t,"
    )
    model = MODEL.replace(columns={"tau": "u_force_N"})
    message = refusal(X.drop(columns="tau"), y, model)
    assert message.startswith("X: input 'tau' is missing; the columns are t, load, q, v.")


def test_a_column_twice():
    X, y = table(4)
    twice = pd.concat([X, X[["tau"]]], axis=1)
    assert refusal(twice, y).startswith("X: column 'tau' is there 2 times; expected it once.")


@pytest.mark.parametrize("column", ["t", "tau", "load"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_time_and_inputs_are_finite(column, value):
    X, y = table(4, 4)
    X.loc[5, column] = value
    message = refusal(X.assign(trajectory=[*"aaaabbbb"]), y)
    assert message == (
        f"X: column {column!r} is {value} in row 5 (trajectory 'b'); expected a finite number. "
        "Remedy: fill the gap or cut the record there."
    )
    assert "(trajectory '7'); expected" in refusal(
        X.assign(trajectory=7), y
    )  # as other errors name it
    assert f"column {column!r} is {value} in row 5" in refusal(X.to_numpy(), y)


def test_text_in_a_column_of_numbers():
    X, y = table(4)
    X = X.astype({"tau": object})
    X.loc[2, "tau"] = "off"
    assert refusal(X, y) == "X: input 'tau': expected a number, got 'off' in row 2."
    y = y.astype({"v_m": object})
    y.loc[3, "v_m"] = "broken"
    message = refusal(table(4)[0], y)
    assert message == "y: output 'v_m': expected a number, got 'broken' in row 3."


def test_complex_numbers_are_refused():
    X, y = table(4)
    assert "expected real numbers" in refusal(X.assign(tau=1j), y)


def test_time_running_backward_or_standing_inside_a_named_trajectory():
    X, y = table(4, 4)
    X["trajectory"] = [*"aaaabbbb"]
    for value in (X["t"][5], X["t"][5] - 0.5):
        X.loc[6, "t"] = value
        message = refusal(X, y)
        assert message.startswith("X: time does not increase inside trajectory 'b': ")
        assert f" s in row 5, then {value:.12g} s in row 6. Remedy: folds by Traj" in message
        assert message.endswith("; else sort the rows, or name every trajectory differently.")


def test_too_few_samples_to_fit():
    X, y = table(4, 3)
    assert refusal(X, y).startswith("X: trajectory '1' has 3 samples; expected at least 4. Remedy:")
    assert len(read_records(MODEL, X)) == 2


def test_a_trajectory_without_a_name():
    X, y = table(4, 4)
    X["trajectory"] = ["a"] * 6 + [None, None]
    assert refusal(X, y).startswith("X: column 'trajectory' is empty in row 6")


@pytest.mark.parametrize("X", [np.zeros((0, 3)), pd.DataFrame({"t": [], "tau": [], "load": []})])
def test_no_samples(X):
    assert refusal(X).startswith("X: expected samples, got none.")


def test_no_measured_output_at_all():
    X, y = table(4, 4)
    y.iloc[4:] = np.nan
    assert refusal(X, y) == "y: trajectory '1' has no measured output at all."


def test_an_infinite_output():
    X, y = table(4)
    y.loc[2, "v_m"] = -np.inf
    assert refusal(X, y) == "y: output 'v_m' is infinite in row 2."


@pytest.mark.parametrize(
    ("y", "message"),
    [
        (np.zeros((3, 2)), "y: expected shape (4, 2) (the outputs q_m, v_m), got (3, 2)."),
        (np.zeros(4), "y: expected shape (4, 2) (the outputs q_m, v_m), got (4, 1)."),
        (
            pd.DataFrame({"v_m": np.zeros(4), "position": np.zeros(4)}),
            "y: output 'q_m' is missing; the columns are v_m, position.",
        ),
        (
            pd.DataFrame({"q_m": np.zeros(4)}),
            "y: output 'v_m' is missing; the columns are q_m.",
        ),
    ],
)
def test_other_outputs(y, message):
    assert refusal(table(4)[0], y).startswith(message)


@pytest.mark.parametrize(
    ("X", "options", "message"),
    [
        (np.zeros(5), {}, "X: expected shape (n_samples, n_columns), got (5,)."),
        (
            np.zeros((5, 4)),
            {},
            "X: expected the columns time, tau, load, q, v (the states may be left out), got 4 col",
        ),
        (
            np.zeros((5, 3)),
            {"time_column": 3},
            "time_column: expected a column number from 0 to 2, got 3.",
        ),
        (
            np.zeros((5, 3)),
            {"time_column": "s"},
            "time_column: expected a column number from 0 to 2, got 's'.",
        ),
    ],
)
def test_other_tables(X, options, message):
    assert refusal(X, **options).startswith(message)
