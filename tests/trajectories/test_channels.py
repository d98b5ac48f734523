"""Channels with clocks of their own become rows without inventing measurements."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.trajectories.channels import Channel, join_channels

pytestmark = pytest.mark.core

FAST = np.arange(0.0, 1.0, 0.01)
SLOW = np.arange(0.003, 0.95, 0.025)


def wave(t):
    return Channel(t, np.sin(7 * t))


def join(inputs, outputs, hold="zoh", sample_time=None, states=None):
    return join_channels(
        "run.mf4", inputs, states or {}, outputs, hold=hold, sample_time=sample_time
    )


def test_channels_of_one_clock_are_used_as_they_are():
    table = join({"u": wave(FAST)}, {"y": wave(FAST)})
    assert np.array_equal(table["t"], FAST)
    assert np.array_equal(table["u"], np.sin(7 * FAST))
    assert np.array_equal(table["y"], np.sin(7 * FAST))


def test_clocks_that_differ_by_a_rounding_error_are_one():
    table = join({"u": wave(FAST)}, {"y": wave(FAST), "z": wave(FAST * (1 + 1e-12))})
    assert len(table) == FAST.size
    assert not table.isna().any(axis=None)
    assert np.array_equal(table["u"], np.sin(7 * FAST))


def test_every_measured_value_stands_at_its_own_time_and_no_other_does():
    with pytest.warns(RecordWarning, match="different time stamps"):
        table = join({"u": wave(FAST)}, {"y": wave(FAST), "z": wave(SLOW)})
    for title, clock in (("y", FAST), ("z", SLOW)):
        seen = table[table[title].notna()]
        assert np.array_equal(seen["t"], clock)
        assert np.array_equal(seen[title], np.sin(7 * clock))


def test_a_held_input_moves_the_states_as_far_as_it_did():
    """The mean over a row has the integral of the input, however fast that changes."""
    rng = np.random.default_rng(0)
    u = Channel(np.sort(rng.uniform(0, 1, 200)), rng.normal(size=200))
    y = Channel(SLOW[(u.t[0] < SLOW) & (u.t[-1] > SLOW)], None)
    table = join({"u": u}, {"y": y._replace(values=np.zeros(y.t.size))})
    fine = np.linspace(table["t"].iloc[0], table["t"].iloc[-1], 200_001)
    held = u.values[np.searchsorted(u.t, fine, side="right") - 1]
    area = np.sum(held[:-1]) * (fine[1] - fine[0])
    assert np.sum(table["u"][:-1] * np.diff(table["t"])) == pytest.approx(area, abs=1e-3)


def test_a_shifted_clock_gives_the_machine_s_own_motion():
    lag = PhysicsModel({"x": "m"}, {"x": "(u - x)/T"}, {"T": 0.1}, {"u": "m"})
    clock = np.arange(0.0, 4.0, 0.01)
    u = np.repeat(np.random.default_rng(1).normal(size=100), 4)
    x = lag.simulate(clock, u, substeps=4).y[:, 0]
    shifted = Channel(clock[4:] + 0.007, np.zeros(clock.size - 4))
    shifted = shifted._replace(t=shifted.t[:-1], values=np.interp(shifted.t[:-1], clock, x))
    table = join({"u": Channel(clock, u)}, {"y": shifted})
    t, first = table["t"] - table["t"][0], [table["y"][0]]
    late = u[np.searchsorted(clock, table["t"], side="right") - 1]
    error, held = (lag.simulate(t, each, first).y[:, 0] - table["y"] for each in (table["u"], late))
    assert np.std(error) < 0.2 * np.std(held)


@pytest.mark.parametrize(("hold", "value"), [("zoh", 0.5), ("foh", 0.5)])
def test_an_input_runs_as_the_model_holds_it(hold, value):
    u = Channel(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 2.0]))
    y = Channel(np.array([0.5, 1.5]), np.array([7.0, 8.0]))
    assert join({"u": u}, {"y": y}, hold)["u"].tolist()[0] == value


def test_a_sample_time_resamples_all():
    with pytest.warns(RecordWarning, match="'y': 8% of the samples are left out"):
        table = join({"u": wave(SLOW)}, {"y": wave(FAST), "z": wave(SLOW)}, "foh", 0.02)
    assert np.allclose(np.diff(table["t"]), 0.02)
    assert table["t"].iloc[0] == SLOW[0]
    assert table["t"].iloc[-1] <= SLOW[-1] + 1e-12
    for title in "uyz":
        assert np.allclose(table[title], np.sin(7 * table["t"]), atol=0.005)


def test_nothing_is_made_up_in_a_gap():
    y = wave(np.concatenate([FAST[:40], FAST[60:]]))
    seen = join({"u": wave(FAST)}, {"y": y}, sample_time=0.005).set_index("t")["y"].notna()
    assert seen[:0.39].all()
    assert not seen[0.396:0.599].any()
    assert seen[0.601:].all()


def test_rows_are_only_where_all_inputs_are_and_what_is_left_out_is_told():
    u = Channel(np.array([0.4, 0.6]), np.array([1.0, 2.0]))
    with pytest.warns(RecordWarning, match=r"'y': 79% of the samples are left out.*0.4 s to 0.6 s"):
        table = join({"u": u}, {"y": wave(FAST)})
    assert (table["t"].min(), table["t"].max()) == (pytest.approx(0.4), pytest.approx(0.6))


def test_a_state_is_known_between_its_samples_and_nowhere_else():
    table = join({"u": wave(FAST)}, {"y": wave(FAST)}, states={"v": wave(SLOW)})
    inside = (SLOW[0] <= FAST) & (SLOW[-1] >= FAST)
    assert np.array_equal(table["v"].notna(), inside)


def test_without_inputs_rows_are_wherever_an_output_is():
    with pytest.warns(RecordWarning, match="different time stamps"):
        table = join({}, {"y": wave(FAST), "z": wave(SLOW + 5.0)})
    assert len(table) == FAST.size + SLOW.size


def test_channels_that_never_meet_are_refused():
    late = FAST + 5.0
    with pytest.raises(RecordError, match=r"'y': expected samples between 0 s and 0.99 s"):
        join({"u": wave(FAST)}, {"y": wave(late)})
    with pytest.raises(RecordError, match=r"'v' begins at 5 s, when 'u' has ended at 0.99 s"):
        join({"u": wave(FAST), "v": wave(late)}, {"y": wave(FAST)}, sample_time=0.1)


def test_a_channel_without_samples_or_with_a_broken_clock_is_refused():
    with pytest.raises(RecordError, match=r"channel 'y': expected samples, got none"):
        join({"u": wave(FAST)}, {"y": Channel(np.zeros(0), np.zeros(0))})
    back = Channel(np.array([0.0, 0.5, 0.4]), np.zeros(3))
    with pytest.raises(RecordError, match=r"channel 'y': expected time to increase, got 0.4 s af"):
        join({"u": wave(FAST)}, {"y": back})


def test_of_two_samples_of_a_channel_at_one_time_the_later_holds():
    t = np.sort([*FAST, FAST[7]])
    values = np.arange(t.size, dtype=float)
    with pytest.warns(RecordWarning, match=r"'u': 1 samples have the time of the next one"):
        table = join({"u": Channel(t, values)}, {"y": wave(FAST)})
    np.testing.assert_array_equal(table["u"], np.delete(values, 7))
