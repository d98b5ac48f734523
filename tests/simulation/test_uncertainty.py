"""Laws of the errors of parameters: those of a regression that can be solved by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from sklearn_pgnn.simulation.uncertainty import correlations, overdispersion, standard_errors
from sklearn_pgnn.simulation.window_fit import ParameterPrior
from sklearn_pgnn.simulation.windows import Evaluation

pytestmark = pytest.mark.core

WINDOWS, SAMPLES = 400, 25


def regression(pushed=0.0, unit=1.0, noise=1.0, seed=0):
    """Return a fit of ``y = p s`` over windows, some of which are pushed along ``s`` together.

    The state has no effect.
    """
    rng = np.random.default_rng(seed)
    slope = unit * rng.normal(size=(WINDOWS, SAMPLES))
    left = noise * rng.normal(size=slope.shape) + pushed * slope * rng.normal(size=(WINDOWS, 1))
    p = (slope * left).sum() / (slope**2).sum()
    columns = np.stack([slope, np.zeros(slope.shape), left - p * slope], axis=-1)
    gram = np.einsum("wni,wnj->wij", columns, columns)[:, None]
    free = ParameterPrior("p", -np.inf, np.inf, 0.0, np.inf, 1.0)
    fit = SimpleNamespace(
        freedoms=(free,),
        usable=True,
        x0=np.zeros((WINDOWS, 1)),
        evaluation=Evaluation(gram, columns[..., -1].reshape(-1, 1), np.zeros((WINDOWS, 1))),
    )
    return fit, np.zeros((WINDOWS, 1)), np.ones(1)


def test_the_error_of_a_slope_is_the_known_one():
    errors = standard_errors(*regression())
    assert errors["p"] == pytest.approx(1 / np.sqrt(WINDOWS * SAMPLES), rel=0.15)


def test_an_error_is_in_the_unit_of_its_parameter():
    one, other = standard_errors(*regression()), standard_errors(*regression(unit=1e3))
    assert other["p"] == pytest.approx(1e-3 * one["p"])


def test_what_is_pushed_along_a_parameter_counts_for_less_by_the_known_factor():
    pushed = 0.5
    known = 1 + (SAMPLES + 2) * pushed**2  # variance of the sum of s (noise + b s) over a window
    whole = 1 + pushed**2
    quiet, loud = (overdispersion(*regression(b), d)["p"] for b, d in ((0, 1), (pushed, whole)))
    assert quiet == pytest.approx(1.0, abs=0.15)
    assert loud == pytest.approx(known / whole, rel=0.3)


def test_white_residuals_of_any_power_count_whole_and_units_do_not_matter():
    one = overdispersion(*regression(noise=1.0), 1.0)["p"]
    assert overdispersion(*regression(noise=5.0), 25.0)["p"] == pytest.approx(one)
    assert overdispersion(*regression(unit=1e-3), 1.0)["p"] == pytest.approx(one)


@pytest.mark.parametrize("dispersion", [1.0, 1e6])
def test_overdispersion_is_never_below_one(dispersion):
    assert overdispersion(*regression(), dispersion)["p"] >= 1.0


def test_what_could_not_be_fitted_has_no_errors():
    fit, *expected = regression()
    fit.usable = False
    assert standard_errors(fit, *expected) == {"p": np.inf}
    assert overdispersion(fit, *expected, 1.0) == {"p": 1.0}


def test_slopes_that_are_excited_alike_are_as_correlated_as_the_known_formula_says():
    rng = np.random.default_rng(0)
    one = rng.normal(size=(WINDOWS, SAMPLES))
    alike = 0.8
    other = alike * one + np.sqrt(1 - alike**2) * rng.normal(size=one.shape)
    left = rng.normal(size=one.shape)
    columns = np.stack([one, other, np.zeros(one.shape), left], axis=-1)
    gram = np.einsum("wni,wnj->wij", columns, columns)[:, None]
    free = tuple(ParameterPrior(n, -np.inf, np.inf, 0.0, np.inf, 1.0) for n in "pq")
    fit = SimpleNamespace(
        freedoms=free,
        usable=True,
        x0=np.zeros((WINDOWS, 1)),
        evaluation=Evaluation(gram, left.reshape(-1, 1), np.zeros((WINDOWS, 1))),
    )
    found = correlations(fit, np.zeros((WINDOWS, 1)), np.ones(1))
    assert np.diag(found) == pytest.approx(1.0)
    assert found[0, 1] == pytest.approx(-alike, abs=0.05)
