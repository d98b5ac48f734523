"""Laws of the fits of hypotheses: their models, first looks and places, and what they leave."""

from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.estimation.budgets import KEPT, SAMPLES
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis, Start
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.likely_places import likely_places
from sklearn_pgnn.estimation.problem import build_problem, subsample_windows
from sklearn_pgnn.estimation.squares_left import share_left
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.places import places_of
from sklearn_pgnn.systems import two_tanks
from sklearn_pgnn.trajectories import read_records

FRICTION, DEAD_ZONE = effects.CoulombFriction("v"), effects.InputDeadZone("F")


def fitter_of(rig):
    return HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, *drive(rig))))


def test_a_cause_begun_anew_beside_another_leaves_no_more():
    fitter = fitter_of(SLEDGE + effects.CoulombFriction("v", 0.4) + effects.InputDeadZone("F", 0.5))
    alone = fitter.converge(fitter.first_fit(fitter.subsample(fitter.base()), FRICTION))
    both = fitter.converge(fitter.first_fit(alone, DEAD_ZONE))
    again = fitter.restart(both, FRICTION)
    assert set(again.hypothesis.causes) == {FRICTION, DEAD_ZONE}
    assert again.fit.objective <= both.fit.objective


def test_to_hold_a_parameter_elsewhere_costs_what_its_curvature_says():
    fitter = fitter_of(SLEDGE)
    trial = fitter.polish(fitter.base())
    mass = trial.fit.model.parameters["m"].value
    assert fitter.rise(trial, "m", mass, small=1e-6) == pytest.approx(0.0, abs=0.1)
    near, far = (fitter.rise(trial, "m", mass * (1 - f), small=1e-3) for f in (0.005, 0.01))
    assert far == pytest.approx(4.0 * near, rel=0.1)


def test_a_fit_that_got_stuck_is_released_by_what_other_windows_teach():
    fitter = fitter_of(SLEDGE)
    base = fitter.base()
    wrong = base.fit.model.with_parameters(m=1.05 * base.fit.model.parameters["m"].value)
    start = fitter.problem.states.estimate(wrong)
    stuck = fitter.fit_model(
        nullcontext(),
        wrong,
        fitter.problem.windows,
        base.fit.freedoms,
        Start(start.x[fitter.problem.windows.starts], start.spread),
        base.fit.x0,
        max_steps=0,
    )
    assert fitter.refit_from_held_out(base) is base
    refitted = fitter_of(SLEDGE).refit_from_held_out(FittedHypothesis(base.hypothesis, stuck))
    assert refitted.fit.objective == pytest.approx(base.fit.objective, rel=1e-3)
    assert stuck.objective > 1.1 * base.fit.objective


class ClosedPipe(effects.Leak):
    """The pipe to the other tank is closed: nothing flows on that could run over into it."""

    id = "closed_pipe"

    def rewrite(self, model, p):
        """Let nothing into the other tank."""
        return {"equations": {**model.equations, "x2": sympy.Integer(0)}}


