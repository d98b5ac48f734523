"""A sensor that shows the magnitude only: either sign of a window's start may be the right one."""

import pytest

from sklearn_pgnn import effects, systems
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records


@pytest.mark.parametrize("seed", [2, 5])
def test_ways_through_zero_are_fitted_with_either_sign(seed):
    """Where a sensor shows the magnitude only, the true model leaves noise in every window."""
    cart = systems.cart_on_spring()
    options = {"n_records": 3, "sample_rate": 100.0, "random_state": seed}
    hidden = make_hidden_effect(cart, "sensor_rectification", **options)
    problem = build_problem(hidden.prior, read_records(hidden.prior, hidden.X, hidden.y))
    fitter = HypothesisFitter(problem)
    base, cause = fitter.base(), effects.SensorRectification("position")
    fit = fitter.converge(fitter.first_fit(fitter.subsample(base), cause))
    assert fitter.fit_all(fit, base).squares < 1.1 * problem.n_samples < 0.1 * base.squares
