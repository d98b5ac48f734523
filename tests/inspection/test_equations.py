"""Equations and plots: only what was added is marked, and what is shown lies where it belongs."""

from xml.etree import ElementTree

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.inspection.equations import added_terms, cases_of, equations_of, mathml_of
from sklearn_pgnn.inspection.report.curves_section import in_sight
from sklearn_pgnn.inspection.svg import Plot, Scale, dot, mark, span, strip, thinned
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


ENDS = st.tuples(st.floats(-1e6, 1e6, allow_nan=False), st.floats(1e-3, 1e6, allow_nan=False)).map(
    lambda pair: (pair[0], pair[0] + pair[1])
)


@given(ENDS)
def test_ticks_are_few_round_and_on_the_axis(ends):
    ticks = Scale(*ends).ticks(6)
    assert 2 <= len(ticks) <= 7
    assert all(ends[0] - 1e-6 <= tick <= ends[1] + 1e-6 for tick in ticks)
    assert np.allclose(np.diff(ticks), ticks[1] - ticks[0])


@given(st.floats(1e-3, 1e3), st.floats(1.7, 1e5))
def test_ticks_of_a_logarithmic_axis_lie_on_it(low, factor):
    ticks = Scale(low, low * factor, log=True).ticks()
    assert ticks
    assert len(ticks) <= 6
    assert all(low * (1 - 1e-6) <= tick <= low * factor * (1 + 1e-6) for tick in ticks)


def test_places_run_from_the_low_to_the_high_end():
    assert Scale(1.0, 3.0).place([1.0, 2.0, 3.0]).tolist() == [0.0, 0.5, 1.0]
    assert Scale(1.0, 100.0, log=True).place(10.0) == pytest.approx(0.5)
    assert Scale(-0.0047, 0.0047).ticks(4) == [-0.004, -0.002, 0.0, 0.002, 0.004]


def test_what_is_not_finite_interrupts_a_curve():
    plot = Plot(Scale(0, 3), Scale(0, 1), "gap")
    plot.line([0, 1, 2, 3], [0, np.nan, 1, 1], "x")
    assert plot.html().count("M") == 2


def test_a_thinned_curve_keeps_its_extremes():
    x = np.arange(100000.0)
    y = np.sin(x / 7)
    y[54321] = 9.0
    few_x, few_y = thinned(x, y)
    assert few_x.size < 3000
    assert few_y.max() == 9.0
    assert np.all(np.diff(few_x) >= 0)


def test_names_are_escaped_and_the_whole_is_well_formed():
    plot = Plot(Scale(0, 1), Scale(-1, 1), '<b>"name"</b>')
    plot.line([0, 1], [0, 1], "x", "<script>")
    plot.points([0.5], [0.5], "x", "a & b")
    plot.shade(0.1, 0.2, "x")
    plot.band(-0.5, 0.5, "x")
    plot.cells([0.0], [0.0], 0.1, 0.1, "x", 0.5)
    plot.stems([0.5], [0.5], "x")
    ElementTree.fromstring(plot.html())
    shapes = [dot(0.5, "x", "<i>"), span(0, 1, "x"), mark(0.5, "x")]
    ElementTree.fromstring(strip("a < b", shapes))
    assert "<script>" not in plot.html()
    assert "style=" not in plot.html()


@pytest.mark.filterwarnings("error")
def test_an_output_that_a_record_lacks_is_drawn_as_simulated():
    axis = in_sight(np.full(5, np.nan), [np.linspace(0.0, 2.0, 5)])
    assert axis.low < 0.0 < 2.0 < axis.high
