"""Laws of effects on stores, terminals and inputs: closed solutions, balances, and limits."""

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.scales import Scales
from sklearn_pgnn.physics.unit_check import check_units

pytestmark = pytest.mark.core

T = np.arange(0, 10, 0.01)
BODY = PhysicsModel(
    {"T": "degC"},
    {"T": "(P + UA*(Ta - T))/C"},
    {"C": {"value": 4.0, "unit": "J/K"}, "UA": {"value": 0.5, "unit": "W/K"}},
    {"P": "W", "Ta": "degC"},
    {"probe": "T"},
    initial_state={"T": 20.0},
)
CELL = PhysicsModel(
    {"z": ""},
    {"z": "I/Q"},
    {"Q": {"value": 40.0, "unit": "A s"}, "R0": {"value": 0.3, "unit": "Ohm"}, "c": 3.0},
    {"I": "A"},
    {"V": "c*z + R0*I"},
)
MOTOR = PhysicsModel(
    {"w": "rad/s", "T": "K"},
    {"w": "(Kt*(u - Kt*w)/R - b*w)/J", "T": "((u - Kt*w)**2/R - h*T)/Cth"},
    {"R": 1.2, "Kt": 0.08, "J": 4e-4, "b": 2e-4, "Cth": 25.0, "h": 0.6},
    {"u": "V"},
    inertia={"w": "J"},
)
COIL = PhysicsModel(
    {"i": "A", "v": "V"},
    {"i": "(u - R*i - v)/L", "v": "i/Cp"},
    {"R": 2.0, "L": 0.05, "Cp": 2e-3},
    {"u": "V"},
    {"current": "i"},
)
PAIR = PhysicsModel(
    {"T1": "K", "T2": "K"},
    {"T1": "(P - k*(T1 - T2))/C1", "T2": "k*(T1 - T2)/C2"},
    {"k": 0.5, "C1": 2.0, "C2": 5.0},
    {"P": "W"},
    initial_state={"T1": 10.0},
)
LAG = PhysicsModel({"y": "V"}, {"y": "(K*u - y)/tau"}, {"K": 2.0, "tau": 0.5}, {"u": "A"})


def run(model, *inputs, x0=None, t=T):
    columns = [np.broadcast_to(value, t.shape) for value in inputs]
    return model.simulate(t, np.column_stack(columns) if columns else None, x0, substeps=4)


def test_a_second_store_takes_what_the_first_one_gives_and_both_end_alike():
    tank = PhysicsModel({"h": "m"}, {"h": "q/A"}, {"A": 1.0}, {"q": "m^3/s"})
    k, time = 0.7, 2.0
    x = run(tank + effects.SecondStore("h", k, time), 0.0, x0=[1.0, 0.0]).x
    np.testing.assert_allclose(x[:, 0] + k * time * x[:, 1], 1.0, rtol=1e-9)
    np.testing.assert_allclose(x[:, 0] - x[:, 1], np.exp(-(k + 1 / time) * T), atol=1e-8)


def test_a_wall_is_the_network_of_two_resistors_and_a_capacitor():
    inner, outer, wall = 2.0, 0.8, 6.0
    series = inner * outer / (inner + outer)
    between = effects.StoreBetween("T(Ta)", wall / (inner + outer), inner / outer)
    model = BODY.with_parameters(UA=series) + between

    def rates(t, x):
        air, bricks = x
        into = inner * (bricks - air)
        return [(3.0 + into) / 4.0, (-into + outer * (5.0 - bricks)) / wall]

    known = solve_ivp(rates, (0, T[-1]), [20.0, 12.0], t_eval=T, rtol=1e-10, atol=1e-10).y.T
    np.testing.assert_allclose(run(model, 3.0, 5.0, x0=[20.0, 12.0]).x, known, atol=1e-6)


