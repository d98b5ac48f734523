"""A record is the same whatever its clock shows: verdict and numbers do not depend on it."""

import warnings

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, PhysicsModelRegressor, effects
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.record_quality.clock import find_gaps
from sklearn_pgnn.simulation.record_windows import without_gaps
from sklearn_pgnn.systems import cart_on_spring
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.record import split_at_gaps

#: a time stamp of 2023 [s]; a float tells times apart to a quarter of a microsecond there
STAMP = 1.7e9
CATALOGUE = (effects.CubicStiffness, effects.CoulombFriction, effects.ParameterDrift)


@pytest.fixture(scope="module")
def cart():
    """Records of a cart whose spring hardens, and the prior that knows nothing of it."""
    hidden = make_hidden_effect(
        cart_on_spring(), "cubic_stiffness", n_records=4, sample_rate=100.0, random_state=7
    )
    return hidden.prior, hidden.X.drop(columns=["x", "v"]), hidden.y


def as_given(X, y):
    return X, y


def absolute(X, y):
    return X.assign(t=X["t"] + STAMP), y


def absolute_and_apart(X, y):
    return X.assign(t=X["t"] + STAMP + 1234.567 * pd.factorize(X["trajectory"])[0]), y


def paused(X, y):
    """Let the clock of the second record run on for 10 s while nothing moves or is recorded."""
    second = pd.factorize(X["trajectory"])[0] == 1
    return X.assign(t=X["t"] + 10.0 * (second & (X["t"] > 4.0))), y


def diagnose(prior, X, y):
    return ModelDiagnosis(prior, catalogue=CATALOGUE).fit(X, y)


@pytest.fixture(scope="module")
def plain(cart):
    return diagnose(*cart)


def assert_same_diagnosis(found, expected, rtol):
    assert found.verdict_ == expected.verdict_ == "cause_named"
    assert [(c.effect, c.target) for c in found.causes_] == [("cubic_stiffness", "v")]
    assert found.window_ == pytest.approx(expected.window_, rel=rtol)
    assert (found.substeps_, found.hold_) == (expected.substeps_, expected.hold_)
    for name, parameter in expected.extended_model_.parameters.items():
        value = found.extended_model_.parameters[name].value
        assert value == pytest.approx(parameter.value, rel=rtol), name
    for one, other in zip(found.gain_.values(), expected.gain_.values(), strict=True):
        assert one.extended == pytest.approx(other.extended, rel=rtol)


@pytest.mark.slow
@pytest.mark.parametrize("clock", [absolute, absolute_and_apart])
def test_time_stamps_leave_a_diagnosis_as_it_is(cart, plain, clock):
    prior, X, y = cart
    assert_same_diagnosis(diagnose(prior, *clock(X, y)), plain, rtol=1e-5)


@pytest.mark.slow
def test_a_gap_leaves_a_diagnosis_as_it_is(cart, plain):
    prior, X, y = cart
    found = diagnose(prior, *paused(X, y))
    assert_same_diagnosis(found, plain, rtol=5e-3)  # windows are cut elsewhere
    (finding,) = found.data_quality_
    assert finding.kind == "dropped samples"
    assert "1000 samples are missing from a clock of 0.01 s" in finding.text


@pytest.mark.parametrize("clock", [as_given, absolute, absolute_and_apart, paused])
def test_clocks_and_gaps_leave_a_fit_as_it_is(cart, clock):
    prior, X, y = cart
    whole = prior + effects.CubicStiffness("v", 20.0)
    fits = [PhysicsModelRegressor(whole).fit(*change(X, y)) for change in (as_given, clock)]
    for name, expected in fits[0].parameters_.items():
        error = (expected.high - expected.low) / 4  # windows begin elsewhere behind a gap
        assert fits[1].parameters_[name].value == pytest.approx(expected.value, abs=error), name
    for expected, found in zip(fits[0].initial_states_, fits[1].initial_states_, strict=True):
        np.testing.assert_allclose(found, expected, atol=2e-3)


def every_second(X, y):
    """Sample the last two records half as fast."""
    kept = (pd.factorize(X["trajectory"])[0] < 2) | (np.arange(len(X)) % 2 == 0)
    return X[kept], y[kept]


def at_random(X, y):
    """Keep 9 of 10 samples, but the first of every record."""
    kept = (np.random.default_rng(0).uniform(size=len(X)) < 0.9) | (X["t"] == 0)
    return X[kept], y[kept]


@pytest.mark.parametrize("sampled", [every_second, at_random, paused, absolute_and_apart])
def test_the_scales_of_signals_do_not_depend_on_how_they_are_sampled(cart, sampled):
    prior, X, y = cart
    expected = build_problem(prior, read_records(prior, X, y)).scales
    found = build_problem(prior, without_gaps(read_records(prior, *sampled(X, y)))).scales
    for state, rate in expected.rate.items():
        assert found.rate[state] == pytest.approx(rate, rel=0.02), state
    assert found.duration == pytest.approx(expected.duration, rel=0.01)
    pause = 10.0 if sampled is paused else 0.0
    assert found.latest == pytest.approx(expected.latest + pause, rel=0.01)


@pytest.mark.slow
def test_files_of_different_sample_times_are_diagnosed_like_others(cart, plain):
    prior, X, y = cart
    found = diagnose(prior, *every_second(X, y))
    assert found.verdict_ == plain.verdict_
    assert [(c.effect, c.target) for c in found.causes_] == [("cubic_stiffness", "v")]
    assert not [f for f in found.data_quality_ if f.kind == "dropped samples"]


def test_each_record_has_a_clock_of_its_own():
    clocks = [np.arange(300) * 0.002, np.arange(300) * 0.003]
    assert find_gaps(clocks, ["a", "b"]) is None
    assert find_gaps([clocks[0], np.delete(clocks[1], [7, 8, 9])], ["a", "b"]).value == 3


