"""Candidates: what a model may lack, what it already holds, and what says the same."""

import pytest

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.estimation.hypothesis import (
    held_parameters,
    possible_causes,
    same_causes,
    same_parameter,
)

pytestmark = pytest.mark.core

#: an oven that loses heat to surroundings whose temperature is an input
OVEN = PhysicsModel(
    {"T": "K"}, {"T": "P/C - (T - Ts)/R"}, {"C": 500.0, "R": 100.0}, {"P": "W", "Ts": "K"}
)


@pytest.mark.slow
def test_an_effect_that_a_parameter_holds_is_no_suspect():
    golf = systems.golf_robot()
    assert same_parameter(golf, effects.ViscousFriction("omega")) == "d"
    assert same_parameter(golf, effects.CoulombFriction("omega")) is None
    suspects = {(effect.id, effect.target) for effect in possible_causes(golf, effects.CATALOGUE)}
    assert ("viscous_friction", "omega") not in suspects
    assert ("wrong_parameter", "d") in suspects
    assert held_parameters(golf, effects.AsymmetricFriction("omega")) == ("d",)


def test_a_cause_holds_what_it_can_stand_for_and_nothing_else():
    cart = systems.cart_on_spring()
    assert held_parameters(cart, effects.AsymmetricFriction("v")) == ("d",)
    assert held_parameters(cart, effects.EndStop("v")) == ()  # a spring without a gap is no stop
    assert held_parameters(cart, effects.WrongParameter("d")) == ()


def test_roots_of_what_may_be_negative_are_no_obstacle():
    rates = {"h": "k4*u - k1*sqrt(h)", "g": "k1*sqrt(h) - k3*sqrt(g)"}
    tanks = PhysicsModel(
        {"h": "m", "g": "m"}, rates, {"k1": 0.1, "k3": 0.1, "k4": 0.2}, {"u": "V"}, {"level": "g"}
    )
    suspects = possible_causes(tanks, effects.CATALOGUE)
    assert {effects.Leak("h"), effects.StateLimit("g")} <= set(suspects)


@pytest.mark.parametrize("kind", effects.CATALOGUE, ids=lambda kind: kind.id)
def test_an_effect_that_the_model_was_extended_by_is_no_suspect(kind):
    models = systems.cart_on_spring(), systems.two_tanks(), OVEN
    model, target = next((model, t) for model in models for t in kind.targets(model))
    suspects = possible_causes(model + kind(target), effects.CATALOGUE)
    assert (kind(target) in suspects) is (not kind.quantities())


def test_effects_that_say_the_same_are_one_suspect():
    cart = systems.cart_on_spring()
    suspects = possible_causes(cart, [effects.ConstantLoad, effects.InputBias, effects.SensorBias])
    load, bias, sensor = suspects
    assert same_causes(cart, suspects)[load] == (bias,)
    assert same_causes(cart, suspects)[sensor] == ()


def test_delays_of_the_only_input_are_one_suspect():
    cart = systems.cart_on_spring()
    late, sensor = suspects = possible_causes(cart, [effects.InputDelay, effects.SensorDelay])
    assert same_causes(cart, suspects) == {late: (sensor,)}
