"""Held out means held out: windows enough to learn from, of the length that was asked for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from sledge import SLEDGE as CART

from sklearn_pgnn import (
    ModelDiagnosis,
    Parameter,
    PhysicsModel,
    PhysicsModelRegressor,
    datasets,
    effects,
    systems,
)
from sklearn_pgnn.diagnosis.result import measure_gain
from sklearn_pgnn.estimation import fold_fits, window_fitter
from sklearn_pgnn.estimation.budgets import FOLDS
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.fold_fits import keep_taught
from sklearn_pgnn.estimation.held_out import (
    MOST_HELD_OUT,
    CrossValidation,
    make_folds,
)
from sklearn_pgnn.estimation.problem import build_problem, longer
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.estimation.window_selection import select_windows
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, MIN_WINDOWS, median_window_length
from sklearn_pgnn.simulation.window_fit import fit_windows
from sklearn_pgnn.trajectories import read_records

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


def with_cause(fitter, trial, cause):
    """Return a hypothesis with one more cause, on all windows."""
    first = fitter.first_fit(fitter.subsample(trial), cause)
    return fitter.fit_all(fitter.converge(first), trial)


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


# -- what is judged was not learned from -----------------------------------------------------------


def test_every_window_is_judged_once_by_what_the_others_taught(monkeypatch):
    learned, judged = [], []

    class Watched(CrossValidation):
        def run(self, fit, folds, learn, judge):
            def learn_and_note(which):
                learned.append(which)
                return learn(which)

            def judge_and_note(model, which):
                judged.append(which)
                return judge(model, which)

            return super().run(fit, folds, learn_and_note, judge_and_note)

    monkeypatch.setattr(window_fitter, "CrossValidation", Watched)
    fitter = HypothesisFitter(problem_of((400,) * 4))
    fitter.held_out(fitter.base())
    assert (np.sum(judged, axis=0) == 1).all()
    for taught, inside in zip(learned, judged, strict=True):
        np.testing.assert_array_equal(taught, ~inside)


@pytest.mark.slow
def test_what_the_others_teach_has_forgotten_the_fold(monkeypatch):
    """Further steps would change no number by more than its standard error."""
    monkeypatch.setattr(fold_fits, "keep_taught", lambda *_: None)
    robot = systems.golf_robot()
    rig = datasets.make_hidden_effect(robot, "cubic_stiffness", n_records=4, random_state=1)
    fitter = HypothesisFitter(build_problem(rig.prior, read_records(rig.prior, rig.X, rig.y)))
    trial = with_cause(fitter, fitter.base(), effects.CubicStiffness("omega"))
    trial = with_cause(fitter, trial, effects.PeriodicDisturbance("omega"))
    windows, learned = fitter.problem.windows, {}

    def keep(validation, fit, folds, learn, judge):
        learned.update({fold: learn(folds != fold) for fold in np.unique(folds)})

    monkeypatch.setattr(CrossValidation, "run", keep)
    fitter._cross_validate(trial.hypothesis, trial.fit)
    x0, spread = fitter._start(trial.fit.model)
    for fold, fit in learned.items():
        which = fitter.folds != fold
        options = {"x0_start": fit.x0, "min_steps": 5, "max_steps": 5, "tolerance": 1e-12}
        args = fit.model, windows.select(which), fit.freedoms, x0[which], spread
        further = fit_windows(*args, **options).objective
        count = windows.lengths[which].sum()
        assert fit.objective - further < 4.0 * fit.objective / count  # a few units of chi-square


SLIDE = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - k*x)/m"},
    {n: Parameter(n, v, spread=np.inf) for n, v in {"m": 2.0, "d": 2.5, "k": 8.0}.items()},
    {"F": "N"},
    {"place": "x", "speed": "v"},
    inertia={"v": "m"},
)


@pytest.mark.slow
def test_what_one_fold_alone_tells_is_fitted_there_so_that_mirrors_leave_the_same():
    """A place that shows too much is a speed that shows too little, whoever meets the stop."""
    machine = SLIDE + effects.EndStop("v", upper=0.25, lower=-0.3, stiffness=80.0)
    machine += effects.SensorGain("place", error=0.02)
    rng, X, y = np.random.default_rng(0), [], []
    for i, force in enumerate((1.0, 1.0, 1.0, 2.5)):
        t = np.arange(600) * STEP
        force = force * (np.sin(1.1 * t + i) + 0.5 * np.sin(3.1 * t))
        X.append(pd.DataFrame({"trajectory": i, "t": t, "F": force}))
        shown = machine.simulate(t, force, substeps=10).y
        y.append(shown + 1e-4 * rng.normal(size=shown.shape))
    records = read_records(SLIDE, pd.concat(X, ignore_index=True), np.concatenate(y))
    fitter = HypothesisFitter(build_problem(SLIDE, records))
    stop = with_cause(fitter, fitter.base(), effects.EndStop("v"))
    mirrors = [
        fitter.polish(with_cause(fitter, stop, effects.SensorGain(output)))
        for output in ("place", "speed")
    ]
    one, other = (fitter.held_out(trial) for trial in mirrors)
    np.testing.assert_allclose(one.windows.squares, other.windows.squares, rtol=1e-4)
    assert (one.windows.squares / one.windows.counts < 1.1).all()


def test_what_was_not_measured_does_not_count():
    X, y = drive((400,) * 4)
    y[np.random.default_rng(0).random(y.size) < 0.3] = np.nan
    fitter = HypothesisFitter(build_problem(CART, read_records(CART, X, y)))
    found = fitter.held_out(fitter.base())
    measured = np.count_nonzero(np.isfinite(y))
    assert found.windows.counts == found.free_run.counts == [measured]
    assert np.isfinite(found.block_squares).all()
    assert found.windows.squares / measured == pytest.approx(1.0, rel=0.2)


def machine_with(rate):
    """Return the held-out error of a machine whose speed grows or falls at a rate, kept in hand."""
    model = PhysicsModel({"v": "m/s"}, {"v": "a*v + F"}, {"a": rate}, {"F": "N"})
    rng, X, y = np.random.default_rng(0), [], []
    for i in range(4):
        t, v, force = np.arange(500) * STEP, [0.0], []
        for now in t[:-1]:
            force.append(-4.0 * v[-1] + 2 * np.sin(0.7 * now + i) + np.sin(1.9 * now))
            v.append(model.simulate([0.0, STEP], [force[-1]] * 2, [v[-1]], substeps=5).x[-1, 0])
        X.append(pd.DataFrame({"trajectory": i, "t": t, "F": [*force, force[-1]]}))
        y.append(np.array(v) + 1e-3 * rng.normal(size=t.size))
    records = read_records(model, pd.concat(X, ignore_index=True), np.concatenate(y))
    fitter = HypothesisFitter(build_problem(model, records, window_length=1.0))
    return fitter.held_out(fitter.base())


@pytest.mark.parametrize(("rate", "tells"), [(-2.0, True), (2.0, False)])
def test_the_free_run_of_an_unstable_machine_says_nothing(rate, tells):
    found = machine_with(rate)
    assert found.tells.tolist() == [tells]
    assert found.windows.squares / found.windows.counts == pytest.approx(1.0, rel=0.2)


# -- what the initial values of added states cost --------------------------------------------------

SPREAD = np.array([0.7, 0.3])


RING = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "F - d*v - k*x"},
    {"d": {"value": 0.02, "spread": np.inf}, "k": {"value": 9.0, "spread": np.inf}},
    {"F": "N"},
    outputs={"x": "x"},
)


def ringing(seed, missing="0", noise=0.01):
    """Return what is held out of records of a machine that rings, each tells k in its own way."""
    rng, X, y = np.random.default_rng(seed), [], []
    machine = RING.replace(equations={"x": "v", "v": f"F - d*v - k*x + {missing}"})
    for record in range(3):
        t = np.arange(1000) * STEP
        force = 2 * np.sin((0.7 + 0.2 * record) * t + record) + np.sin((1.9 + record) * t)
        run = machine.simulate(t, force, x0=[0.5, 0.0], substeps=4)
        X.append(pd.DataFrame({"trajectory": record, "t": t, "F": force}))
        y.append(run.y[:, 0] + noise * rng.normal(size=t.size))
    records = read_records(RING, pd.concat(X, ignore_index=True), np.concatenate(y))
    fitter = HypothesisFitter(build_problem(RING, records, noise_std=[noise]))
    return fitter.held_out(fitter.base())


@pytest.mark.slow
def test_what_the_errors_of_a_fit_add_to_a_free_run_is_expected():
    found = [ringing(seed) for seed in range(12)]
    added = [each.free_run.squares[0] - each.free_run.counts[0] for each in found]
    expected = [each.uncertain[0] for each in found]
    assert min(added) > 1000  # more than is left by far, though nothing is missing
    assert 0.4 < np.mean(added) / np.mean(expected) < 2.5
    assert all(each.beyond_uncertainty(1e-3)[0] < each.free_run.counts[0] for each in found)


@pytest.mark.parametrize("seed", range(3))
def test_the_errors_of_a_fit_do_not_explain_what_is_missing(seed):
    found = ringing(seed, "-0.3*v*abs(v)")
    assert found.beyond_uncertainty(1e-3)[0] > 10 * found.free_run.counts[0]


# -- records that are too short --------------------------------------------------------------------


@pytest.mark.parametrize("sizes", [(79,), (39, 39, 39), (19,) * 5])
def test_records_that_make_too_few_windows_are_refused(sizes):
    said = r"at least 80 measured samples .*, at least 4 windows of 20.*got .* Remedy"
    with pytest.raises(RecordError, match=said):
        ModelDiagnosis(CART).fit(*drive(sizes))


@pytest.mark.slow
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


@pytest.mark.slow
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


def test_the_interval_of_the_gain_resamples_windows_and_not_their_blocks(monkeypatch):
    """Windows that are all alike leave no doubt, however much their blocks differ."""
    problem = problem_of((1600,), window_length=4.0)
    problem = replace(problem, windows=replace(problem.windows, blocks=2))
    one, tiles = Residuals(np.ones(1), np.ones(1), np.ones(1)), (len(problem.windows), 1, 1)
    before, after = np.tile([[[900.0], [150.0]]], tiles), np.tile([[[100.0], [120.0]]], tiles)
    left = {"held_out": lambda trial: HeldOut(one, one, 0.0, after)}
    left |= {"white_squares": lambda trial: np.zeros(1)}
    monkeypatch.setattr("sklearn_pgnn.diagnosis.result.block_squares", lambda *_: before)
    fitter = SimpleNamespace(problem=problem, prior=None, **left)
    gain = measure_gain(fitter, {"refitted": None, "extended": None}, 0)["v"]
    assert gain.low == pytest.approx(gain.explained_share) == gain.high


def told(rng, n, rank):
    """Return the information of so many directions."""
    some = rng.normal(size=(n, rank))
    return some @ some.T


@given(st.integers(2, 6), st.integers(0, 99))
def test_a_fold_moves_only_what_the_others_do_not_tell(n, seed):
    """In any units of the parameters."""
    rng = np.random.default_rng(seed)
    fold, others = np.eye(n) + told(rng, n, n), 1e4 * told(rng, n, n - 1)
    sharp, directions = np.linalg.eigh(others)
    assume(sharp[1] > 10 * np.linalg.eigvalsh(fold)[-1])
    precision = keep_taught(fold, others)
    step = np.linalg.solve(fold + precision, fold @ rng.normal(size=n))
    across = directions[:, 1:].T @ step
    assert np.linalg.norm(across) < 1e-3 * np.linalg.norm(step)
    units = 10.0 ** rng.uniform(-3, 3, n)
    outer = np.outer(units, units)
    scaled = keep_taught(outer * fold, outer * others)
    np.testing.assert_allclose(scaled / outer, precision, rtol=1e-4, atol=1e-4 * sharp[-1])


@pytest.mark.parametrize("share", [0.2, 1.0, 50.0])
def test_a_fold_moves_nothing_where_the_others_tell_a_tenth_of_what_it_does(share):
    fold = told(np.random.default_rng(0), 4, 4)
    assert keep_taught(fold, share * fold) is None
    assert keep_taught(np.zeros((4, 4)), fold) is None
    assert keep_taught(fold, 0.05 * fold) is not None
