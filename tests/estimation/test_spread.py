"""Free parameters: what their spread means, and what they share with a cause belongs to them."""

import math

import numpy as np
import pytest
from sledge import SLEDGE, drive

from sklearn_pgnn import ModelDiagnosis, Parameter, PhysicsModel, effects
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.freedoms import freedoms
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.shared_part import in_terms_of_the_model
from sklearn_pgnn.trajectories import read_records

STATES, INPUTS = {"v": "m/s"}, {"F": "N"}
MASS = {"value": 2.0, "unit": "kg"}
DRAG = 0.6


def sledge(**damping):
    """Make a mass with a damper whose prior value is 0, or without one."""
    rate = "(F - d*v)/m" if damping else "F/m"
    parameters = {"m": MASS} | ({"d": damping} if damping else {})
    return PhysicsModel(STATES, {"v": rate}, parameters, INPUTS, inertia={"v": "m"})


@pytest.fixture(scope="module")
def drawn():
    t = np.arange(0, 40, 0.02)
    force = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    truth = sledge(value=DRAG)
    noise = 1e-3 * np.random.default_rng(0).normal(size=(t.size, 1))
    return np.column_stack([t, force]), truth.simulate(t, force, substeps=5).y + noise


CATALOGUE = (effects.ViscousFriction, effects.CoulombFriction, effects.WrongParameter)


def test_a_share_of_zero_is_zero():
    assert Parameter("d", 0.0).reach == 0.0
    assert Parameter("d", -4.0, spread=0.5).reach == 2.0
    assert Parameter("d", 0.0, spread=math.inf).reach == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("damping", [{"value": 0.0}, {"value": 0.0, "bounds": (0, 10)}])
def test_a_parameter_of_value_zero_hides_no_cause(damping, drawn):
    without = ModelDiagnosis(sledge(), catalogue=CATALOGUE).fit(*drawn)
    with_zero = ModelDiagnosis(sledge(**damping), catalogue=CATALOGUE).fit(*drawn)
    assert [(c.effect, c.target) for c in without.causes_] == [("viscous_friction", "v")]
    assert [(c.effect, c.target) for c in with_zero.causes_] == [("wrong_parameter", "d")]
    assert with_zero.verdict_ == without.verdict_ == "cause_named"
    (named,), (same,) = with_zero.causes_, without.causes_
    assert named.parameters["value"].value == pytest.approx(DRAG, rel=0.02)
    (coefficient,) = same.parameters.values()
    assert named.parameters["value"].value == pytest.approx(coefficient.value, rel=1e-3)
    assert with_zero.refitted_model_.parameters["d"].value == 0.0
    assert with_zero.gain_["v"].extended == pytest.approx(without.gain_["v"].extended, rel=0.01)


def test_an_endless_spread_lets_a_parameter_of_value_zero_be_re_tuned(drawn):
    free = sledge(value=0.0, spread=math.inf)
    diagnosis = ModelDiagnosis(free, catalogue=CATALOGUE).fit(*drawn)
    assert diagnosis.verdict_ == "model_adequate"
    assert diagnosis.parameters_["d"].value == pytest.approx(DRAG, rel=0.02)


def test_re_tuning_goes_as_far_as_the_spread_and_no_further(drawn):
    X, y = drawn
    prior = sledge(value=0.9 * DRAG, spread=0.05)
    problem = build_problem(prior, read_records(prior, X, y))
    (mass, drag) = freedoms(problem, Hypothesis(), prior)
    assert (drag.low, drag.high) == pytest.approx((0.95 * 0.9 * DRAG, 1.05 * 0.9 * DRAG))
    assert drag.spread == pytest.approx(0.05 * 0.9 * DRAG / math.sqrt(3))  # of what is uniform
    assert (mass.low, mass.high) == pytest.approx((1.8, 2.2))
    fitter = HypothesisFitter(problem)
    assert fitter.base().fit.model.parameters["d"].value == pytest.approx(drag.high)
    assert fitter.prior is fitter.prior


CAUSE = effects.AsymmetricFriction("v")


def with_damping(value, spread):
    """Return the sledge's model with another damping."""
    damping = {"value": value, "spread": spread, "bounds": [0.0, 5.0]}
    return SLEDGE.replace(parameters={"m": 2.0, "d": damping})


def fits(rig, prior):
    """Return the fit with friction by direction as it is made, and in terms of the model."""
    fitter = HypothesisFitter(build_problem(prior, read_records(prior, *drive(rig, n_records=2))))
    base = fitter.base()
    first = fitter.converge(fitter.first_fit(fitter.subsample(base), CAUSE))
    trial = fitter.polish(fitter.fit_all(first, base))
    return trial, in_terms_of_the_model(fitter, trial)


def slopes(model):
    values = {name: p.value for name, p in model.parameters.items()}
    return np.array([values["d"] + values["dp_v"], values["d"] + values["dn_v"]])


@pytest.mark.slow
@pytest.mark.parametrize(("d", "forward", "backward"), [(0.2, 0.5, 0.0), (1.5, 0.0, 0.3)])
def test_common_damping_is_the_models_and_none_is_negative(d, forward, backward):
    true = SLEDGE.parameters["d"].value
    rig = SLEDGE + effects.AsymmetricFriction("v", 0.3, 0.5, forward, backward)
    trial, moved = fits(rig, with_damping(d, np.inf))
    assert {f.name for f in trial.fit.freedoms} - {f.name for f in moved.fit.freedoms} < {
        "dp_v",
        "dn_v",
    }
    assert "d" in {f.name for f in moved.fit.freedoms}
    assert moved.fit.objective == pytest.approx(trial.fit.objective, rel=1e-4)
    assert slopes(moved.fit.model) == pytest.approx(slopes(trial.fit.model), abs=0.02)
    values = {name: p.value for name, p in moved.fit.model.parameters.items()}
    assert values["d"] == pytest.approx(true + min(forward, backward), abs=0.1)
    assert values["dp_v"] == pytest.approx(forward, abs=0.15)
    assert values["dn_v"] == pytest.approx(backward, abs=0.15)
    assert min(values[name] for name in CAUSE.names().values()) >= 0.0


@pytest.mark.slow
def test_a_damping_that_is_known_well_keeps_its_value_where_friction_adds_to_it():
    true = SLEDGE.parameters["d"].value
    rig = SLEDGE + effects.AsymmetricFriction("v", 0.3, 0.5, 0.5, 0.9)
    trial, moved = fits(rig, with_damping(true, 0.1))
    assert moved is trial


@pytest.mark.slow
def test_no_cause_undoes_more_of_a_parameter_than_there_is():
    """The records say that the motor drives: a damping below zero, which the model excludes."""
    rig = SLEDGE.with_parameters(d=1e-3) + effects.AsymmetricFriction("v", 0.3, 0.5, -0.05, -0.02)
    trial, moved = fits(rig, with_damping(0.4, np.inf))
    assert slopes(trial.fit.model).min() >= -1e-12
    assert slopes(moved.fit.model).min() >= -1e-12
    assert trial.hypothesis == Hypothesis((CAUSE,))
