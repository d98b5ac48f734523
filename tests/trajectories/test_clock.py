"""Clocks of files: steps of simulations, repeated rows, counters, coarse stamps, other units."""

import warnings
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sklearn_pgnn.exceptions import OptionError, RecordError, RecordWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories import read_file
from sklearn_pgnn.trajectories.clock import backward, check_sample_interval, counted_on, other_unit

pytestmark = pytest.mark.core

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 0.5}, {"u": "V"})


def record(rows=120, step=0.02):
    t = step * np.arange(rows)
    return pd.DataFrame({"t": t, "u": np.sign(np.sin(3 * t + 0.1)), "y": np.cos(t)})


def read(folder, table, name="run.csv", **options):
    table.to_csv(folder / name, index=False)
    return read_file(folder / name, LAG, **options)


def refusal(folder, table, **options):
    with pytest.raises(RecordError) as caught:
        read(folder, table, **options)
    return str(caught.value)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(1, 118), min_size=1, max_size=12, unique=True), st.randoms())
def test_the_later_of_two_rows_at_one_time_holds(tmp_path_factory, places, random):
    table = record()
    before = table.iloc[places].assign(u=[random.uniform(-9, 9) for _ in places])
    written = pd.concat([before, table]).sort_values("t", kind="stable")
    with pytest.warns(RecordWarning, match=rf"{len(places)} rows have the time of the next one"):
        X, y = read(tmp_path_factory.mktemp("steps"), written)
    np.testing.assert_array_equal(X[["t", "u"]], table[["t", "u"]])
    np.testing.assert_array_equal(y["y"], table["y"])


def test_a_repeated_row_is_left_out_with_its_line(tmp_path):
    table = record()
    twice = table.loc[[*range(40), 39, *range(40, 80), 79, 79, *range(80, 120)]]
    with pytest.warns(RecordWarning, match=r"run.csv:42: column 't': 3 rows repeat the one before"):
        X, _ = read(tmp_path, twice)
    np.testing.assert_array_equal(X["t"], table["t"])


@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("unit", ["ms", "us"])
def test_a_counter_is_counted_on(tmp_path, bits, unit):
    table, ticks = record(), {"ms": 20, "us": 20_000}[unit]
    count = (2**bits - 50 * ticks + 7 + ticks * np.arange(120)) % 2**bits
    if 2**bits < 8 * ticks:
        pytest.skip("no counter is so small")
    with pytest.warns(RecordWarning, match=rf"the clock goes back by {2**bits}, its counter's"):
        X, _ = read(tmp_path, table.assign(t=count).rename(columns={"t": f"t [{unit}]"}))
    np.testing.assert_allclose(X["t"] - X["t"][0], table["t"], atol=1e-9)


def test_records_of_a_counters_length_are_no_counter():
    t = np.tile(np.arange(0.0, 65_536.0, 64.0), 2)
    assert counted_on(t, 1e3)[1] == 0
    assert "another record" in backward(t).why


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["2026-10-25 02:59:58", "2026-10-25 02:59:59", "2026-10-25 02:00:00"], [0, 1, 2]),
        (["1/31/2026 12:59:58", "1/31/2026 12:59:59", "1/31/2026 01:00:00"], [0, 1, 2]),
    ],
)
def test_local_time_in_autumn_and_a_clock_without_pm_are_counted_on(tmp_path, stamps, seconds):
    after = [stamps[2][:-2] + f"{k:02d}" for k in (1, 2, 3)]
    with pytest.warns(RecordWarning, match="as local time in autumn, or without AM and PM"):
        X, _ = read(tmp_path, record(6).assign(t=[*stamps, *after]))
    assert X["t"].tolist() == [*seconds, 3, 4, 5]


@pytest.mark.parametrize(
    ("clock", "said"),
    [
        (lambda t: np.floor(t), "the stamps are too coarse. Remedy: log finer stamps, or give the "
         "sample interval: sample_time=0.01 [s] (--sample-time), which overrides the column."),
        (lambda t: t[::-1], "the rows run backward in time. Remedy: sort the rows by time."),
        (lambda t: np.where(t == t[30], t[29] - 0.01, t), "out of order. Remedy: sort the rows"),
        (lambda t: np.where(t < 1, t, t - t[50]), "the clock begins again, so this is another "
         "record. Remedy: split the file there, or name each record in a column 'trajectory'."),
        (lambda t: np.where(t < 1, t + 50, t), "the clock goes back. Remedy: sort the rows by time"
         ", or if another record begins there: split the file there"),
    ],
)  # fmt: skip
def test_a_clock_that_does_not_increase_has_a_remedy_that_fits(tmp_path, clock, said):
    table = record()
    assert said in refusal(tmp_path, table.assign(t=clock(table["t"].to_numpy())))


def test_a_sample_time_overrides_coarse_stamps_but_no_disorder(tmp_path):
    table = record()
    coarse = table.assign(t=np.float32(1.7e9 + table["t"].to_numpy()).astype(float))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        X, _ = read(tmp_path, coarse, sample_time=0.02)
    np.testing.assert_allclose(X["t"], table["t"], atol=1e-12)
    for order in (slice(None, None, -1), [*range(60), *range(50, 120)]):
        assert "Remedy: " in refusal(tmp_path, table.iloc[order], sample_time=0.02)
    with pytest.warns(RecordWarning, match=r"takes 1.19 s, by the column 't', which it .* 2.38 s"):
        read(tmp_path, table, sample_time=0.01)


@settings(max_examples=100, deadline=None)
@given(st.sampled_from([1e-3, 0.002, 0.01, 0.02, 0.05, 0.1, 0.5, 1.0, 1 / 30, 1 / 60]),
       st.floats(30_000, 60_000), st.integers(8, 11))  # fmt: skip
def test_days_of_a_spreadsheet_are_told_from_seconds(step, begin, digits):
    k = np.arange(200)
    days = np.round(begin + step * k / 86_400, digits)
    assert other_unit(np.round(begin + step * k, 6)) == ""
    if np.all(np.diff(days) > 0) and 10.0**-digits * 86_400 < step:
        assert other_unit(days) == "d"


@pytest.mark.parametrize(("unit", "size"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_clock_since_1970_in_another_unit_is_refused_with_the_unit(tmp_path, unit, size):
    table = record()
    count = (1_780_000_000 * int(size) + np.round(size * table["t"]).astype("int64")).tolist()
    assert f'columns: {{t: "t [{unit}]"}}' in refusal(tmp_path, table.assign(t=count))
    X, _ = read(tmp_path, table.assign(t=count).rename(columns={"t": f"t [{unit}]"}))
    np.testing.assert_allclose(X["t"] - X["t"][0], table["t"], atol=1e-9 if unit == "ns" else 1e-6)


# -- a sample interval is a finite time above 0, whoever asks for it -------------------------------


@pytest.mark.parametrize("value", [0.01, 1, np.float32(0.5), np.int64(2), Fraction(1, 3)])
def test_a_finite_time_above_zero_passes(value):
    check_sample_interval(value)


@pytest.mark.parametrize("value", [0, -0.1, np.nan, np.inf, "0.1", True, None, [0.1]])
def test_anything_else_is_refused_by_the_name_of_the_option(value):
    with pytest.raises(OptionError, match=r"^sample_time: expected .* seconds.* got .* Remedy: x$"):
        check_sample_interval(value, "sample_time", "Remedy: x")
