"""Parameters at the ends of their spreads are found, and no others."""

import math
from functools import partial

import pytest

from sklearn_pgnn import Parameter, PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_spread_ends

pytestmark = pytest.mark.core


def tank(a=None, b=None, c=None):
    flow = partial(Parameter, value=2.0)
    parameters = {"a": a or flow("a"), "b": b or flow("b"), "c": c or flow("c")}
    return PhysicsModel({"h": "m"}, {"h": "a*u - b*h - c*h**2"}, parameters, {"u": "V"})


@pytest.mark.parametrize("value", [1.8, 2.2])
def test_either_end_counts(value):
    assert at_spread_ends(tank(), tank().with_parameters(b=value)) == ("b",)


def test_what_stays_inside_is_none():
    assert at_spread_ends(tank(), tank().with_parameters(a=2.19, b=1.81)) == ()


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        (Parameter("a", 2.0, bounds=(1.9, 2.1)), 2.1),
        (Parameter("a", 2.0, bounds=(1.8, 5.0)), 1.8),
        (Parameter("a", 2.0, bounds=(0.0, 5.0), spread=math.inf), 5.0),
        (Parameter("a", 0.0), 0.0),
    ],
    ids=["bounds within the spread", "a bound at its end", "no spread", "a share of zero"],
)
def test_an_end_that_no_spread_makes_is_none(parameter, value):
    model = tank(a=parameter)
    assert at_spread_ends(model, model.with_parameters(a=value)) == ()
