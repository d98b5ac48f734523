"""A function without an equation is an atom of equations, with slopes."""

import copy
import math
import pickle

import numpy as np
import pytest
import sympy

from sklearn_pgnn.physics.expressions import standard_form, symbol
from sklearn_pgnn.physics.external import external, external_function, take_failures

pytestmark = pytest.mark.core

X, Y = symbol("x"), symbol("y")


def both(point):
    x, y = point
    return x**2 * y, math.sin(x) + y


def branches(point):
    (x,) = point
    return (3.0 * x + (1.0 if x > 0 else -1.0), abs(x))


FUNCTION = external_function(both, "f", ["x", "y"], ["a", "b"], n_parameters=1)
A, B = (external(FUNCTION, k, (0, 1)) for k in (0, 1))


@pytest.mark.parametrize("at", [(0.7, 2.0), (-300.0, 1e-3), (1e-3, 40.0)])
def test_slopes_are_those_of_the_function(at):
    x, y = at
    slopes = [A(X, Y).diff(s).func.number(*at) for s in (X, Y)]
    assert slopes == pytest.approx([2 * x * y, x**2], rel=1e-7, abs=1e-9)
    second = A(X, Y).diff(X, X).func.number(*at)
    assert second == pytest.approx(2 * y, rel=1e-3)


def test_a_jump_and_a_kink_contribute_nothing():
    function = external_function(branches, "g", ["x"], ["jump", "kink"])
    jump, kink = (external(function, k, (0,), (0,)) for k in (0, 1))
    assert jump.number(0.0) == pytest.approx(3.0)
    assert abs(kink.number(0.0)) <= 1.0


def test_its_arguments_may_be_expressions():
    slope = B(2 * X, Y).diff(X)
    assert float(slope.subs({X: 0.5, Y: 0.0})) == pytest.approx(2 * math.cos(1.0))


def test_its_text_is_to_read_and_an_equation_keeps_it():
    rate = A(X, Y) / Y + X
    assert str(A(X, Y)) == "f[a](x; y)"
    assert standard_form(rate, ("x", "y")) == rate


def test_it_is_pickled_and_copied_as_itself():
    rate = 2 * A(X, Y).diff(X) + B(X, Y)
    assert pickle.loads(pickle.dumps(rate)) == rate
    assert copy.deepcopy(rate) == rate
    assert external_function(both, "f", ["x", "y"], ["a", "b"], 1) is FUNCTION


def test_another_function_of_the_same_name_is_another():
    tables = [[0.0, 1.0], [0.0, 2.0]]
    one, other = (
        external_function(lambda point, t=t: (np.interp(point[0], [0.0, 1.0], t),), "f", "x", "y")
        for t in tables
    )
    assert one.token != other.token
    assert one.at((0.5,)) != other.at((0.5,))


def test_numpy_calls_it_number_by_number():
    x = np.linspace(0, 1, 5)
    found = sympy.lambdify([X, Y], B(X, Y), "numpy")(x, 1.0)
    np.testing.assert_allclose(found, np.sin(x) + 1.0)


def test_what_it_raises_is_no_number_and_noted_with_its_line():
    def fails(point):
        return (math.sqrt(point[0]),)

    take_failures()
    assert math.isnan(external(external_function(fails, "h", "x", "y"), 0, (0,)).number(-1.0))
    (said,) = take_failures()
    assert said.startswith("h, line ")
    assert "ValueError: math domain error" in said
