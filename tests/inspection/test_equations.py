"""Equations: only what was added is marked, friction is told case by case, minus signs are real."""

from xml.etree import ElementTree

import numpy as np
import pytest
import sympy

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.inspection.equations import added_terms, cases_of, equations_of, mathml_of
from sklearn_pgnn.physics import systems
from sklearn_pgnn.physics.expressions import symbol

CART = systems.cart_on_spring()
MOVING = {symbol(name) for name in (*CART.states, *CART.inputs)}
BENT = [
    effects.CoulombFriction("v", level=1.0),
    effects.StribeckFriction("v", level=1.0, peak=0.5, velocity=0.2),
    effects.AsymmetricFriction("v", level_forward=1.0, level_backward=2.0),
    effects.InputDeadZone("force", threshold=1.0),
    effects.InputSaturation("force", limit=2.0),
]


def added(effect):
    after, before = (CART + effect).equations["v"], CART.equations["v"]
    return sympy.Add(*added_terms(after, before)), CART + effect


@pytest.mark.parametrize("effect", BENT, ids=lambda effect: effect.id)
def test_cases_are_what_the_expression_is(effect):
    expression, model = added(effect)
    cases = cases_of(expression, MOVING)
    assert cases
    numbers = {symbol(name): p.value for name, p in model.parameters.items()}
    rng = np.random.default_rng(0)
    for _ in range(50):
        at = {name: rng.normal(scale=3.0) for name in MOVING}
        value = next(v for v, when in cases if bool(sympy.sympify(when).subs({**numbers, **at})))
        expected = expression.subs({**numbers, **at})
        assert float(value.subs({**numbers, **at})) == pytest.approx(float(expected))


def test_only_what_was_added_is_marked():
    rig = CART + effects.CoulombFriction("v", level=1.0)
    x, v = equations_of(rig, CART)
    assert 'class="added"' not in x.mathml
    marked = [
        "".join(part.itertext())
        for part in ElementTree.fromstring(v.mathml).iter()
        if part.get("class") == "added"
    ]
    assert len(marked) == 1
    assert "sign" in marked[0]
    assert "k" not in marked[0]
    assert all('class="added"' not in e.mathml for e in equations_of(CART, rig, marks=False))


def test_a_number_in_an_equation_has_no_more_digits_than_are_read():
    assert "<mn>4.42945</mn>" in mathml_of(sympy.sqrt(sympy.Float(2 * 9.81)))
    assert "<mn>101325</mn>" in mathml_of(sympy.Float(101325.0))


def test_numbers_stand_beside_their_symbols():
    rig = CART + effects.CoulombFriction("v", level=1.25)
    _, v = equations_of(rig, CART)
    new = [each for each in v.numbers if each.is_new]
    assert [each.value for each in new] == ["1.25 N"]
    assert len(v.numbers) == 4


def test_constants_come_before_what_moves():
    force, c = symbol("F"), symbol("c1")
    text = mathml_of(-(force**2) * c, {force})
    assert text.index("c") < text.index("<mi>F</mi>")
    assert "&#x2212;" in text
    ElementTree.fromstring(text)


def test_what_has_no_cases_has_none():
    model = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    (equation,) = equations_of(model, model)
    assert equation.cases == ""
