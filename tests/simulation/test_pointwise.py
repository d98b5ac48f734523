"""Expressions at samples, and functions of Python that compiled code calls."""

import math

import numpy as np
import pytest
import sympy

from sklearn_pgnn import effects, systems
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.priors import from_function
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.source import differentiate

pytestmark = pytest.mark.core


def test_the_slope_of_a_rate_with_limits_within_limits_is_that_of_its_differences():
    """A tank that spills below another one that spills: conditions within conditions."""
    tanks = systems.two_tanks() + effects.Overflow("x1", 8.0, 0.25, 0.6)
    tanks += effects.StateLimit("x2", 5.0, 0.25)
    draw, n = np.random.default_rng(0), 200
    table = {name: parameter.value for name, parameter in tanks.parameters.items()}
    table |= {
        "x1": draw.uniform(0, 10, n),
        "x2": draw.uniform(0, 7, n),
        "pump": draw.uniform(0, 9, n),
    }
    rate = tanks.equations["x2"]
    slope = evaluate_samples(differentiate(rate, symbol("x2")), table, n)
    step = 1e-6
    ahead, behind = (
        evaluate_samples(rate, table | {"x2": table["x2"] + d}, n) for d in (step, -step)
    )
    np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), rtol=1e-5, atol=1e-8)


def test_a_step_is_half_way_up_where_it_is():
    table = {"x": np.array([-1.0, 0.0, 2.0])}
    assert evaluate_samples(sympy.Heaviside(symbol("x")), table, 3).tolist() == [0.0, 0.5, 1.0]


T = np.arange(0, 2, 0.05)


@pytest.mark.slow
def test_what_a_function_raises_is_told_and_ends_the_simulation():
    def ends(t, x, u, p):
        return [math.sqrt(1.0 - t)]

    model = from_function(ends, {"y": "V"}, trace=False)
    with pytest.warns(SimulationWarning, match=r"ends, line \d+: ValueError: math domain error"):
        found = model.simulate(T)
    assert np.isfinite(found.y[:20]).all()
    assert np.isnan(found.y[-1])


def test_a_signal_ends_the_loop_and_is_raised_behind_it():
    def stops(t, x, u, p):
        if armed and t > 1.0:
            armed.clear()
            raise KeyboardInterrupt
        return [t - x[0]]

    armed: list[bool] = []
    model = from_function(stops, {"y": "V"}, trace=False)
    armed.append(True)
    with pytest.raises(KeyboardInterrupt):
        model.simulate(T)
    assert np.isfinite(model.simulate(T).y).all()
