"""Laws of the effects that have a state, a limit or a memory: known without the package."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.spectral_lines import find_lines
from sklearn_pgnn.physics.scales import Scales
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

T = np.arange(0, 10, 0.01)


def block():
    return PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "F/m"},
        {"m": {"value": 2.0, "unit": "kg"}},
        {"F": "N"},
        {"position": "x"},
        inertia={"v": "m"},
    )


def gain():
    """Return a fast lag, whose output nearly is its input."""
    return PhysicsModel({"y": ""}, {"y": "(u - y)/T"}, {"T": 0.02}, {"u": ""})


def lag(**changes):
    return PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 1.0}, {"u": "V"}, **changes)


def test_a_rate_limit_is_the_largest_slope():
    y = (lag() + effects.RateLimit("y", limit=0.3)).simulate(T, 2 * np.sign(np.sin(T))).y[:, 0]
    assert np.abs(np.diff(y) / 0.01).max() == pytest.approx(0.3, rel=1e-6)


def test_a_state_limit_is_never_passed():
    limited = lag() + effects.StateLimit("y", limit=1.2, steepness=20.0)
    y = limited.simulate(T, 2 * np.sign(np.sin(T)), substeps=4).y[:, 0]
    assert np.abs(y).max() == pytest.approx(1.2, rel=1e-3)


def test_a_limit_beyond_the_peak_still_slows_a_level_down():
    soft = lag() + effects.StateLimit("y", limit=1.2, steepness=2.0)
    y = soft.simulate(T, 2 * np.sign(np.sin(T))).y[:, 0]
    peak, rate = np.abs(y).max(), np.sqrt(np.mean(np.gradient(y, T) ** 2))
    scales = Scales({}, {"y": peak}, {"y": rate}, 0.01, 2.0)
    low, high = effects.StateLimit.limits("y", soft, scales)["limit"]
    assert low < peak < 1.2 < high


def test_a_leak_empties_exponentially():
    tank = PhysicsModel({"h": "m"}, {"h": "q"}, {"A": 1.0}, {"q": "m/s"}, initial_state={"h": 1.0})
    h = (tank + effects.Leak("h", coefficient=0.4)).simulate(T, np.zeros(T.size)).y[:, 0]
    np.testing.assert_allclose(h, np.exp(-0.4 * T), rtol=1e-8)


def test_backlash_is_the_play_operator():
    u = np.sin(T)
    played = gain() + effects.InputBacklash("u", width=0.8, time_constant=0.01)
    y = played.simulate(T, u, substeps=4).y[:, 0]
    play = np.zeros(T.size)
    for k in range(1, T.size):
        play[k] = min(max(play[k - 1], u[k] - 0.4), u[k] + 0.4)
    assert np.abs(y - play).max() < 0.05


def test_the_width_of_a_play_is_the_way_from_flank_to_flank():
    """A command that reverses travels the width before the machine follows, as a gauge shows it."""
    u = np.interp(T, [0.0, 0.5 * T[-1], T[-1]], [0.0, 2.0, -2.0])
    played = gain() + effects.InputBacklash("u", width=0.6, time_constant=0.01)
    y = played.simulate(T, u, substeps=4).y[:, 0]
    back = np.argmax(u)
    follows = np.flatnonzero(y > y.max() - 0.01)[-1]
    assert u[back] - u[follows] == pytest.approx(0.6, abs=0.05)


def test_a_slewing_actuator_needs_time_in_proportion():
    slewing = gain() + effects.InputRateLimit("u", limit=0.5, time_constant=0.01)
    y = slewing.simulate(T, np.full(T.size, 2.0), [0.0, 0.0], substeps=4).y[:, 0]
    middle = (T > 1) & (T < 3)
    np.testing.assert_allclose(y[middle], 0.5 * (T[middle] - 0.02), atol=0.01)
    assert y[T > 5] == pytest.approx(2.0, rel=1e-3)


def test_hysteresis_stays_within_its_level_and_encloses_an_area():
    rig = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F - k*x - d*v)/m"},
        {"m": 0.1, "k": 1.0, "d": 1.0},
        {"F": "N"},
        inertia={"v": "m"},
    ) + effects.Hysteresis("v", level=0.5, deflection=0.05)
    run = rig.simulate(T, 3 * np.sin(2 * T), substeps=8)
    x, v, zeta = run.x.T
    assert np.abs(zeta).max() <= 1.0 + 1e-6
    assert np.abs(zeta).max() > 0.99
    loss = trapezoid(0.5 * zeta * v, T)
    assert loss > 0.5 * 0.5 * np.abs(np.diff(x)).sum()


def test_an_end_stop_holds_what_it_stores():
    stopped = block() + effects.EndStop("v", upper=0.5, lower=-0.5, stiffness=400.0)
    run = stopped.simulate(T, np.zeros(T.size), [0.0, 1.0], substeps=20)
    x, v = run.x.T
    energy = v**2 + 200.0 * (np.maximum(x - 0.5, 0) ** 2 + np.minimum(x + 0.5, 0) ** 2)
    np.testing.assert_allclose(energy, 1.0, rtol=1e-4)
    assert np.abs(x).max() == pytest.approx(0.5 + np.sqrt(1 / 200.0), rel=1e-3)


def test_stops_stand_near_the_ends_of_the_travel():
    seen = Scales({}, {"x": 0.5}, {}, 0.01, 2.0, extremes={"x": (-0.1, 0.5)})
    limits = effects.EndStop.limits("v", block(), seen)
    assert limits["upper"] == pytest.approx((0.35, 0.5))
    assert limits["lower"] == pytest.approx((-0.1, 0.05))


def test_a_late_sensor_shows_what_was():
    u = np.where(T > 1, np.sin(T - 1), 0.0)
    late = (lag() + effects.SensorDelay("y", delay=0.5)).simulate(T, u).y[:, 0]
    now = lag().simulate(T, u).y[:, 0]
    np.testing.assert_allclose(late[50:], now[:-50], atol=1e-9)


def test_sensors_that_end_or_see_a_magnitude():
    u = 2 * np.sin(T)
    now = lag().simulate(T, u).y[:, 0]
    ended = (lag() + effects.SensorSaturation("y", upper=0.7, lower=-0.2)).simulate(T, u).y[:, 0]
    seen = (lag() + effects.SensorRectification("y")).simulate(T, u).y[:, 0]
    np.testing.assert_allclose(ended, np.clip(now, -0.2, 0.7))
    np.testing.assert_allclose(seen, np.abs(now))


def test_a_drifting_parameter_moves_with_the_clock():
    drifting = PhysicsModel({"y": ""}, {"y": "-k*y"}, {"k": 0.3}, initial_state={"y": 1.0})
    y = (drifting + effects.ParameterDrift("k", rate=0.2)).simulate(T).y[:, 0]
    np.testing.assert_allclose(y, np.exp(-0.3 * (T + 0.1 * T**2)), rtol=1e-7)


def test_a_force_accelerates_the_mass_that_there_is():
    heavier = block() + effects.ParameterDrift("m", rate=0.5) + effects.ConstantLoad("v", load=0.8)
    v = heavier.simulate(T, np.zeros(T.size)).x[:, 1]
    np.testing.assert_allclose(v, -0.8 / (2.0 * 0.5) * np.log(1 + 0.5 * T), atol=1e-8)
    assert heavier.unit("F0_v") == "N"


@pytest.mark.parametrize("kind", effects.CATALOGUE, ids=lambda kind: kind.id)
def test_a_mass_that_drifts_and_another_effect_are_one_model_in_either_order(kind):
    cart, drift = systems.cart_on_spring(), effects.ParameterDrift("m")
    for effect in map(kind, kind.targets(cart)):
        if effect != drift:
            one, other = cart + drift + effect, cart + effect + drift
            assert dict(one.equations) == dict(other.equations)
            assert {n: p.unit for n, p in one.parameters.items()} == {
                n: p.unit for n, p in other.parameters.items()
            }


def test_a_disturbance_is_found_in_the_spectrum_of_what_is_missing():
    shaken = block() + effects.PeriodicDisturbance("v", sine=1.0, frequency=1.7)
    F = 2 * np.sin(0.9 * T) + np.sin(2.3 * T)
    x = shaken.simulate(T, F).y[:, 0] + 1e-4 * np.random.default_rng(0).standard_normal(T.size)
    problem = build_problem(block(), read_records(block(), np.column_stack([T, F]), x))
    estimate = problem.states.estimate(block())
    tones, _ = find_lines(block(), problem.windows, estimate.x)
    assert min(abs(tone - 1.7) for tone in tones["v"]) < 0.06
    assert problem.scales.tones == tones


@pytest.mark.parametrize("kind", [effects.ActuatorLag, effects.InputRateLimit])
def test_the_fastest_actuator_a_fit_may_try_is_stable_in_a_step_a_sample(kind):
    model = lag()
    ground = build_problem(model, read_records(model, np.column_stack([T, np.sin(T)]), np.sin(T)))
    fastest = kind.limits("u", model, ground.scales)["time_constant"][0]
    step = np.median(np.diff(T))
    z = -step / fastest
    assert abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24) < 1  # Runge and Kutta's scheme


def test_dry_friction_is_offered_where_a_signal_may_be_a_speed():
    def first_order(unit, rate="(K*u - y)/T", output="y"):
        values = {"K": 2.0, "T": 1.0}
        return PhysicsModel({"y": unit}, {"y": rate}, values, {"u": ""}, {"s": output})

    dry = effects.CoulombFriction
    for unit in ("V", "", "rad/s", "%"):
        assert dry.targets(first_order(unit)) == ("y",)
    limited = first_order("V") + effects.StateLimit("y", limit=5.0)
    assert dry.targets(limited + effects.SensorGain("s", error=0.1)) == ("y",)
    for unit in ("K", "m", "bar", "A"):
        assert dry.targets(first_order(unit)) == ()
    assert dry.targets(first_order("V", rate="K*u - T*sqrt(max(y, 0))")) == ()  # a level
    assert dry.targets(first_order("V", output="u")) == ()  # nobody sees it


@pytest.mark.parametrize("start", [-3.0, -1.0, 0.0, 1.0, 3.0])
@pytest.mark.parametrize("shape", [-0.5, 0.5, 1.0])
def test_hysteresis_does_not_run_away_from_where_a_window_starts(start, shape):
    effect = effects.Hysteresis("v", level=2.0, deflection=0.01, shape=shape)
    model = systems.cart_on_spring() + effect
    t = np.arange(0, 10, 0.01)
    run = model.simulate(t, 10 * np.sin(t), [0.0, 0.5, start], substeps=4)
    assert np.abs(run.x[:, 2]).max() <= max(1.0, abs(start)) + 1e-6


def test_an_uneven_dead_zone_lets_through_what_is_beyond_either_end():
    u = 2 * np.sin(T)
    seen = effects.AsymmetricDeadZone("u", above=0.5, below=0.2)
    y = (gain() + seen).simulate(T, u, hold="foh", substeps=4).y[:, 0]
    expected = np.where(u > 0.5, u - 0.5, np.where(u < -0.2, u + 0.2, 0.0))
    assert np.abs(y - expected).max() < 0.05
    even = gain() + effects.AsymmetricDeadZone("u", above=0.3, below=0.3)
    plain = gain() + effects.InputDeadZone("u", threshold=0.3)
    np.testing.assert_array_equal(even.simulate(T, u).y, plain.simulate(T, u).y)


def test_friction_that_differs_by_direction_is_coulomb_friction_and_a_load():
    """Where it slides and where it holds: 3 N forward, 1 N back are 2 N and a load of 1 N."""
    u = 4 * np.sin(T)
    uneven = block() + effects.AsymmetricFriction("v", 3.0, 1.0)
    sum_ = block() + effects.CoulombFriction("v", 2.0) + effects.ConstantLoad("v", 1.0)
    one, other = (each.simulate(T, u, substeps=4).x for each in (uneven, sum_))
    assert 0.1 < np.mean(one[:, 1] == 0.0) < 0.5
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_what_leaks_goes_to_the_level_around_it():
    room = 20.0
    rates, inputs = {"h": "q"}, {"q": "K/s", "room": "K"}
    tank = PhysicsModel({"h": "K"}, rates, {}, inputs, initial_state={"h": 50.0})
    expected = room + 30.0 * np.exp(-0.4 * T)
    u = np.column_stack([np.zeros(T.size), np.full(T.size, room)])
    for effect in (
        effects.LeakToLevel("h", coefficient=0.4, level=room),
        effects.LeakToInput("h(room)", coefficient=0.4),
    ):
        np.testing.assert_allclose((tank + effect).simulate(T, u).y[:, 0], expected, rtol=1e-8)
    assert effects.LeakToInput.targets(tank) == ("h(room)",)  # q has another unit
    assert effects.LeakToInput.title("h(room)") == "leak of h to room"


def test_friction_that_grows_with_the_load_takes_its_share_of_the_drive():
    rubbed = block() + effects.LoadFriction("v", level=0.5, share=0.25)
    F = 4.0
    v = rubbed.simulate(T, np.full(T.size, F)).x[:, 1]
    np.testing.assert_allclose(v, (F - 0.5 - 0.25 * F) / 2.0 * T, atol=1e-9)
    weak = rubbed.simulate(T, np.full(T.size, 0.6)).x[:, 1]  # below level/(1 - share)
    assert np.abs(weak).max() == 0.0


def test_the_load_of_friction_is_what_drives_it_and_not_the_friction_itself():
    shaft = PhysicsModel(
        {"w": "rad/s", "i": "A"},
        {"w": "(K*i - d*w)/J", "i": "(U - R*i - K*w)/L"},
        {"K": 0.5, "d": 0.1, "J": 0.02, "R": 2.0, "L": 0.1},
        {"U": "V"},
        inertia={"w": "J"},
    )
    load = "(Fl_w + mul_w*abs(K*i))*sign(w)"
    expected = shaft.replace(
        equations={**shaft.equations, "w": f"(K*i - d*w - {load})/J"},
        parameters={**shaft.parameters, "Fl_w": 0.1, "mul_w": 0.3},
    )
    rubbed = shaft + effects.LoadFriction("w", level=0.1, share=0.3)
    u = 5 * np.sin(T)
    np.testing.assert_allclose(rubbed.simulate(T, u).y, expected.simulate(T, u).y, atol=1e-12)
    assert str(rubbed.equations["w"].free_symbols) == str(expected.equations["w"].free_symbols)
    late = block() + effects.ActuatorLag("F", time_constant=0.1)
    limited = block() + effects.RateLimit("v", limit=1.0)
    for model in (late, limited):  # the drive is still found
        assert effects.LoadFriction.targets(model) == ("v",)


def test_a_parameter_follows_what_it_depends_on():
    T_room = 1 + 0.5 * np.sin(T)
    tank = PhysicsModel({"y": ""}, {"y": "-k*y"}, {"k": 0.3}, {"heat": "K"}, initial_state={"y": 1})
    hot = tank + effects.ParameterSlope("k(heat)", slope=0.4)
    y = hot.simulate(T, T_room, hold="foh").y[:, 0]
    area = T + 0.5 * (1 - np.cos(T))
    np.testing.assert_allclose(y, np.exp(-0.3 * (T + 0.4 * area)), rtol=1e-5)
    assert effects.ParameterSlope.targets(tank) == ("k(heat)",)
    assert hot.parameters["slope_k_heat"].unit == "1/K"


def test_a_gain_that_saturates_gives_less_than_in_proportion():
    amplifier = PhysicsModel({"y": ""}, {"y": "K*u - K*y"}, {"K": 50.0}, {"u": "V"})
    model = PhysicsModel({"y": ""}, {"y": "50*(K*u - y)"}, {"K": 2.0}, {"u": "V"})
    bent = model + effects.ParameterSaturation("K(u)", bend=0.5)
    u = 3 * np.sin(0.2 * T)
    y = bent.simulate(T, u, hold="foh", substeps=4).y[:, 0]
    assert np.abs(y - 2 * u / (1 + 0.5 * np.abs(u))).max() < 0.03
    assert effects.ParameterSaturation.targets(model) == ("K(u)",)
    assert effects.ParameterSaturation.targets(amplifier) == ()  # K stands at two signals
    assert effects.ParameterSaturation.targets(block()) == ()


def test_a_gain_that_bends_may_grow_or_fall_and_its_words_say_both():
    model = PhysicsModel({"y": ""}, {"y": "50*(K*u - y)"}, {"K": 2.0}, {"u": "V"})
    scales = Scales({}, {"u": 2.0}, {}, 0.01, 2.0)
    least, most = effects.ParameterSaturation.limits("K(u)", model, scales)["bend"]
    assert least < 0 < most
    effect = effects.ParameterSaturation
    assert effect.title("K(u)") == "K that changes with the size of u"
    assert effect.summary.startswith("This parameter falls as its own signal grows (bend above 0")
    assert "or grows with it (bend below 0" in effect.summary
    assert effect.check.endswith("or more if the bend is below 0.")


@pytest.mark.parametrize("ends", [(-2.0, 3.0), (0.0, 3.0), (0.5, 3.0), (-3.0, -0.5)])
def test_a_bent_scale_does_not_turn_back_within_the_readings(ends):
    """Its slope at a reading is the root of 1 + 4 c r, and between a tenth and ten."""
    scales = Scales({}, {"y": 3.0}, {}, 0.01, 2.0, extremes={"y": ends})
    least, most = effects.SensorCurvature.limits("y", None, scales)["curvature"]
    assert least < 0 < most
    readings = np.linspace(*ends)
    for curvature in (least, most):
        slopes = np.sqrt(1 + 4 * curvature * readings)
        y = (slopes - 1) / (2 * curvature)
        np.testing.assert_allclose(
            effects.SensorCurvature("y").shown(y, {"curvature": curvature}), readings, atol=1e-12
        )
        assert slopes.min() > 0.1 - 1e-9
        assert slopes.max() < 10 + 1e-9
        assert np.isclose(slopes, 0.1).any() or np.isclose(slopes, 10.0).any()
    no_range = Scales({}, {"y": 0.0}, {}, 0.01, 2.0)
    assert effects.SensorCurvature.limits("y", None, no_range) == {}


def test_the_unit_of_a_curvature_is_one_over_the_outputs():
    cart = systems.cart_on_spring() + effects.SensorCurvature("position", curvature=0.1)
    assert cart.parameters["cy_position"].unit == "1/m"
    plain = PhysicsModel({"y": ""}, {"y": "-k*y"}, {"k": 0.3}) + effects.SensorCurvature("y", 0.1)
    assert plain.parameters["cy_y"].unit == ""


PAIRED = [
    (effects.ParameterSlope, "d(x)"),
    (effects.ParameterSaturation, "d(x)"),
    (effects.LoadFriction, "v"),
    (effects.AsymmetricDeadZone, "force"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "target"), PAIRED)
def test_the_new_effects_stand_beside_every_other_in_either_order(kind, target):
    cart = systems.cart_on_spring()
    mine = kind(target)
    for other in effects.CATALOGUE:
        at = other.targets(cart)
        if at and not {other.id, mine.id} & {*mine.excludes, *other.excludes} and other is not kind:
            assert set((cart + mine + other(at[0])).parameters) == set(
                (cart + other(at[0]) + mine).parameters
            )


@pytest.mark.parametrize(
    ("lowest", "highest", "distinct"),
    [(-2.0, 3.0, True), (0.0, 3.0, False), (-0.05, 3.0, False), (-3.0, 0.05, False)],
)
def test_friction_by_direction_takes_motion_in_both_directions(lowest, highest, distinct):
    scales = Scales({"v": 1.0}, {"v": 3.0}, {}, 0.01, 1.0, extremes={"v": (lowest, highest)})
    assert effects.AsymmetricFriction("v").is_distinct(scales) is distinct
    assert effects.CoulombFriction("v").is_distinct(scales)


def test_a_force_has_its_unit_where_the_inertia_is_a_product():
    arm = PhysicsModel(
        states={"phi": "rad", "w": "rad/s"},
        equations={"phi": "w", "w": "(M - m*g*l*sin(phi))/(m*l**2)"},
        parameters={
            "m": {"value": 1.0, "unit": "kg"},
            "l": {"value": 0.5, "unit": "m"},
            "g": {"value": 9.81, "unit": "m/s^2"},
        },
        inputs={"M": "N m"},
        inertia={"w": "m*l**2"},
    )
    friction = effects.CoulombFriction("w", level=0.1)
    assert (arm + friction).parameters["Fc_w"].unit == "N m"
    unknown = arm.replace(inertia={"w": "2*m*l**2"})
    assert (unknown + friction).parameters["Fc_w"].unit == "rad/s^2"
