"""What disturbs a machine from outside is no cause, and what is missing stays one beside it."""

from dataclasses import replace

import numpy as np
import pytest
from disturbed_cart import CART, drive

from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.disturbed import HeldOutWindows, disturbed_likelihood
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.physics.effects import (
    ActuatorLag,
    CoulombFriction,
    QuadraticDrag,
    SensorRectification,
)
from sklearn_pgnn.trajectories import read_records

SHARE = 0.05
NEEDED = SelectionCriterion(alpha=0.01, smallest_share=SHARE, n_candidates=30).to_name


def fitter_of(rig, disturbance, seed=0, **options):
    """Drive a rig on which a slow force of so many newtons acts; the model is the cart."""
    records = read_records(CART, *drive(rig, disturbance, seed, **options))
    return HypothesisFitter(build_problem(CART, records))


def with_cause(fitter, cause):
    """Fit a cause beside the cart."""
    base = fitter.base()
    first = fitter.converge(fitter.first_fit(fitter.subsample(base), cause))
    trial = fitter.fit_all(first, base)
    assert trial.fit.usable
    return trial


def gained(fitter, cause) -> float:
    """Return the evidence for a cause where something disturbs the machine."""
    return fitter.evidence_disturbed(fitter.base(), with_cause(fitter, cause), SHARE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cause", [CoulombFriction("v"), QuadraticDrag("v"), ActuatorLag("F")])
def test_a_disturbance_alone_names_nothing(cause, seed):
    assert gained(fitter_of(CART, 0.5, seed), cause) < NEEDED


@pytest.mark.slow
@pytest.mark.parametrize("disturbance", [0.0, 0.2])
@pytest.mark.parametrize(
    "hidden", [CoulombFriction("v", level=0.5), QuadraticDrag("v", 0.8), ActuatorLag("F", 0.08)]
)
def test_what_is_hidden_is_found_beside_a_disturbance(hidden, disturbance):
    fitter = fitter_of(CART + hidden, disturbance)
    assert gained(fitter, type(hidden)(hidden.target)) > NEEDED


@pytest.mark.slow
def test_a_finer_sensor_tells_no_less_for_what_is_nearly_right():
    """The rig creeps where dry friction sticks: a fine sensor sees it, and no law here tells it."""
    rates, found = {"x": "v", "v": "(F - d*v - c*x - 0.5*tanh(v/0.01))/m"}, []
    for noise in (1e-4, 1e-6):
        fitter = fitter_of(CART.replace(equations=rates), 0.2, noise=noise, substeps=40)
        trials = fitter.base(), with_cause(fitter, CoulombFriction("v"))
        found.append(fitter.evidence_disturbed(*trials, SHARE))
        assert found[-1] > NEEDED
        assert fitter.evidence_disturbed(*trials[::-1], SHARE) == pytest.approx(-found[-1])
    assert found[1] == pytest.approx(found[0], rel=0.1)


@pytest.mark.slow
def test_over_windows_a_disturbance_would_be_taken_for_a_cause():
    fitter = fitter_of(CART, 0.5, seed=2)
    trials = fitter.base(), with_cause(fitter, QuadraticDrag("v"))
    assert SelectionCriterion.evidence(*map(fitter.held_out, trials)) > NEEDED


@pytest.mark.parametrize("seed", range(3))
def test_the_innovations_teach_parameters_that_windows_alone_get_wrong(seed):
    fitter = fitter_of(CART, 0.5, seed)
    base = fitter.base()
    found, variance = fitter.held_out(base), fitter.problem.windows.scale**2
    seen = HeldOutWindows(fitter.problem, base.fit.freedoms, found, fitter.folds, variance)
    as_learned, again = seen.likelihoods()
    assert again > as_learned + 1.0


def test_a_hypothesis_that_cannot_be_fitted_has_no_likelihood():
    fitter = fitter_of(CART, 0.0)
    base = fitter.base()
    lost = replace(fitter.held_out(base), learned=(), x0=None)
    assert disturbed_likelihood(fitter.problem, base, lost, fitter.folds, np.ones(1)) == -np.inf


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_without_a_sign_is_one_beside_a_disturbance(seed):
    """The force is so large that the model alone does not know when the cart passes zero."""
    rig = CART.with_parameters(c=6.5) + SensorRectification("position")
    assert gained(fitter_of(rig, 4.0, seed), SensorRectification("position")) > NEEDED
