"""Records as one table, and the groups of alike samples that are hidden in it."""

import sys

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.grey_box.folds import operating_ranges
from sklearn_pgnn.grey_box.tables import plain_table
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES
from sklearn_pgnn.trajectories.record import Record


def record(y, u=None, interval=0.1):
    """Return a trajectory with one output, and an input that follows it."""
    y, t = np.array(y, dtype=float), interval * np.arange(len(y))
    u = 2 * y if u is None else u
    return Record(t, u[:, None], y[:, None], np.zeros(1), "some", np.arange(len(y)))


RAMP = np.linspace(0.0, 1.0, 90)


def test_every_range_but_the_most_central_one_is_hidden_once():
    masks = operating_ranges((record(RAMP),), 2)
    below, above = sorted(masks, key=lambda mask: int(np.argmax(mask)))
    assert below[MIN_SAMPLES:20].all()
    assert above[-20:].all()
    assert not (below & above).any()
    assert not (below | above)[40:50].any()


def test_ranges_go_through_all_trajectories():
    masks = operating_ranges((record(RAMP), record(RAMP)), 3)
    assert all(mask.shape == (180,) for mask in masks)
    assert all(np.array_equal(mask[:90], mask[90:]) for mask in masks)


def test_a_trajectory_begins_visible():
    hidden = np.any(operating_ranges((record(RAMP), record(RAMP)), 2), axis=0)
    assert not hidden[:MIN_SAMPLES].any()
    assert not hidden[90 : 90 + MIN_SAMPLES].any()


def test_what_was_not_measured_is_in_no_range():
    y = RAMP.copy()
    y[[10, 80]] = np.nan
    hidden = np.any(operating_ranges((record(y, 2 * RAMP),), 2), axis=0)
    assert not hidden[[10, 80]].any()
    assert hidden[[20, 70]].all()


@pytest.mark.parametrize("noise", [0.0, 1e-12])
def test_units_do_not_count_nor_does_what_is_constant(noise):
    rng = np.random.default_rng(0)
    still = 5.0 + noise * rng.normal(size=90)
    masks = operating_ranges((record(RAMP**3, still),), 2)
    others = operating_ranges((record(1e-3 * RAMP**3, 1e3 * still, interval=10.0),), 2)
    assert np.array_equal(masks, others)


def test_a_change_is_seen_through_noise():
    t = 2 * np.pi * np.arange(2000) / 500
    y = np.sin(t) + 0.5 * np.sin(2 * t + 1)
    noisy = y + 0.01 * np.random.default_rng(0).normal(size=2000)  # a sample's change is as large
    masks, others = (operating_ranges((record(each, 0 * y),), 3) for each in (y, noisy))
    assert np.mean(np.any(masks, axis=0) == np.any(others, axis=0)) > 0.9


def test_too_few_different_samples_are_refused():
    with pytest.raises(ValueError, match=r"more distinct measured samples.*Remedy: lower n_splits"):
        operating_ranges((record(np.ones(50)),), 3)


def test_joblib_sees_that_a_table_holds_records():
    lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    t = np.arange(500) * 0.1
    table = plain_table(lag, read_records(lag, np.column_stack([t, np.sin(t)]), np.cos(t)))
    assert sys.getsizeof(table) > 3 * t.nbytes  # time, input and output
    sizeof = pytest.importorskip("dask.sizeof").sizeof
    assert sizeof(table) > 1e3  # what joblib sends to a cluster once is larger
