"""How long the windows are, where nobody sees a state."""

import numpy as np
import pytest
from unstable_rig import FRICTION, GAP, STRENGTH, hovering, record

from sklearn_pgnn import ModelDiagnosis, PhysicsModel
from sklearn_pgnn.estimation import window_selection
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.window_selection import growth_rate, horizon
from sklearn_pgnn.trajectories import read_records


def test_a_hidden_velocity_may_have_dry_friction():
    model = PhysicsModel(
        {"shown": "V", "v": "m/s"},
        {"shown": "v - shown", "v": "F - v - 0.2*sign(v)"},
        inputs={"F": "N"},
        outputs={"sensor": "shown"},
    )
    t = np.arange(0, 20, 0.02)
    F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    y = model.simulate(t, F, substeps=4).y
    y = y + 1e-3 * np.random.default_rng(0).normal(size=y.shape)
    diagnosis = ModelDiagnosis(model, catalogue=["input_gain"])
    assert diagnosis.fit(np.column_stack([t, F]), y).verdict_ == "model_adequate"


@pytest.mark.parametrize(("lacking", "length"), [(0.1, 10.0), (1.0, 2.5)])
def test_windows_are_drawn_out_as_far_as_the_prior_does_not_run_away(lacking, length, monkeypatch):
    """A machine kept in hand, and a prior that lacks some or all of its friction."""
    rig, prior = (
        PhysicsModel({"v": "m/s"}, {"v": f"{rate}*v + F"}, inputs={"F": "N"})
        for rate in (-1.0, lacking - 1.0)
    )
    t, v, force = np.arange(0, 80, 0.02), 0.0, np.zeros(4000)
    for k, now in enumerate(t):
        force[k] = -6.0 * v + 2 * np.sin(0.7 * now) + np.sin(1.9 * now)
        v += 0.02 * (force[k] - v)
    y = rig.simulate(t, force, substeps=5).y
    y = y + 1e-3 * np.random.default_rng(0).normal(size=y.shape)
    problem = build_problem(prior, read_records(prior, np.c_[t, force], y), window_length=1.25)
    monkeypatch.setattr(window_selection, "_slowest", lambda fitter: 2.0)
    fitter = window_selection._past_hidden_starts(HypothesisFitter(problem))
    assert fitter.problem.scales.window == pytest.approx(length, rel=0.1)
    assert window_selection._tells(fitter)


@pytest.mark.parametrize(("sample_time", "fewest"), [(0.001, 20), (0.005, 4), (0.01, 4)])
def test_windows_are_no_longer_than_an_unstable_prior_foresees(sample_time, fewest):
    """In 23 ms an error grows by a factor e: 20 samples are one time constant of it, or nine."""
    model = hovering()
    problem = build_problem(model, read_records(model, *record(sample_time, 2000)))
    fitter = window_selection.select_windows(problem)
    assert fitter.problem.min_samples == fewest
    assert window_selection._tells(fitter)
    assert fitter.problem.scales.window < 0.15


def test_windows_are_as_short_where_a_cause_is_missing():
    """With this friction the prior tells nothing in any windows."""
    model = hovering(0.98 * STRENGTH, 0.97 * GAP)
    problem = build_problem(model, read_records(model, *record(0.01, 1500, FRICTION)))
    fitter = window_selection._before_it_runs_away(HypothesisFitter(problem))
    assert not window_selection._is_beyond_foresight(fitter)


def test_a_prior_that_foresees_nothing_keeps_its_windows():
    model = hovering(1e4 * STRENGTH, GAP)
    problem = build_problem(model, read_records(model, *record(0.01, 1500)), substeps=4)
    given = HypothesisFitter(problem)
    assert window_selection._before_it_runs_away(given) is given


@pytest.mark.parametrize("noise", [1e-4, 0.1])
def test_windows_become_short_however_quiet_or_loud_the_records_are(noise):
    """In 39 samples the prior becomes infinite, though within the foresight of quiet records.

    That of loud ones is 8 samples, and within it a straight line leaves no more than noise.
    """
    X, y = record(0.005, 2000, FRICTION, noise=noise)
    prior = hovering(0.98 * STRENGTH, 0.97 * GAP)
    fitter = window_selection.select_windows(build_problem(prior, read_records(prior, X, y)))
    assert fitter.base().fit.usable
    assert fitter.problem.scales.window == pytest.approx(0.045, abs=0.011)


pytestmark = pytest.mark.core

T = 0.02 * np.arange(1000)


def problem_of(model, noise=0.01, y=None):
    y = np.sin(T) if y is None else y
    records = read_records(model, np.column_stack([T, np.cos(T)]), y)
    return build_problem(model, records, noise_std=noise, substeps=1)


def chain(rate):
    """Return a point whose position pulls it back, or drives it away."""
    rates = {"x": "v", "v": rate}
    return PhysicsModel({"x": "m", "v": "m/s"}, rates, {}, {"F": "N"}, outputs={"x": "x"})


@pytest.mark.parametrize("rate", [0.5, 2.0, 30.0])
def test_an_error_grows_with_the_rate_of_the_instability(rate):
    for model in (chain(f"{rate**2}*x + F"), chain(f"{rate**2}*sinh(x)/cosh(x) + x*0 + F")):
        found = growth_rate(problem_of(model, y=1e-3 * np.sin(T), noise=1e-5), model)
        assert found == pytest.approx(rate, rel=1e-3)


@pytest.mark.parametrize("noise", [0.1, 0.01, 1e-4])
def test_foresight_ends_where_noise_has_grown_to_the_size_of_the_output(noise):
    model = chain("25*x + F")
    ends = horizon(problem_of(model, noise), model)
    assert noise * np.exp(5.0 * ends) == pytest.approx(np.sin(T).std(), rel=1e-3)


@pytest.mark.parametrize("rate", ["-25*x + F", "-25*x - 2*v + F", "F", "-3*v - 0.2*sign(v) + F"])
def test_what_is_not_unstable_has_no_end_of_foresight(rate):
    model = chain(rate)
    assert horizon(problem_of(model), model) > 1e6


def test_an_output_no_larger_than_its_noise_cannot_be_foreseen():
    model = chain("25*x + F")
    assert horizon(problem_of(model, noise=10.0), model) == 0.0
