"""Values at points are SymPy's own, and NaN where it finds no number."""

import numpy as np
import pytest
import sympy

from sklearn_pgnn import effects, systems
from sklearn_pgnn.estimation.point_values import number_at
from sklearn_pgnn.estimation.same_in_equations import values_at
from sklearn_pgnn.physics.expressions import TIME, symbol

X, Y = symbol("x"), symbol("y")


def by_sympy(expression, points):
    """Evaluate an expression point by point."""
    count = len(next(iter(points.values())))
    each = [{s: sympy.Float(v[i]) for s, v in points.items()} for i in range(count)]
    return np.array([number_at(expression, point) for point in each])


@pytest.mark.parametrize(
    "expression",
    [
        X**2 / 3 - sympy.pi * Y,
        sympy.sqrt(X) + Y,
        sympy.Abs(sympy.sqrt(X)),  # a number although the root is none
        sympy.log(X) * sympy.atan2(X, Y),
        sympy.Max(X, Y, 0) - sympy.Min(X, 2 * Y),
        sympy.diff(sympy.sign(X) * Y, X),
        sympy.diff(sympy.Max(X, Y), X),
        sympy.Heaviside(X) + sympy.DiracDelta(X),
        Y / X,
        sympy.Piecewise((X, X > Y), (Y**2, True)),
        sympy.tanh(X) + sympy.exp(-Y) * sympy.floor(X),
        sympy.Integer(3),
    ],
    ids=str,
)
def test_values_are_those_of_sympy(expression):
    points = {X: np.array([-1.5, -0.2, 0.0, 0.3, 2.0]), Y: np.array([0.7, -0.2, 1.0, -4.0, 2.0])}
    expected = by_sympy(expression, points)
    np.testing.assert_allclose(values_at([expression], points, 5)[0], expected, rtol=1e-13)


@pytest.mark.parametrize("system", [systems.cart_on_spring, systems.two_tanks])
def test_derivatives_by_the_parameters_of_effects_are_those_of_sympy(system):
    model, rng = system(), np.random.default_rng(0)
    for kind in effects.CATALOGUE:
        for target in list(kind.targets(model))[:1]:
            extended = model + kind(target)
            names = [*extended.states, *extended.inputs]
            points = {symbol(n): rng.normal(size=3) for n in names} | {TIME: rng.uniform(size=3)}
            points |= {symbol(n): np.full(3, p.value) for n, p in extended.parameters.items()}
            for name in kind(target).names().values():
                for rate in extended.equations.values():
                    slope = sympy.diff(rate, symbol(name))
                    found = values_at([slope], points, 3)[0]
                    np.testing.assert_allclose(found, by_sympy(slope, points), rtol=1e-12)
