"""Laws of how far an unstable model foresees."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.estimation.instability import growth_rate, horizon
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records

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