def test_what_follows_a_state_starts_at_it():
    begun = (BODY + effects.SecondStore("T", 0.1, 5.0)).replace(initial_state={"T": 31.0})
    assert run(begun, 0.0, 31.0).x[0].tolist() == [31.0, 31.0]
    late = BODY + effects.SensorLag("probe", 5.0)
    assert run(late, 0.0, 20.0).y[[0, -1], 0].tolist() == [20.0, 20.0]
    with pytest.raises(ModelError, match=r"settled: 'T_behind' expects an input, or a state"):
        begun.replace(settled={"T_behind": "UA"})
    with pytest.raises(ModelError, match="a state that is not settled itself, got 'T_behind'"):
        begun.replace(settled={"T_behind": "T_behind"})


def test_power_into_a_creeping_spring_is_stored_or_lost():
    stored, lost = sympy.sympify("m*v**2/2 + k*x**2/2"), sympy.sympify("d*v**2")
    energy = {"stored": str(stored), "supplied": "force*v", "dissipated": str(lost)}
    creeping = systems.cart_on_spring().replace(energy=energy) + effects.MaxwellBranch("v", 20.0)
    rates = {symbol(name): rate for name, rate in creeping.equations.items()}
    grows = sum(creeping.energy["stored"].diff(state) * rate for state, rate in rates.items())
    balance = grows - creeping.energy["supplied"] + creeping.energy["dissipated"]
    assert sympy.simplify(balance) == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_branch_of_a_cell_relaxes_towards_its_resistance(sign):
    cell = CELL.with_parameters(R0=0.3 * sign) + effects.RelaxationBranch("V(I)", 0.2, 1.5)
    rest = cell.replace(initial_state={"I_relaxed": 0.0}, settled={})
    y = run(rest, 2.0).y[:, 0] - 3.0 * 2.0 * T / 40.0
    np.testing.assert_allclose(y, sign * 2.0 * (0.3 + 0.2 * (1 - np.exp(-T / 1.5))), atol=1e-8)
    assert cell.parameters["Rr_V_I"].unit == "Ohm"


def test_two_branches_relax_apart():
    cell = CELL + effects.TwoRelaxationBranches("V(I)", 0.2, 0.4, 0.5, 6.0)
    begun = dict.fromkeys(("I_relaxed", "I_relaxed_slowly"), 0.0)
    y = run(cell.replace(initial_state=begun, settled={}), 2.0).y[:, 0] - 3.0 * 2.0 * T / 40.0
    known = 0.2 * (1 - np.exp(-T / 0.5)) + 0.4 * (1 - np.exp(-T / 3.0))
    np.testing.assert_allclose(y, 2.0 * (0.3 + known), atol=1e-8)


def test_a_sensor_follows_a_step_with_its_time_constant():
    held = PhysicsModel({"T": "K"}, {"T": "0"}, outputs={"probe": "2*T"}, initial_state={"T": 3.0})
    late = held + effects.SensorLag("probe", 0.5)
    assert late.initial_state["probe_lagged"] == 6.0
    y = run(late, x0=[3.0, 0.0]).y[:, 0]
    np.testing.assert_allclose(y, 6 * (1 - np.exp(-T / 0.5)), atol=1e-8)
    assert effects.SensorLag.targets(CELL) == ()  # a voltage shows the current at once


def test_a_coefficient_by_direction_warms_with_one_value_and_cools_with_another():
    turned = BODY + effects.CoefficientByDirection("UA", change=-0.6)
    warm, cool = (run(turned, 0.0, 20.0 + d).x[:, 0] - 20.0 - d for d in (5.0, -5.0))
    np.testing.assert_allclose(warm, -5 * np.exp(-0.4 * 0.5 * T / 4.0), rtol=1e-8)
    np.testing.assert_allclose(cool, 5 * np.exp(-0.5 * T / 4.0), rtol=1e-8)


def test_a_time_constant_by_direction_rises_with_one_value_and_falls_with_another():
    turned = LAG + effects.CoefficientByDirection("tau", change=1.0)
    up, down = (run(turned, u, x0=[0.0]).x[:, 0] / (2 * u) for u in (1.0, -1.0))
    np.testing.assert_allclose(up, 1 - np.exp(-T / 1.0), atol=1e-7)
    np.testing.assert_allclose(down, 1 - np.exp(-T / 0.5), atol=1e-7)


