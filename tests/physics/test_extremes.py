"""The largest and the smallest of several expressions."""

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn.physics.expressions import maximum, minimum, parse_expression, symbol, to_text

X, Y = symbol("x"), symbol("y")
NUMBERS = st.integers(-3, 3)
PARTS = st.recursive(
    st.sampled_from([X, Y, X - Y, X**2]) | NUMBERS.map(sympy.Integer),
    lambda part: st.builds(
        lambda kind, parts: kind(*parts),
        st.sampled_from([maximum, minimum]),
        st.lists(part, min_size=1, max_size=3),
    ),
    max_leaves=6,
)


@given(st.lists(PARTS, min_size=1, max_size=4), NUMBERS, NUMBERS)
def test_the_value_is_that_of_the_parts(parts, x, y):
    def at(expression):
        return float(expression.subs({X: x, Y: y}))

    values = [at(part) for part in parts]
    assert at(maximum(*parts)) == np.max(values)
    assert at(minimum(*parts)) == np.min(values)


@given(st.lists(PARTS, min_size=1, max_size=4))
def test_its_text_reads_back_to_itself(parts):
    found = maximum(*parts)
    again = parse_expression(to_text(found), ["x", "y"])
    assert again == parse_expression(to_text(again), ["x", "y"])
    assert float((again - found).subs({X: 1.5, Y: -0.5})) == 0.0


@pytest.mark.parametrize("kind", [maximum, minimum])
def test_what_is_equal_falls_into_one(kind):
    assert kind(X, X) == X
    assert kind(X, kind(Y, X)) == kind(Y, X)


def test_numbers_fall_into_one():
    assert maximum(1, 2.5, X).args[0] == 2.5
    assert minimum(3, sympy.pi) == 3
