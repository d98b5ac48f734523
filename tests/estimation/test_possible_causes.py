"""Candidates: what a model may lack, what it already holds, and what says the same in it."""

import pytest

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.estimation.freedoms import held_by
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.possible_causes import (
    check_targets,
    possible_causes,
    warn_of_taken_names,
)
from sklearn_pgnn.estimation.same_in_equations import held_parameters, same_causes, same_parameter
from sklearn_pgnn.exceptions import OptionError

pytestmark = pytest.mark.core

#: an oven that loses heat to surroundings whose temperature is an input
OVEN = PhysicsModel(
    {"T": "K"}, {"T": "P/C - (T - Ts)/R"}, {"C": 500.0, "R": 100.0}, {"P": "W", "Ts": "K"}
)
#: two inertias on a shaft
SHAFT = PhysicsModel(
    {"a": "rad", "b": "rad", "v": "rad/s", "w": "rad/s"},
    {"a": "v", "b": "w", "v": "(u - k*(a - b))/J", "w": "(k*(a - b) - d*w)/J"},
    {"J": 0.01, "k": 30.0, "d": 0.02},
    {"u": "N m"},
)
#: a cell whose current is in its voltage
CELL = PhysicsModel(
    {"z": ""}, {"z": "I/Q"}, {"Q": 40.0, "c": 3.0, "R0": 0.3}, {"I": "A"}, {"V": "c*z + R0*I"}
)


def test_roots_of_what_may_be_negative_are_no_obstacle():
    rates = {"h": "k4*u - k1*sqrt(h)", "g": "k1*sqrt(h) - k3*sqrt(g)"}
    tanks = PhysicsModel(
        {"h": "m", "g": "m"}, rates, {"k1": 0.1, "k3": 0.1, "k4": 0.2}, {"u": "V"}, {"level": "g"}
    )
    candidates = possible_causes(tanks, effects.CATALOGUE)
    assert {effects.Leak("h"), effects.StateLimit("g")} <= set(candidates)


@pytest.mark.parametrize("kind", effects.CATALOGUE, ids=lambda kind: kind.id)
def test_an_effect_that_the_model_was_extended_by_is_no_candidate(kind):
    models = systems.cart_on_spring(), systems.two_tanks(), OVEN, SHAFT, CELL
    model, target = next((model, t) for model in models for t in kind.targets(model))
    candidates = possible_causes(model + kind(target), effects.CATALOGUE)
    assert (kind(target) in candidates) is (not kind.quantities())


def test_the_targets_of_an_effect_of_ones_own_are_known():
    class Gear(effects.CoulombFriction):
        id = "gear"

        @classmethod
        def targets(cls, model):
            return ["gear of T"]

    check_targets(OVEN, ["gear of T"], [Gear])
    with pytest.raises(OptionError, match="got 'gear of T'"):
        check_targets(OVEN, ["gear of T"])


def motor(inductance):
    rates = {"i": f"(u - R*i - k*w)/{inductance}", "w": "(k*i - b*w)/J"}
    numbers = {inductance: 0.01, "R": 1.0, "k": 0.1, "b": 0.001, "J": 0.002}
    return PhysicsModel({"i": "A", "w": "rad/s"}, rates, numbers, {"u": "V"}, inertia={"w": "J"})


def test_a_name_that_the_model_uses_otherwise_is_told_of():
    with pytest.warns(UserWarning, match=r"state_limit of 'i' is not considered.*'L_i'.*rename"):
        warn_of_taken_names(motor("L_i"), effects.CATALOGUE)


@pytest.mark.parametrize("kind", effects.CATALOGUE, ids=lambda kind: kind.id)
def test_an_extended_model_uses_no_name_otherwise(kind, recwarn):
    models = systems.cart_on_spring(), systems.two_tanks(), OVEN, SHAFT, CELL
    model, target = next((model, t) for model in models for t in kind.targets(model))
    warn_of_taken_names(model + kind(target), effects.CATALOGUE)
    assert not recwarn


def test_where_the_time_is_up_the_rest_of_the_catalogue_is_not_listed():
    whole = possible_causes(OVEN, effects.CATALOGUE)
    left = iter([False] * 5)
    some = possible_causes(OVEN, effects.CATALOGUE, each_step=lambda: next(left, True))
    assert 0 < len(some) < len(whole)
    assert some == whole[: len(some)]
    assert len(same_causes(OVEN, whole, lambda: True)) == 0


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
