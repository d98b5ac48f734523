"""Parameters and effects that say the same in the equations."""

import pytest

from sklearn_pgnn import effects, systems
from sklearn_pgnn.estimation.freedoms import held_by
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.possible_causes import possible_causes
from sklearn_pgnn.estimation.same_in_equations import held_parameters, same_causes, same_parameter

pytestmark = pytest.mark.core


@pytest.mark.slow
def test_an_effect_that_a_parameter_holds_is_no_candidate():
    golf = systems.golf_robot()
    assert same_parameter(golf, effects.ViscousFriction("omega")) == "d"
    assert same_parameter(golf, effects.CoulombFriction("omega")) is None
    candidates = {(effect.id, effect.target) for effect in possible_causes(golf, effects.CATALOGUE)}
    assert ("viscous_friction", "omega") not in candidates
    assert ("wrong_parameter", "d") in candidates
    assert held_parameters(golf, effects.AsymmetricFriction("omega")) == ("d",)


def test_a_cause_holds_what_it_can_stand_for_and_nothing_else():
    cart = systems.cart_on_spring()
    assert held_parameters(cart, effects.AsymmetricFriction("v")) == ("d",)
    assert held_parameters(cart, effects.EndStop("v")) == ()  # a spring without a gap is no stop
    assert held_parameters(cart, effects.WrongParameter("d")) == ()


def test_effects_that_say_the_same_are_one_candidate():
    cart = systems.cart_on_spring()
    candidates = possible_causes(
        cart, [effects.ConstantLoad, effects.InputBias, effects.SensorBias]
    )
    load, bias, sensor = candidates
    assert same_causes(cart, candidates)[load] == (bias,)
    assert same_causes(cart, candidates)[sensor] == ()


def test_delays_of_the_only_input_are_one_candidate():
    cart = systems.cart_on_spring()
    late, sensor = candidates = possible_causes(cart, [effects.InputDelay, effects.SensorDelay])
    assert same_causes(cart, candidates) == {late: (sensor,)}


def test_a_formula_may_hold_a_state_that_another_cause_adds():
    cart = systems.cart_on_spring()
    late = effects.InputRateLimit("force")
    (added,) = set((cart + late).states) - set(cart.states)
    formula = effects.Formula("v", (added, "v"), (1e-3, 1e-3))
    assert held_by(cart, Hypothesis((late, formula))) == {"d"}  # c2*v speaks for the damping