@given(st.floats(-0.9, 5.0), st.booleans())
def test_what_passes_from_one_store_to_another_is_not_lost_in_either_direction(change, turned):
    valve = PAIR + effects.CoefficientByDirection("k", change=change)
    x = run(valve, 0.0, x0=[0.0, 10.0] if turned else [10.0, 0.0], t=T[:100]).x
    held = x @ [2.0, 5.0]
    np.testing.assert_allclose(held, held[0], rtol=1e-9)


def test_a_resistance_by_direction_is_the_same_seen_from_either_store():
    capacities = {"C1": 2.0, "C2": 5.0}
    rates = {"a": "(b - a)/(R*C1)", "b": "(a - b)/(R*C2)"}
    wall = PhysicsModel({"a": "K", "b": "K"}, rates, {"R": 4.0, **capacities})
    assert "R" in effects.CoefficientByDirection.targets(wall)
    turned = wall + effects.CoefficientByDirection("R", change=1.0)  # where b is warmer than a
    for start, resistance in (([0.0, 10.0], 8.0), ([10.0, 0.0], 4.0)):
        x = run(turned, x0=start).x
        np.testing.assert_allclose(x @ [2.0, 5.0], np.dot(start, [2.0, 5.0]), rtol=1e-9)
        decayed = np.exp(-T / resistance * (1 / 2.0 + 1 / 5.0))
        np.testing.assert_allclose(np.diff(x).ravel(), np.diff(start) * decayed, atol=1e-7)


def test_a_coefficient_whose_flow_never_turns_is_not_tried():
    scales = Scales({}, {"u": 3.0, "y": 6.0}, {}, 0.01, 1.0, extremes={"u": (0.0, 3.0)})
    gain = effects.CoefficientByDirection("K")
    assert not gain.is_shown(LAG, scales)
    assert gain.is_shown(LAG, scales.of_either_sign(["u"]))
    assert effects.CoefficientByDirection.targets(systems.cart_on_spring()) == ()
    water = PhysicsModel({"T": "K"}, {"T": "UA*(Ta - T)/C"}, {"UA": 5.0, "C": 9e4}, {"Ta": "K"})
    assert effects.CoefficientByDirection.targets(water) == ("UA",)  # C would be the same


def test_radiation_is_between_absolute_temperatures():
    cooled = BODY.with_parameters(UA=1e-9) + effects.RadiationLoss("T(Ta)", 1e-9)
    kelvin = cooled.replace(states={"T": "K"}, inputs={"P": "W", "Ta": "K"})
    hot = (kelvin.replace(equations=BODY.equations, parameters=BODY.parameters)).with_parameters(
        UA=1e-9
    ) + effects.RadiationLoss("T(Ta)", 1e-9)
    in_degrees = run(cooled, 0.0, 20.0, x0=[400.0]).x[:, 0]
    in_kelvin = run(hot, 0.0, 293.15, x0=[673.15]).x[:, 0]
    np.testing.assert_allclose(in_degrees, in_kelvin - 273.15, rtol=1e-9)
    known = solve_ivp(
        lambda t, x: -1e-9 * (x**4 - 293.15**4), (0, T[-1]), [673.15], t_eval=T, rtol=1e-10
    )
    np.testing.assert_allclose(in_kelvin, known.y[0], rtol=1e-6)


@pytest.mark.parametrize("power", [0.25, 1.0])
def test_a_loss_with_a_power_falls_as_its_closed_solution(power):
    body = BODY.with_parameters(UA=1e-12) + effects.PowerLoss("T(Ta)", 0.1, power)
    warmer = run(body, 0.0, 20.0, x0=[50.0]).x[:, 0] - 20.0
    known = (30.0**-power + power * 0.1 * T) ** (-1 / power)
    np.testing.assert_allclose(warmer, known, rtol=1e-6)
    assert check_units(body) == ()


