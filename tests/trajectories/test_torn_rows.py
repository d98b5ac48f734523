"""Rows drawn one by one from records are refused; honest clocks of every kind are not."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from sklearn.model_selection import KFold, ShuffleSplit, TimeSeriesSplit, train_test_split
from sklearn.utils import resample

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.trajectories import read_files, read_records

pytestmark = pytest.mark.core

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
SEEDS = st.integers(0, 2**32 - 1)


def records(n_records, n_samples, interval, jitter, seed, *, named):
    """Return records on an even clock that jitters by a share of the interval."""
    rng = np.random.default_rng(seed)
    place = np.tile(np.arange(n_samples), n_records)
    t = interval * (place + jitter * rng.uniform(-0.5, 0.5, place.size))
    X = pd.DataFrame({"t": t, "u": np.sin(place)})
    if named:
        X["trajectory"] = np.repeat(np.arange(n_records), n_samples)
    return X


def drawn(way, X, seed):
    """Return the two sides of a split of single rows, or what a tool that draws rows leaves."""
    if way in (2, 3, 4, 5):
        return [X.iloc[r] for r in next(KFold(way, shuffle=True, random_state=seed).split(X))]
    if way == "shuffled split":
        return [X.iloc[r] for r in next(ShuffleSplit(1, random_state=seed).split(X))]
    if way == "train_test_split":
        return train_test_split(X, random_state=seed)
    if way == "reversed":
        return [X.iloc[::-1]]
    if way == "permuted time":
        return [X.assign(t=np.random.default_rng(seed).permutation(X["t"]))]
    return [resample(X, random_state=seed), resample(X, random_state=seed).sort_index()]


WAYS = [2, 3, 4, 5, "shuffled split", "train_test_split", "reversed", "permuted time", "bootstrap"]


@settings(max_examples=60)
@given(
    way=st.sampled_from(WAYS),
    n_records=st.integers(1, 6),
    n_samples=st.integers(300, 1500),
    interval=st.floats(1e-4, 1e3),
    jitter=st.sampled_from([0.0, 0.01, 0.1]),
    named=st.booleans(),
    seed=SEEDS,
)
def test_single_rows_are_refused_with_the_remedy(
    way, n_records, n_samples, interval, jitter, named, seed
):
    X = records(n_records, n_samples, interval, jitter, seed, named=named)
    for side in drawn(way, X, seed):
        with pytest.raises(RecordError, match="folds by TrajectoryKFold, a split by train_valid"):
            read_records(LAG, side)


def honest(kind, n, rng):
    """Return the times of an honest record, in sample intervals."""
    even = np.arange(float(n))
    if kind == "lost samples":
        return even[rng.random(n) > 0.08]
    if kind == "bursts of lost samples":
        lost = (rng.integers(0, n, n // 60)[:, None] + np.arange(15)).ravel() % n
        return np.delete(even, lost)
    if kind == "a gap":
        return np.delete(even, np.arange(n // 3, n // 2))
    if kind == "uneven steps":
        return np.cumsum(rng.uniform(0.5, 1.5, n))
    if kind == "random times":
        return np.sort(rng.uniform(0, n, n))
    if kind == "two clocks":
        return np.unique(np.concatenate([2 * even, 5 * even]))
    if kind == "now and then a message late":
        return np.cumsum(rng.choice([1.0, 1.0, 1.0, 2.0], n))
    if kind == "sent on change":
        x = np.sin(0.02 * np.arange(4 * n)) + 0.3 * np.sin(0.07 * np.arange(4 * n))
        return np.flatnonzero(np.diff(np.floor(x / 0.05), prepend=np.nan) != 0).astype(float)
    if kind == "a cycler's events":
        return relaxing(4 * n, rng)
    return even[:: rng.integers(1, 9)]


def relaxing(n, rng):
    """Return when a cycler logs a cell's voltage: as the current steps, by change, or by time."""
    step, share = rng.integers(200, 400), rng.uniform(0.2, 0.8)
    current = np.repeat(rng.choice([-2.0, 0.0, 1.5, 3.0, 5.0], n // step + 1), step)[:n]
    slow = lfilter([1 / 40], [1, 1 / 40 - 1], current)
    voltage = share * slow + 0.1 * current + 1e-3 * np.cumsum(current) / 4
    logged = [0]
    for k in range(1, n):
        last = logged[-1]
        moved = abs(voltage[k] - voltage[last]) > 0.1
        if moved or current[k] != current[k - 1] or k - last >= 60:
            logged.append(k)
    return np.array(logged, dtype=float)


HONEST = [
    "lost samples", "bursts of lost samples", "a gap", "uneven steps", "random times", "two clocks",
    "sent on change", "a cycler's events", "every n-th sample", "now and then a message late",
]  # fmt: skip


@settings(max_examples=100)
@given(
    kind=st.sampled_from(HONEST),
    n=st.integers(200, 2000),
    interval=st.floats(1e-4, 1e3),
    seed=SEEDS,
)
def test_honest_clocks_are_read(kind, n, interval, seed):
    t = interval * honest(kind, n, np.random.default_rng(seed))
    assert len(read_records(LAG, pd.DataFrame({"t": t, "u": 1.0}))) == 1


def test_a_cyclers_clock_is_never_taken_for_rows_drawn_at_random():
    """Its steps are as long as random ones, here and there, but resemble the ones before."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        t = relaxing(4 * int(rng.integers(200, 2000)), rng)
        assert len(read_records(LAG, pd.DataFrame({"t": t, "u": 1.0}))) == 1


@pytest.mark.parametrize("splitter", [KFold(5), TimeSeriesSplit(5)])
def test_folds_of_whole_blocks_are_read(splitter):
    X = records(4, 100, 0.01, 0.0, 0, named=True)
    for sides in splitter.split(X):
        for rows in sides:
            assert read_records(LAG, X.iloc[rows])


@pytest.mark.parametrize(
    "t",
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],  # states of many trajectories at their beginning
        [0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 0.5],  # single steps along a record
        [0.0, 0.1, 0.0, 0.1, 0.2, 0.0, 0.1, 0.0, 0.1],
        [3.0, 1.0, 2.0],
    ],
)
def test_short_trajectories_are_read(t):
    assert read_records(LAG, np.column_stack([t, np.ones(len(t))]))


def test_times_as_dates_are_looked_at_too():
    X = records(1, 300, 1.0, 0.0, 0, named=False)
    X["t"] = pd.to_datetime("2026-01-31") + pd.to_timedelta(X["t"], unit="s")
    assert read_records(LAG, X)
    with pytest.raises(RecordError, match="49 % of the rows are missing, one by one and at rand"):
        read_records(LAG, drawn(2, X, 0)[0])


def test_a_whole_file_is_read_with_the_rows_its_logger_lost_and_its_fold_is_refused(tmp_path):
    rng = np.random.default_rng(5)
    for name in ("one", "two"):
        t = np.flatnonzero(rng.random(500) > 0.2).astype(float)
        table = pd.DataFrame({"t": t, "u": 1.0, "y": np.sin(t)})
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    for paths in (["one.csv"], ["one.csv", "two.csv"]):
        X, y = read_files([tmp_path / path for path in paths], LAG)
        assert len(read_records(LAG, X, y)) == len(paths)
        for side in next(KFold(4, shuffle=True, random_state=0).split(X)):
            with pytest.raises(RecordError, match="folds by TrajectoryKFold"):
                read_records(LAG, X.iloc[side], y.iloc[side])
