"""Laws of what residuals count along a cause, and of the errors of its numbers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.diagnosis import size
from sklearn_pgnn.diagnosis.size import (
    _size_fields,
    differs_from_none,
    exceeds_rounding,
    leaves_something,
    likelihood_intervals,
    overdispersion_along,
    parameter_errors,
    reads_noise_at_limits,
    says_more_than_bounds,
)
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.residuals import Residuals
from sklearn_pgnn.trajectories import read_records

LOAD, STRIBECK = effects.ConstantLoad("v"), effects.StribeckFriction("v")


def along(ratios, *causes, residuals=None):
    """Return the overdispersion along causes, given that along every parameter."""
    expected = np.zeros((2, 1)), np.ones(1)
    problem = SimpleNamespace(
        states=SimpleNamespace(expected_starts=lambda model, windows: expected), windows=None
    )
    trial = SimpleNamespace(fit=SimpleNamespace(model=None))
    seen, one = [], np.ones(1)

    def overdispersion(fit, expected, spread, dispersion):
        seen.append(dispersion)
        return ratios

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(size, "overdispersion", overdispersion)
        residuals = residuals or Residuals(one, one, one)
        return overdispersion_along(problem, trial, causes, residuals), seen[0]


ratio = st.floats(1.0, 1e6)


@given(ratio, st.lists(ratio, min_size=3, max_size=3))
def test_of_several_causes_the_most_disturbed_counts_and_of_one_the_mean(load, friction):
    names = list(STRIBECK.names().values())
    ratios = {"F0_v": load, **dict(zip(names, friction, strict=True)), "m": 1e9}
    assert along(ratios, LOAD)[0] == load
    assert along(ratios, STRIBECK)[0] == pytest.approx(np.mean(friction))
    both, turned = along(ratios, LOAD, STRIBECK)[0], along(ratios, STRIBECK, LOAD)[0]
    assert both == turned == max(along(ratios, LOAD)[0], along(ratios, STRIBECK)[0])


def test_what_has_no_number_is_disturbed_by_nothing():
    assert along({"m": 7.0}, effects.SensorRectification("v"))[0] == 1.0
    assert along({}, LOAD)[0] == 1.0  # held, and not fitted


def test_coloured_residuals_count_by_their_effective_number():
    times, counts = np.array([1.0, 5.0]), np.array([100.0, 300.0])
    residuals = Residuals(2.0 * counts, counts, times)
    assert along({}, residuals=residuals)[1] == pytest.approx((2 * 100 + 10 * 300) / 400)


# -- on records ------------------------------------------------------------------------------------


def disturbed(strength, seed=0):
    """Return a fitted load on a sledge that slow forces from outside push, and the fitter."""
    rng = np.random.default_rng(seed)
    X, y = drive(SLEDGE, n_records=6, samples=400, noise=0.0, seed=seed)
    pushed = SLEDGE.replace(inputs={"F": "N", "wind": "N"}, equations={"v": "(F + wind - d*v)/m"})
    runs = []
    for _, rows in X.groupby("trajectory"):
        slow = lfilter([np.sqrt(1 - 0.99**2)], [1, -0.99], rng.normal(size=len(rows)))
        run = pushed.simulate(rows["t"], np.column_stack([rows["F"], strength * slow]), substeps=5)
        runs.append(run.y[:, 0])
    noise = 2e-3 * rng.normal(size=len(y))
    records = read_records(SLEDGE, X, np.concatenate(runs) + noise)
    fitter = HypothesisFitter(build_problem(SLEDGE, records, noise_std=[2e-3]))
    base = fitter.base()
    found = fitter.converge(fitter.first_fit(fitter.subsample(base), LOAD))
    return fitter, fitter.polish(fitter.fit_all(found, base))


def test_noise_of_a_sensor_counts_whole_and_a_push_from_outside_counts_less():
    found = []
    for strength in (0.0, 0.3):
        fitter, trial = disturbed(strength)
        held_out = fitter.held_out(trial).windows
        found.append(overdispersion_along(fitter.problem, trial, [LOAD], held_out))
    quiet, loud = found
    assert 1.0 <= quiet < 3.0 < loud


def test_the_error_of_a_load_is_that_of_many_records():
    draws = [disturbed(0.0, seed)[1].fit.model.parameters["F0_v"].value for seed in range(8)]
    fitter, trial = disturbed(0.0)
    error = parameter_errors(fitter.problem, trial)["F0_v"]
    assert 0.4 < error / np.std(draws, ddof=1) < 2.5


def test_an_error_scales_with_the_noise():
    fitter, trial = disturbed(0.0)
    errors = parameter_errors(fitter.problem, trial)
    gram = trial.fit.evaluation.block_gram.copy()
    gram[..., -1] *= 3.0  # residuals thrice as large ...
    gram[..., -1, :] *= 3.0
    evaluation = replace(trial.fit.evaluation, block_gram=gram)
    louder = replace(trial, fit=replace(trial.fit, evaluation=evaluation))
    more = parameter_errors(fitter.problem, louder)["F0_v"]
    assert errors["F0_v"] < more <= 3.01 * errors["F0_v"]


# -- intervals ------------------------------------------------------------------------------------


def test_the_interval_of_a_load_is_that_of_its_standard_error():
    fitter, trial = disturbed(0.0)
    error = parameter_errors(fitter.problem, trial)["F0_v"]
    value = trial.fit.model.parameters["F0_v"].value
    low, high = likelihood_intervals(fitter, trial, {"F0_v": error})["F0_v"]
    np.testing.assert_allclose([low, high], value + 1.96 * error * np.array([-1, 1]), rtol=0.2)
    assert likelihood_intervals(fitter, trial, {"F0_v": np.inf})["F0_v"] == (-np.inf, np.inf)


def test_the_interval_of_an_end_that_records_do_not_meet_is_open():
    clipped = SLEDGE + effects.SensorSaturation("v", upper=0.9, lower=-1e9)
    X, y = drive(clipped)
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, X, y)))
    base, ends = fitter.base(), effects.SensorSaturation("v")
    found = fitter.converge(fitter.first_fit(fitter.subsample(base), ends))
    trial = fitter.polish(fitter.fit_all(found, base))
    errors = parameter_errors(fitter.problem, trial)
    upper, lower = (ends.names()[end] for end in ("upper", "lower"))
    low, high = likelihood_intervals(fitter, trial, {upper: errors[upper]})[upper]
    assert low <= 0.9 <= high < low + 0.02
    assert likelihood_intervals(fitter, trial, {lower: errors[lower]})[lower][0] == -np.inf


# -- a size, or none -------------------------------------------------------------------------------


def fitted_load(load, seed, cause=LOAD):
    """Return a problem of a sledge under a load, and the hypothesis that there is such a cause."""
    X, y = drive(SLEDGE + effects.ConstantLoad("v", load), seed=seed)
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, X, y)))
    base = fitter.base()
    first = fitter.first_fit(fitter.subsample(base), cause)
    return fitter.problem, fitter.fit_all(fitter.converge(first), base)


@pytest.mark.parametrize("seed", range(3))
def test_a_load_has_a_size_and_what_is_not_there_has_none(seed):
    assert differs_from_none(*fitted_load(0.2, seed), LOAD, 0.01)
    assert not differs_from_none(*fitted_load(0.0, seed), LOAD, 1e-3)


def test_a_size_at_its_bound_is_none():
    """Friction that would have to push stays at zero."""
    friction = effects.CoulombFriction("v")
    problem, trial = fitted_load(0.0, 0, friction)
    assert trial.fit.model.parameters["Fc_v"].bounds[0] == 0.0
    none = replace(trial, fit=replace(trial.fit, model=trial.fit.model.with_parameters(Fc_v=0.0)))
    assert not differs_from_none(problem, none, friction, 0.5)


def test_play_without_width_is_a_lag_and_not_nothing():
    """A rate limit has no size, though the lag that it is without an end has one."""
    assert _size_fields(effects.InputBacklash("F")) == {"width", "time_constant"}
    assert _size_fields(effects.InputRateLimit("F")) == set()
    assert _size_fields(effects.StribeckFriction("v")) == {"level", "peak"}


def test_a_limit_that_lets_nothing_pass_is_no_limit():
    """At the lowest one that is looked at, hardly a sample is beneath it."""
    limit = effects.InputSaturation("F")
    X, y = drive(SLEDGE + effects.InputSaturation("F", 0.7))
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, X, y)))
    base = fitter.base()
    found = fitter.converge(fitter.first_fit(fitter.subsample(base), limit))
    trial, problem = fitter.fit_all(found, base), fitter.problem
    assert leaves_something(problem, trial, limit, 0.01)
    (free,) = (each for each in trial.fit.freedoms if each.name == "L_F")
    lowest = trial.fit.model.with_parameters(L_F=free.low)
    at_its_end = replace(trial, fit=replace(trial.fit, model=lowest))
    assert not leaves_something(problem, at_its_end, limit, 0.01)
    assert leaves_something(problem, trial, LOAD, 0.01)  # it limits nothing


def test_what_has_no_size_is_there_or_not():
    ends, turns = effects.SensorSaturation("v"), effects.SensorRectification("v")
    problem, trial = fitted_load(0.2, 0)
    assert differs_from_none(problem, trial, ends, 0.01)
    assert differs_from_none(problem, trial, turns, 0.01)


@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3), st.integers(0, 99))
def test_units_do_not_change_whether_there_is_a_size(exponents, seed):
    rng = np.random.default_rng(seed)
    root, value, unit = rng.normal(size=(3, 3)), 3 * rng.normal(size=3), 10.0 ** np.array(exponents)
    found = [
        _asked(value * by, (root * by[:, None]) @ (root * by[:, None]).T)
        for by in (np.ones(3), unit)
    ]
    assert found[0] == found[1]


def _asked(value, covariance):
    names = list(STRIBECK.names().values())
    numbers = {n: SimpleNamespace(value=v) for n, v in zip(names, value, strict=True)}
    freedoms = [SimpleNamespace(name=name) for name in names]
    trial = SimpleNamespace(
        fit=SimpleNamespace(model=SimpleNamespace(parameters=numbers), freedoms=freedoms)
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(size, "parameter_covariance", lambda *_: covariance)
        patch.setattr(size, "_expected_starts", lambda *_: ())
        return differs_from_none(None, trial, STRIBECK, 0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "says_more"), [(2e-3, True), (3.0, False)])
def test_a_value_at_its_bound_that_may_be_any_other_says_nothing(noise, says_more):
    """The mass is 2.6 kg, and the model allows 1.8 to 2.3 kg: loud records allow all of that."""
    mass = {"value": 2.0, "bounds": [1.8, 2.3], "spread": 0.02}
    prior = SLEDGE.replace(parameters={"m": mass, "d": {"value": 0.5, "fixed": True}})
    X, y = drive(SLEDGE.with_parameters(m=2.6), n_records=2, samples=200, noise=noise, seed=2)
    fitter = HypothesisFitter(build_problem(prior, read_records(prior, X, y)))
    wrong = effects.WrongParameter("m")
    first = fitter.converge(fitter.first_fit(fitter.subsample(fitter.base()), wrong))
    trial = fitter.polish(fitter.fit_all(first, fitter.base()))
    assert trial.fit.model.parameters["m"].value == 2.3
    assert says_more_than_bounds(fitter, trial, wrong) is says_more


@pytest.mark.parametrize(
    ("step", "noise", "change", "exceeds"),
    [(0.03, 0.0, 0.01, False), (0.03, 0.0, 0.02, True), (0.03, 0.0, np.nan, True),
     (1e-5, 0.01, 1e-6, True)],
)  # fmt: skip
def test_a_limit_of_a_sensor_that_moves_no_sample_by_half_a_step_is_rounding(
    step, noise, change, exceeds
):
    """An encoder stands still where its machine rests: that is no end of its range."""
    t = 0.01 * np.arange(800)
    y = 2.0 * np.sin(3.0 * np.minimum(t % 2.0, 1.6))
    y = np.floor((y + noise * np.random.default_rng(0).normal(size=t.size)) / step)[:, None] * step
    scale = np.array([max(noise, step / np.sqrt(12.0))])
    problem = SimpleNamespace(
        prior=SLEDGE.replace(outputs={"v": "v"}), windows=SimpleNamespace(y=y, scale=scale)
    )
    at_sensor, friction = effects.SensorSaturation("v"), effects.CoulombFriction("v")

    def trial(model, left):
        evaluation = SimpleNamespace(residual=np.full_like(y, left))
        return SimpleNamespace(fit=SimpleNamespace(evaluation=evaluation, model=model))

    without, with_ = trial(problem.prior, 0.0), trial(at_sensor.apply(problem.prior), change)
    assert exceeds_rounding(problem, without, with_, [at_sensor]) == exceeds
    with_ = trial(friction.apply(problem.prior), change)
    assert exceeds_rounding(problem, without, with_, [friction])


@pytest.mark.parametrize("passes", [False, True])
def test_a_sensor_never_reads_beyond_its_limit(passes):
    """What holds readings back, but not at one value, is no limit."""
    limit = effects.SensorSaturation("v")
    X, y = drive(SLEDGE, noise=0.0)
    top = np.quantile(y, 0.8)
    y = y.where(y < top, top + 0.3 * (y - top) if passes else top)
    y += np.random.default_rng(0).normal(0.0, NOISE, y.shape)
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, X, y)))
    base = fitter.base()
    found = fitter.converge(fitter.first_fit(fitter.subsample(base), limit))
    trial = fitter.fit_all(found, base)
    assert reads_noise_at_limits(fitter.problem, trial, limit) is not passes
    assert reads_noise_at_limits(fitter.problem, trial, LOAD)


@pytest.mark.parametrize(("outputs", "determined"), [({"y": "v"}, False), ({}, True)])
def test_a_unit_of_a_state_that_nobody_measures_is_not_determined(outputs, determined):
    """With the current, L, C and R have each a scale of its own: only their products act on v."""
    filter_ = PhysicsModel(
        {"v": "V", "i": "A"},
        {"v": "(i - v/R)/C", "i": "(u - v)/L"},
        {name: {"value": 1.0, "spread": np.inf, "bounds": [0.01, 100.0]} for name in "LCR"},
        {"u": "V"},
        outputs,
    )
    rng, t = np.random.default_rng(0), np.arange(0, 30, 0.05)
    u = np.repeat(rng.uniform(-1, 1, 30), 20)
    y = filter_.simulate(t, u).y
    y = y + 0.01 * rng.normal(size=y.shape)
    records = read_records(filter_, pd.DataFrame({"t": t, "u": u}), y)
    fitter = HypothesisFitter(build_problem(filter_, records))
    errors = parameter_errors(fitter.problem, fitter.base())
    assert {name: bool(np.isfinite(error)) for name, error in errors.items()} == dict.fromkeys(
        "LCR", determined
    )