@given(st.floats(-0.9, 3.0), st.floats(0.1, 50.0), st.floats(0.01, 100.0))
def test_a_power_of_an_input_is_odd_and_right_at_its_reference(power, reference, u):
    effect = effects.InputPower("u")
    p = {"power": power, "reference": reference}

    def seen(value):
        return float(effect.seen(sympy.Float(value), p))

    assert seen(-u) == -seen(u)
    assert seen(reference) == pytest.approx(reference)
    if u > 1e-6 * reference:
        assert seen(u) == pytest.approx(reference * (u / reference) ** (1 + power), rel=1e-9)
    assert seen(0.0) == 0.0


@given(
    st.lists(st.floats(-1.0, 10.0), min_size=2, max_size=2),
    st.lists(st.floats(0.01, 5.0), min_size=2, max_size=2),
)
def test_a_curve_of_pieces_never_falls_and_goes_through_zero(slopes, knots):
    first, second = sorted(knots)
    p = {"below": slopes[0], "above": slopes[1], "first": first, "second": second}
    u = np.linspace(-8, 8, 65)
    seen = [float(effects.InputCurve("u").seen(sympy.Float(v), p)) for v in u]
    assert np.diff(seen).min() > -1e-9
    assert seen[32] == 0.0
    np.testing.assert_allclose(seen, -np.array(seen)[::-1], atol=1e-9)


def test_a_curve_holds_the_dead_zone_and_the_saturation():
    u = np.linspace(-5, 5, 41)
    p = {"below": -1.0, "above": -1.0, "first": 1.0, "second": 3.0}
    seen = [float(effects.InputCurve("u").seen(sympy.Float(v), p)) for v in u]
    np.testing.assert_allclose(seen, np.sign(u) * np.clip(np.abs(u) - 1, 0, 2))
    assert effects.InputCurve.targets(BODY) == ("P",)  # of a temperature zero is no rest


def test_a_parameter_may_depend_on_a_store_wherever_it_stands():
    assert "R(T)" in effects.ParameterSlope.targets(MOTOR)
    warm = MOTOR + effects.ParameterSlope("R(T)", slope=0.004)
    assert all(rate.has(symbol("slope_R_T")) for rate in warm.equations.values())
    assert "J(T)" not in effects.ParameterSlope.targets(MOTOR)  # no mass grows with heat
    assert "R0(z)" in effects.ParameterSlope.targets(CELL)
    assert effects.ParameterSlope.targets(LAG) == ("K(y)",)


def test_what_divides_a_rate_may_depend_on_its_own_store_and_a_lag_on_its_input():
    assert effects.ParameterSaturation.targets(COIL) == ("R(i)", "L(i)")
    assert {"tau(y)", "tau(u)"} < set(effects.ParameterSaturation.targets(LAG))
    iron = COIL + effects.ParameterSaturation("L(i)", bend=0.4)
    i, rate = symbol("i"), iron.equations["i"]
    numbers = {"R": 2.0, "L": 0.05, "bend_L_i": 0.4, "u": 1.0, "v": 0.5}
    at = {symbol(name): value for name, value in numbers.items()}
    for current in (-3.0, 2.0):
        known = (1.0 - 2.0 * current - 0.5) * (1 + 0.4 * current**2) / 0.05
        assert float(rate.subs(at | {i: current})) == pytest.approx(known)
    law = effects.ParameterSaturation("L(i)", bend=0.4)
    for other in (effects.SensorLag("current", 0.01), effects.Leak("i", 3.0)):  # in either order
        first, last = (model.equations["i"] for model in (COIL + law + other, COIL + other + law))
        assert sympy.simplify(first - last) == 0


def test_a_temperature_of_surroundings_depends_on_no_temperature():
    room = PhysicsModel(
        {"T1": "degC", "T2": "degC"},
        {"T1": "h*(Ta - T1)", "T2": "g*(Ta - T2) + a*q"},
        {"h": 0.1, "g": 0.2, "a": 1.0, "Ta": {"value": 20.0, "unit": "degC"}},
        {"q": "W"},
    )
    targets = effects.ParameterSlope.targets(room)
    assert "a(T1)" in targets
    assert not [target for target in targets if target.startswith("Ta(")]
