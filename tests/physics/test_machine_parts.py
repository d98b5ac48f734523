"""Laws of gears, joints, hysteretic springs, and drives: known without the package."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.scales import Scales

pytestmark = pytest.mark.core

T = np.arange(0, 4, 0.005)


def block(**changes):
    rates = {"x": "v", "v": "(F - d*v)/m"}
    parts = {"inputs": {"F": "N"}, "outputs": {"y": "x"}, "inertia": {"v": "m"}, **changes}
    numbers = {"m": {"value": 2.0, "unit": "kg"}, "d": {"value": 0.0, "unit": "N s/m"}}
    return PhysicsModel({"x": "m", "v": "m/s"}, rates, numbers, **parts)


def value(model, expression, **known):
    """Return an expression's value at the model's parameters."""
    known |= {name: p.value for name, p in model.parameters.items()}
    return float(expression.subs({symbol(name): number for name, number in known.items()}))


@pytest.mark.parametrize(("loss", "bend"), [(8.0, -11.0), (8.0, 5.0), (3.0, 9.0)])
def test_a_hysteretic_spring_is_loaded_and_unloaded_along_exponentials(loss, bend):
    r"""Pulled, z = k/s (1 - exp(-s x)); back, dz/dx = k + r z, with s and r = loss +- bend."""
    k, s, r = 2.0, loss + bend, loss - bend
    heavy = block().with_parameters(m=1e9) + effects.HystereticSpring("v", k, loss, bend)
    out = heavy.simulate(T, np.zeros(T.size), [0.0, 0.1, 0.0], substeps=4).x
    x, z = out[:, 0], out[:, 2]
    np.testing.assert_allclose(z, k / s * (1 - np.exp(-s * x)), rtol=1e-6)
    back = heavy.simulate(T, np.zeros(T.size), [0.4, -0.1, z[-1]], substeps=4).x
    x, after = back[:, 0] - 0.4, back[:, 2]
    expected = (z[-1] + k / r) * np.exp(r * x) - k / r
    loaded = expected > 0
    np.testing.assert_allclose(after[loaded], expected[loaded], rtol=1e-6)


def test_the_loop_of_a_hysteretic_spring_is_no_spring_with_a_load():
    seen = Scales({"x": 0.1}, {"x": 0.2, "v": 1.0}, {"v": 5.0}, 0.01, 1.0)
    least, most = effects.HystereticSpring.limits("v", block(), seen)["loss"]
    assert 0 < least < most
    starts = effects.HystereticSpring.starts("v", block(), seen)
    assert all(least < start.loss < most for start in starts)


@pytest.mark.parametrize(("drive", "v", "left"), [(3.0, 1.0, 2.2), (3.0, -1.0, 4.7)])
def test_a_gear_loses_by_the_direction_of_the_power(drive, v, left):
    """Driven, 3 N lose 0.5 + 0.1*3; driven back they lose 0.5 + 0.4*3, against the motion."""
    gear = block() + effects.GearLoss("v", level=0.5, share=0.1, backward=0.4)
    moved = gear.simulate(T[:3], np.full(3, drive), [0.0, v], substeps=4).x[:, 1]
    assert 2.0 * (moved[1] - moved[0]) / T[1] == pytest.approx(left, rel=1e-6)


@pytest.mark.parametrize("drive", [0.5, 0.54, 0.57, 0.7])
def test_a_gear_breaks_away_where_its_load_exceeds_what_it_loses(drive):
    gear = block() + effects.GearLoss("v", level=0.5, share=0.1, backward=0.4)
    moved = gear.simulate(T, np.full(T.size, drive)).x[-1, 1]
    assert bool(moved > 0) is (0.9 * drive > 0.5)


def test_a_gear_whose_losses_are_the_same_is_load_friction():
    u = 3 * np.sin(5 * T)
    gear = block() + effects.GearLoss("v", level=0.3, share=0.2, backward=0.2)
    same = block() + effects.LoadFriction("v", level=0.3, share=0.2)
    np.testing.assert_allclose(gear.simulate(T, u).y, same.simulate(T, u).y, atol=1e-12)


def test_stribeck_friction_with_load_is_each_of_the_two_that_it_generalises():
    u = 3 * np.sin(5 * T)
    for special, general in (
        (effects.LoadFriction("v", 0.3, 0.2), {"share": 0.2, "peak": 0.0}),
        (effects.StribeckFriction("v", 0.3, 0.15, 0.1), {"peak": 0.5, "velocity": 0.1}),
    ):
        whole = block() + effects.LoadStribeckFriction("v", level=0.3, **general)
        one, other = (model.simulate(T, u).y for model in (whole, block() + special))
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_an_elastic_joint_rings_at_its_frequency_and_keeps_momentum_and_energy():
    r"""w^2 = k/(m l (1 - l)); m((1 - l) v + l v_l) is what the force has given."""
    joint = effects.ElasticJoint("v", share=0.3, stiffness=400.0)
    two = block(energy={"stored": "m*v**2/2", "dissipated": "d*v**2"}) + joint
    start = [0.0, 1.0, 0.0, 0.0]
    x, v, twist, load = two.simulate(T, np.zeros(T.size), start, substeps=8).x.T
    w = np.sqrt(400.0 / (2.0 * 0.3 * 0.7))
    np.testing.assert_allclose(twist, np.sin(w * T) / w, atol=1e-6)
    np.testing.assert_allclose(0.7 * v + 0.3 * load, 0.7, atol=1e-9)
    energy = sum(np.array([0.7, 0.3])[:, None] * np.array([v, load]) ** 2) + 200 * twist**2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-6)
    names = ("x", "v", "twist_v", "load_v")
    at = dict(zip(names, (x[70], v[70], twist[70], load[70]), strict=True))
    assert value(two, two.energy["stored"], **at) == pytest.approx(energy[70], rel=1e-6)


def test_an_accelerometer_before_an_elastic_joint_feels_what_its_mass_does():
    joint = effects.ElasticJoint("v", share=0.3, stiffness=400.0, damping=2.0)
    two = block(outputs={"y": "x", "a": "3*(F - d*v)/m"}) + joint
    run = two.simulate(T, 3 * np.sin(5 * T), substeps=8, hold="foh")
    slopes = np.gradient(run.x[:, 1], T)
    np.testing.assert_allclose(run.y[5:-5, 1], 3 * slopes[5:-5], atol=0.01)
    assert np.abs(run.y[:, 1]).max() > 3


def test_a_stiff_joint_moves_as_one():
    u = 3 * np.sin(5 * T)
    stiff = block() + effects.ElasticJoint("v", share=0.3, stiffness=4e5, damping=100.0)
    one, other = stiff.simulate(T, u, substeps=16).y, block().simulate(T, u).y
    np.testing.assert_allclose(one, other, atol=2e-4 * np.abs(other).max())


def test_no_force_passes_within_the_play():
    play = block() + effects.JointPlay("v", share=0.3, stiffness=400.0, width=0.2)
    _, v, twist, load = play.simulate(T, np.zeros(T.size), [0.0, 1.0, 0.0, 0.0], substeps=8).x.T
    free = np.cumprod(np.abs(twist) < 0.1).astype(bool)
    assert 15 < free.sum() < 25
    np.testing.assert_allclose(v[free], 1.0)
    assert load[free].max() == 0.0
    assert load.max() > 0.5


def test_the_play_of_a_shaft_is_taken_out_of_the_stretch_in_both_rates():
    units = {"a": "rad", "b": "rad", "v": "rad/s", "w": "rad/s"}
    rates = {"a": "v", "b": "w", "v": "(u - k*(a - n*b))/J", "w": "n*k*(a - n*b)/J - w"}
    outputs = {"a": "a", "torque": "k*(a - n*b)"}
    shaft = PhysicsModel(units, rates, {"k": 50.0, "J": 2.0, "n": 3.0}, {"u": "N m"}, outputs)
    loose = shaft + effects.SpringPlay("k", width=0.2)
    assert effects.SpringPlay.targets(shaft) == ("k",)
    rest = {"u": 0.0, "b": 0.0, "v": 0.0, "w": 0.0}
    for stretch, force in ((0.05, 0.0), (0.3, 10.0), (-0.3, -10.0)):
        at = {**rest, "a": stretch}
        assert value(loose, loose.equations["v"], **at) == pytest.approx(-force / 2)
        assert value(loose, loose.equations["w"], **at) == pytest.approx(3 * force / 2)
        assert value(loose, loose.outputs["torque"], **at) == pytest.approx(force)
    assert loose.outputs["a"] == shaft.outputs["a"]


def test_a_spring_to_the_ground_and_the_inertia_have_no_play():
    assert effects.SpringPlay.targets(systems.cart_on_spring()) == ()


@pytest.mark.parametrize(
    ("unit", "output", "turn"), [("rad", "q", 2 * np.pi), ("deg", "7*q + 3", 360), ("rev", "q", 1)]
)
def test_the_error_of_an_eccentric_sensor_repeats_every_turn(unit, output, turn):
    wheel = PhysicsModel({"q": unit}, {"q": "1"}, outputs={"y": output})
    seated = wheel + effects.SensorEccentricity("y", 0.3, 0.1)
    error = seated.outputs["y"] - wheel.outputs["y"]
    seen = [value(seated, error, q=at * turn) for at in (0, 0.25, 0.5, 1.0)]
    assert seen == pytest.approx([0.1, 0.3, -0.1, 0.1])


def test_what_is_no_angle_has_no_eccentric_sensor():
    assert effects.SensorEccentricity.targets(systems.cart_on_spring()) == ()
    assert effects.SensorEccentricity.targets(systems.golf_robot()) == ("phi_measured",)


def test_an_input_fades_behind_a_dead_zone():
    """k(v)(u - u0), whichever of the two is applied first to the model."""
    fading, zone = effects.InputFading("F(v)", fading=0.1), effects.InputDeadZone("F", 0.5)
    car = block() + fading + zone
    for u, v, force in ((2.0, 3.0, 1.5 * 0.7), (0.4, 3.0, 0.0), (-2.0, -4.0, -1.5 * 0.6)):
        assert value(car, car.equations["v"], F=u, v=v) == pytest.approx(force / 2.0)


def test_only_speeds_that_an_input_drives_fade_it():
    assert effects.InputFading.targets(systems.two_tanks()) == ()
    assert effects.InputFading.targets(block()) == ("F(v)",)


@pytest.mark.parametrize("kind", [effects.Hysteresis, effects.HystereticSpring])
@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-1.0, 0.01)])
def test_a_loop_shows_where_the_motion_goes_both_ways(kind, low, high):
    cart = systems.cart_on_spring()
    seen = Scales({}, {}, {}, 0.01, 1.0, extremes={"v": (low, high)})
    assert kind("v").is_shown(cart, seen) is (high == 1.0)