@pytest.fixture(scope="module")
def fitter():
    tanks = two_tanks()
    t = [0.5 * k for k in range(400)]
    u = [2.0 + (k // 40) % 2 for k in range(400)]
    y = tanks.simulate(t, u, x0=[1.0, 1.0]).y
    X = [[a, b] for a, b in zip(t, u, strict=True)]
    return HypothesisFitter(build_problem(tanks, read_records(tanks, X, y)))


@pytest.fixture(scope="module")
def models(fitter):
    return fitter.models


def test_a_cause_that_cannot_act_after_another_one_stands_before_it(models):
    overflow, closed = effects.Overflow("x1"), ClosedPipe("x1")
    with pytest.raises(ModelError, match="expected a target among"):
        models.extend(Hypothesis().plus(closed).plus(overflow))
    (placed,) = models.orders(Hypothesis().plus(closed), overflow)
    assert placed.order == (overflow, closed)
    assert isinstance(models.extend(placed), PhysicsModel)


def test_a_cause_that_can_act_at_no_place_is_lost(fitter, monkeypatch):
    overflow, ground = effects.Overflow("x1"), fitter.subsample(fitter.base())
    assert fitter.first_fit(ground, overflow).fit.usable
    monkeypatch.setattr(fitter.models, "is_possible", lambda hypothesis: False)
    assert fitter.models.orders(Hypothesis(), overflow) == []
    lost = fitter.first_fit(ground, overflow)
    assert lost.hypothesis.causes == (overflow,)
    assert not lost.fit.usable


def subsample_of(n_records, samples, length, noise=NOISE, error=lambda windows: 1.0):
    """Return the windows of such a length [s], and those that first fits take."""
    drives = drive(n_records=n_records, samples=samples, noise=noise)
    records = read_records(SLEDGE, *drives)
    problem = build_problem(SLEDGE, records, window_length=length)
    residual = np.broadcast_to(error(problem.windows), problem.windows.y.shape)
    return problem.windows, subsample_windows(problem, residual)


@pytest.mark.parametrize("noise", [NOISE, 1e-7])  # with so little all samples tell
@pytest.mark.parametrize("length", [0.6, 10.0, 60.0])
def test_first_fits_take_few_samples_however_long_windows_are(length, noise):
    windows, some = subsample_of(8, 3000, length, noise)
    assert windows.lengths.sum() > 3 * SAMPLES
    assert some.windows.lengths.sum() <= 1.5 * SAMPLES
    starts = windows.t[windows.starts[some.which]]
    np.testing.assert_array_equal(some.windows.t[some.windows.starts], starts)


def test_of_short_records_first_fits_take_all():
    windows, some = subsample_of(4, 500, 2.5)
    assert some.factor == 1
    np.testing.assert_array_equal(some.windows.lengths, windows.lengths)


def test_what_is_wrong_late_in_long_windows_is_among_the_samples_of_first_fits():
    def late(windows):
        share = np.zeros((windows.t.size, 1))
        for start, length in zip(windows.starts, windows.lengths, strict=True):
            share[start + length - 100 : start + length] = 1.0
        return share

    _, some = subsample_of(8, 3000, 60.0, 1e-7)
    windows, all_of_them = subsample_of(8, 3000, 60.0, 1e-7, late)
    assert some.windows.lengths.sum() < all_of_them.windows.lengths.sum()
    np.testing.assert_array_equal(
        all_of_them.factor * all_of_them.windows.lengths, windows.lengths[all_of_them.which]
    )


MASSES = 5


def chain():
    """Return masses on a line, each tied to the next by a spring."""
    places = range(MASSES)
    pull = {i: f"k*(q{i} - q{i - 1})" if i else "k*q0" for i in places}
    rate = {
        i: ("F - " if i == 0 else "-") + pull[i] + (f" + {pull[i + 1]}" if i + 1 < MASSES else "")
        for i in places
    }
    return PhysicsModel(
        {f"q{i}": "m" for i in places} | {f"v{i}": "m/s" for i in places},
        {f"q{i}": f"v{i}" for i in places} | {f"v{i}": f"({rate[i]} - d*v{i})/m" for i in places},
        {"m": 1.0, "k": 50.0, "d": 0.5},
        {"F": "N"},
        outputs={f"q{i}": f"q{i}" for i in places},
        inertia={f"v{i}": "m" for i in places},
    )


@pytest.mark.parametrize("at", range(MASSES))
def test_the_mass_that_rubs_is_among_them(at):
    model, rng = chain(), np.random.default_rng(at)
    t = 0.02 * np.arange(600)
    force = 10 * np.sin(3 * t) + 8 * np.sin(7.3 * t + 1)
    rig = model + effects.CoulombFriction(f"v{at}", level=0.5)
    y = rig.simulate(t, force, substeps=5).y + 1e-3 * rng.normal(size=(t.size, MASSES))
    X = pd.DataFrame({"t": t, "F": force})
    fitter = HypothesisFitter(build_problem(model, read_records(model, X, y)))
    names = places_of(model)
    assert len(names) > KEPT
    likely = likely_places(fitter.problem, fitter.base(), names)
    assert len(likely) == KEPT
    assert f"v{at}" in likely
    assert likely_places(fitter.problem, fitter.base(), names[:KEPT]) == names[:KEPT]


squares = st.lists(st.floats(0.1, 100.0), min_size=6, max_size=6).map(np.array)


@given(squares, squares, st.floats(1e-3, 1e3))
def test_a_share_knows_no_units_and_lies_in_its_interval(before, after, unit):
    found = share_left(before, after)
    assert found.low <= found.left <= found.high
    assert share_left(unit * before, unit * after) == pytest.approx(found)


@given(squares)
def test_what_is_left_alike_everywhere_is_sure(before):
    assert share_left(before, 0.3 * before) == pytest.approx((0.3, 0.3, 0.3))


def test_the_interval_holds_the_share_of_many_windows():
    rng, held = np.random.default_rng(0), 0
    for _ in range(500):
        before = rng.chisquare(50, 20)
        _, low, high = share_left(before, 0.2 * before * rng.gamma(9, 1 / 9, 20))
        held += low < 0.2 < high
    assert 0.92 < held / 500 < 0.98


def test_one_window_tells_no_interval():
    assert share_left(np.array([2.0]), np.array([1.0])) == (0.5, 0.0, np.inf)
