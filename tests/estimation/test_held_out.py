"""Held out means held out: windows enough to learn from, of the length that was asked for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, PhysicsModelRegressor, effects
from sklearn_pgnn.diagnosis.result import measure_gain
from sklearn_pgnn.estimation.budgets import FOLDS
from sklearn_pgnn.estimation.held_out import MOST_HELD_OUT, make_folds
from sklearn_pgnn.estimation.problem import build_problem, longer
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.estimation.window_selection import select_windows
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, MIN_WINDOWS, median_window_length
from sklearn_pgnn.trajectories import read_records

CART = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}, inertia={"v": "m"}
)
STEP = 0.02


def drive(sizes, steps=None, cart=CART, noise=1e-3):
    """Simulate records of so many samples; give X and y."""
    rng, X, y = np.random.default_rng(0), [], []
    for i, size in enumerate(sizes):
        t = np.arange(size) * (STEP if steps is None else steps[i])
        force = 2 * np.sin(0.7 * t + i) + np.sin(1.9 * t)
        X.append(pd.DataFrame({"trajectory": i, "t": t, "F": force}))
        y.append(cart.simulate(t, force, substeps=5).y[:, 0] + noise * rng.normal(size=size))
    return pd.concat(X, ignore_index=True), np.concatenate(y)


def problem_of(sizes, steps=None, **options):
    X, y = drive(sizes, steps)
    return build_problem(CART, read_records(CART, X, y), **options)


# -- enough windows --------------------------------------------------------------------------------


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize(
    "sizes", [(160,), (600,), (3000,), (80, 80), (500, 500), (1000, 90), (200,) * 3, (300,) * 7]
)
def test_windows_are_never_fewer_than_eight(sizes, hold):
    fitter = select_windows(problem_of(sizes, hold=hold))
    assert len(fitter.problem.windows) >= MIN_WINDOWS
    assert fitter.problem.windows.lengths.sum() == sum(sizes)


def test_windows_grow_until_eight_are_left():
    problem = problem_of((3000,))
    while (further := longer(problem)) is not None:
        assert further.scales.window > problem.scales.window
        problem = further
    assert len(problem.windows) == MIN_WINDOWS


@pytest.mark.parametrize(
    "sizes", [(80,), (100,), (3000,), (40, 60), (1000, 40), (3000, 20, 20, 20, 20), (500,) * 6]
)
def test_every_fold_is_judged_by_enough_others(sizes):
    problem = problem_of(sizes)
    folds = make_folds(problem)
    count = len(problem.windows)
    assert count >= FOLDS
    held_out = np.bincount(folds)
    assert 2 <= held_out.size <= count
    assert held_out.min() >= 1
    assert held_out.max() <= MOST_HELD_OUT * count


def test_folds_are_whole_records_where_these_are_alike():
    problem = problem_of((500, 600, 550))
    np.testing.assert_array_equal(make_folds(problem), problem.windows.record)


@pytest.mark.parametrize("sizes", [(79,), (39, 39, 39), (19,) * 5])
def test_records_that_make_too_few_windows_are_refused(sizes):
    with pytest.raises(
        RecordError, match=r"at least 80 samples .*, 4 windows of 20.*got .* Remedy"
    ):
        ModelDiagnosis(CART).fit(*drive(sizes))


def test_records_that_make_few_windows_are_warned_of_at_the_top():
    diagnosis = ModelDiagnosis(CART, catalogue=()).fit(*drive((55, 54)))
    first = diagnosis.data_quality_[0]
    assert first.kind == "short records"
    assert "only 4 windows" in first.text
    assert "at least 8 windows of 20 samples" in first.remedy
    assert diagnosis.to_dict()["data_quality"][0]["kind"] == "short records"
    enough = ModelDiagnosis(CART, catalogue=()).fit(*drive((160,)))
    assert "short records" not in {finding.kind for finding in enough.data_quality_}


# -- the length that is asked for ------------------------------------------------------------------


@pytest.mark.parametrize("window_length", [0.4, 0.5, 1.7, 6.0, 15.0])
def test_a_length_that_is_asked_for_is_kept_to(window_length):
    diagnosis = ModelDiagnosis(CART, catalogue=(), window_length=window_length).fit(*drive((3000,)))
    assert diagnosis.window_ == pytest.approx(window_length, rel=1e-9)
    lengths = diagnosis.records_.windows.lengths
    assert set(lengths[:-1]) == {round(window_length / STEP)}
    assert MIN_SAMPLES <= lengths[-1] < round(window_length / STEP) + MIN_SAMPLES


def test_a_length_is_one_in_seconds_whatever_the_clock():
    problem = problem_of((1000, 1500), (0.03, 0.02), window_length=2.0)
    windows = problem.windows
    seconds = windows.lengths * np.where(windows.record == 0, 0.03, 0.02)
    last = np.append(np.diff(windows.record) > 0, True)
    np.testing.assert_allclose(seconds[~last], 2.0, atol=0.02)
    assert median_window_length(windows) == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize(
    "window_length", [0.39, 20.0, 59.0, 1e3, 0.0, -1.0, np.nan, np.inf, "long", True]
)
def test_a_length_that_cannot_be_had_is_refused_with_those_that_can(window_length):
    with pytest.raises(
        ValueError, match=r"window_length: expected .* 0\.4 s \(20 samples\) to .* Remedy"
    ):
        ModelDiagnosis(CART, catalogue=(), window_length=window_length).fit(*drive((3000,)))


def test_the_longest_window_that_is_said_to_be_possible_is():
    X, y = drive((700, 900))
    with pytest.raises(ValueError, match="4 windows in all records") as refused:
        ModelDiagnosis(CART, catalogue=(), window_length=17.9).fit(X, y)
    longest = float(str(refused.value).split(" to ")[1].split(" s ")[0])
    diagnosis = ModelDiagnosis(CART, catalogue=(), window_length=longest * (1 - 1e-3)).fit(X, y)
    assert len(diagnosis.records_.windows) == FOLDS
    with pytest.raises(ValueError, match="4 windows in all records"):
        ModelDiagnosis(CART, catalogue=(), window_length=longest * 1.01).fit(X, y)


@pytest.mark.parametrize("window_length", [0.1, 61.0])
def test_the_regressor_refuses_such_lengths_too(window_length):
    with pytest.raises(
        ValueError, match=r"from 0\.4 s \(20 samples\) to 60 s \(the longest record"
    ):
        PhysicsModelRegressor(CART, window_length=window_length).fit(*drive((3000,)))


# -- few samples a period --------------------------------------------------------------------------


def test_a_hardening_spring_at_nine_samples_a_period_is_named_and_its_error_is_true():
    omega, noise = 2 * np.pi * 68, 6e-4
    rates = {"x": "v", "v": "w2*(g*u - x) - d*v"}
    names = {"states": {"x": "V", "v": "V/s"}, "inputs": {"u": "V"}, "outputs": {"y": "x"}}
    prior = PhysicsModel(
        equations=rates,
        parameters={
            "w2": {"value": 1.1 * omega**2, "spread": 0.3},
            "d": {"value": 0.12 * omega, "spread": 0.5},
            "g": {"value": 1.1, "spread": 0.3},
        },
        **names,
    )
    stiffness = 5 * omega**2
    truth = prior.with_parameters(w2=omega**2, d=0.1 * omega, g=1.0)
    truth = truth + effects.CubicStiffness("v", stiffness=stiffness)
    rng, t = np.random.default_rng(0), np.arange(3000) / 610
    waves = np.outer(t, np.linspace(1, 100, 200)) + rng.uniform(size=200)
    u = np.sin(2 * np.pi * waves).sum(axis=1)
    u *= 0.02 / u.std()
    y = truth.simulate(t, u, substeps=16, hold="foh").y + noise * rng.normal(size=(t.size, 1))
    catalogue = (effects.CubicStiffness, effects.QuadraticDrag, effects.InputBias)
    diagnosis = ModelDiagnosis(prior, catalogue=catalogue, hold="foh").fit(
        np.column_stack([t, u]), y
    )
    assert [cause.effect for cause in diagnosis.causes_] == ["cubic_stiffness"]
    found = diagnosis.causes_[0].parameters["stiffness"]
    assert found.value == pytest.approx(stiffness, rel=0.05)
    assert diagnosis.records_.windows.scale[0] == pytest.approx(noise, rel=0.2)
    assert diagnosis.gain_["y"].extended == pytest.approx(noise, rel=0.2)
    assert len(diagnosis.records_.windows) >= MIN_WINDOWS


# -- what the gain's interval says -----------------------------------------------------------------


def test_the_interval_of_the_gain_resamples_windows_and_not_their_blocks(monkeypatch):
    """Windows that are all alike leave no doubt, however much their blocks differ."""
    problem = problem_of((1600,), window_length=4.0)
    problem = replace(problem, windows=replace(problem.windows, blocks=2))
    count = len(problem.windows)

    def squares(early, late):
        return np.tile([[[100.0 * early], [100.0 * late]]], (count, 1, 1))

    before, after = squares(9.0, 1.5), squares(1.0, 1.2)
    one = Residuals(np.ones(1), np.ones(1), np.ones(1))
    fitter = SimpleNamespace(
        problem=problem,
        prior=None,
        held_out=lambda trial: HeldOut(one, one, 0.0, after),
        white_squares=lambda trial: np.zeros(1),
    )
    monkeypatch.setattr("sklearn_pgnn.diagnosis.result.block_squares", lambda *_: before)
    result = SimpleNamespace(base=None, final=None)
    gain = measure_gain(fitter, result, 0)["v"]
    assert gain.low == pytest.approx(gain.explained_share) == gain.high
