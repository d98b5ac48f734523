"""What a cause and a free parameter share belongs to the parameter."""

import numpy as np
import pytest
from sledge import SLEDGE, drive

from sklearn_pgnn import effects
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.shared_part import in_terms_of_the_model
from sklearn_pgnn.trajectories import read_records

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
