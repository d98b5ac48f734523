"""Expressions of models, evaluated at samples."""

import numpy as np
import pytest
import sympy

from sklearn_pgnn import effects, systems
from sklearn_pgnn.physics.expressions import symbol
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