@pytest.mark.slow
def test_a_change_in_time_is_found_on_time_stamps_with_a_warning_of_what_its_time_is():
    hidden = make_hidden_effect(
        cart_on_spring(),
        effects.ParameterDrift("k", rate=0.1),
        n_records=4,
        sample_rate=100.0,
        random_state=7,
    )
    X = hidden.X.drop(columns=["x", "v"])
    told = pytest.warns(
        RecordWarning, match=r"at 17000\d+ s. Remedy: subtract each trajectory's first time"
    )
    with told as warned:
        found = diagnose(hidden.prior, *absolute_and_apart(X, hidden.y))
    assert {each.filename for each in warned} == {__file__}
    assert [(c.effect, c.target) for c in found.causes_] == [("parameter_drift", "k")]
    assert found.extended_model_.parameters["drift_k"].value == pytest.approx(0.1, rel=0.05)
    assert np.isfinite(found.predict(absolute(X, hidden.y)[0])).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        diagnose(hidden.prior, X, hidden.y)


def test_a_model_with_the_time_in_its_equations_takes_the_time_as_it_is_given():
    driven = PhysicsModel({"y": "V"}, {"y": "(sin(t) - y)/T"}, {"T": 2.0})
    lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    assert not driven.is_autonomous
    assert lag.is_autonomous
    X = pd.DataFrame({"t": [5.0, 5.5, 6.0, 2.0, 2.5]})
    assert [r.t.tolist() for r in read_records(driven, X)] == [[5.0, 5.5, 6.0], [2.0, 2.5]]
    assert [r.t.tolist() for r in read_records(lag, X)] == [[0.0, 0.5, 1.0], [0.0, 0.5]]
    assert [r.origin for r in read_records(lag, X)] == [5.0, 2.0]


def test_what_lies_behind_a_gap_is_a_record_of_its_own():
    lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    t = np.concatenate([np.arange(50) * 0.1, 100 + np.arange(60) * 0.1, [300.0, 300.1]])
    X = pd.DataFrame({"t": t, "u": np.arange(t.size), "y": 0.5})
    (record,) = read_records(lag, X, np.sin(t))
    first, second = split_at_gaps((record,), longest=3.0, samples=20)
    assert (first.name, second.name) == ("0", "0 from 100 s")
    assert (first.t.size, second.t.size) == (50, 60)
    assert first.x0.tolist() == [0.5]
    assert np.isnan(second.x0).all()
    np.testing.assert_array_equal(second.rows, np.arange(50, 110))
    np.testing.assert_array_equal(second.t, record.t[50:110])
    # a step that a window bridges, or that 20 of the record's own would, is no gap
    assert split_at_gaps((record,), longest=300.0, samples=20) == (record,)
    (joined,) = split_at_gaps((record,), longest=3.0, samples=1000)
    assert joined.t.size == 110


def cycled(log):
    """Charge and rest a cell of 20 mOhm, with an RC branch of 15 mOhm and 90 s.

    Every change of the current is logged, and else as often as `log` says of a pulse and a rest.
    """
    current = np.tile(np.repeat([2.0, 0.0, -2.0, 0.0], [40, 900, 40, 900]), 2)  # every second
    t, branch, v = np.arange(current.size, dtype=float), 0.0, []
    for now in current:
        v.append(0.02 * now + branch)
        branch += (0.015 * now - branch) * -np.expm1(-1 / 90.0)
    new = np.flatnonzero(np.diff(current, prepend=np.nan))
    ends = [*new[1:], t.size]
    rows = [np.arange(a, b, log[int(current[a] == 0)]) for a, b in zip(new, ends, strict=True)]
    kept = np.unique(np.concatenate([*rows, new[1:] - 1]))
    y = np.array(v)[kept] + 1e-4 * np.random.default_rng(0).normal(size=kept.size)
    return pd.DataFrame({"t": t[kept], "I": current[kept]}), y


def test_a_rest_that_is_logged_slowly_is_no_gap():
    branch = PhysicsModel(
        {"b": "V"},
        {"b": "(R*I - b)/T"},
        {"R": {"value": 0.02, "spread": 1.0}, "T": {"value": 60.0, "spread": 1.0}},
        {"I": "A"},
        outputs={"V": "b + 0.02*I"},
    )
    X, y = cycled(log=(1, 60))
    (record,) = read_records(branch, X, y)
    assert split_at_gaps((record,), longest=10.0, samples=20) == (record,)
    found = PhysicsModelRegressor(branch).fit(X, y).parameters_
    assert found["T"].value == pytest.approx(90.0, rel=0.1)
    assert found["R"].value == pytest.approx(0.015, rel=0.1)


def test_where_an_input_has_changed_behind_a_long_interval_it_is_a_gap():
    t = np.array([0.0, 1.0, 2.0, 3.0, 63.0, 123.0, 124.0, 125.0, 126.0, 186.0, 187.0, 188.0, 189.0])
    held, moved = np.zeros(t.size), np.where(t > 150.0, 1.0, 0.0)
    model = PhysicsModel({"y": "V"}, {"y": "u + w - y"}, {}, {"u": "V", "w": "V"})
    X = pd.DataFrame({"t": t, "u": held, "w": moved})
    pieces = split_at_gaps(read_records(model, X, np.sin(t)), longest=10.0, samples=20)
    assert [piece.t.size for piece in pieces] == [9, 4]
    alone = PhysicsModel({"y": "V"}, {"y": "-y"})
    pieces = split_at_gaps(read_records(alone, X[["t"]], np.sin(t)), longest=10.0, samples=20)
    assert [piece.t.size for piece in pieces] == [4, 4, 4]
