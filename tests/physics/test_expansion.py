"""Expressions are multiplied out as far as that is short, and never beyond."""

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.physics.expressions import MAX_TERMS, _terms, expanded

pytestmark = pytest.mark.core

a, b, c = sympy.symbols("a b c", real=True)
sums = st.recursive(
    st.sampled_from([a, b, c, sympy.Integer(2), sympy.sin(a)]),
    lambda part: (
        st.builds(sympy.Add, part, part)
        | st.builds(sympy.Mul, part, part)
        | st.builds(sympy.Pow, part, st.integers(2, 4))
    ),
    max_leaves=6,
)


@given(expression=sums)
def test_the_bound_of_terms_is_one(expression):
    if _terms(expression) <= MAX_TERMS:
        found = sympy.expand(expression)
        assert len(sympy.Add.make_args(found)) <= _terms(expression)
        assert expanded(expression) == found


@pytest.mark.parametrize(
    "expression",
    [
        (a + b + 1) ** 99,
        1 / (a + b + 1) ** 99,
        sympy.sin((a + b + 1) ** 99),
        sympy.Mul(*((a + b + k) ** 5 for k in range(9))),
        ((a + b + 1) ** 99 + (a - b) ** 99) ** 99,
    ],
)
def test_what_would_be_long_stays_as_it_is(expression):
    assert expanded(expression) is expression


def test_an_effect_finds_its_places_in_an_equation_that_nobody_multiplies_out():
    text = "(F + " + "*".join(f"(x + {k}*v + 1)**20" for k in range(1, 6)) + ")/m"
    model = PhysicsModel({"x": "m", "v": "m/s"}, {"x": "v", "v": text}, {"m": 2.0}, {"F": "N"})
    assert effects.CoulombFriction.targets(model) == ("v",)
    assert isinstance(effects.LoadFriction.targets(model), tuple)
