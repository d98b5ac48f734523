"""Laws of the fits of hypotheses: none is worse for having been begun anew."""

from contextlib import nullcontext

import pytest
from sledge import SLEDGE, drive

from sklearn_pgnn import effects
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis, Start
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
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
