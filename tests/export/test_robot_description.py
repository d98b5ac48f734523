"""What was found at joints stands in a copy of the robot's file, in that format's words."""

import numpy as np
import pytest
from robots import moved_records, six_axes

from sklearn_pgnn import effects
from sklearn_pgnn.exceptions import ModelError, ModelWarning
from sklearn_pgnn.export import to_mjcf, to_urdf
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.priors import from_mjcf, from_urdf

mujoco = pytest.importorskip("mujoco")

PAIR = """<mujoco><!-- kept --><worldbody>
<body><joint name="a" axis="0 1 0" {}/><inertial pos="0.3 0 0" mass="2" diaginertia="0.1 0.2 0.3"/>
<body pos="0.5 0 0"><joint name="b" axis="0 1 0"/>
<inertial pos="0.2 0 0" mass="1" diaginertia="0.03 0.03 0.03"/></body></body></worldbody>
<actuator><motor name="m a" joint="a" gear="20"/><motor name="mb" joint="b"/></actuator></mujoco>"""


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(six_axes(2))
    return path


@pytest.fixture
def mjcf(tmp_path):
    path = tmp_path / "pair.xml"
    path.write_text(PAIR.format('damping="0.5"'))
    return path


def test_a_urdf_says_damping_friction_and_the_limit_of_a_torque(urdf, tmp_path):
    found = from_urdf(urdf).with_parameters(damping_j1=2.5)
    found += effects.CoulombFriction("j2", level=4.0)
    found += effects.ViscousFriction("j2", coefficient=0.25)
    found += effects.InputSaturation("tau_j1", limit=70.0)
    m = mujoco.MjModel.from_xml_path(str(to_urdf(found, urdf, tmp_path / "found.urdf")))
    np.testing.assert_allclose(m.dof_damping, [2.5, 3.25])
    np.testing.assert_allclose(m.dof_frictionloss, [0.0, 4.0])
    np.testing.assert_allclose(m.jnt_actfrcrange, [[-70, 70], [-300, 300]])
    assert "package://six/0.stl" in (tmp_path / "found.urdf").read_text()


def test_what_was_written_is_read_as_the_same_equations(mjcf, tmp_path):
    found = from_mjcf(mjcf)
    for effect in (
        effects.CoulombFriction("a", level=0.3),
        effects.QuadraticDrag("b", coefficient=0.2),
        effects.LinearStiffness("b", stiffness=5.0),
        effects.ConstantLoad("b", load=1.0),
        effects.CubicStiffness("a", stiffness=0.7),
    ):
        found += effect
    again = from_mjcf(to_mjcf(found, mjcf, tmp_path / "found.xml"))
    values = {name: p.value for name, p in again.parameters.items()}
    assert values.pop("gear_m_a") == 20
    assert values == pytest.approx(
        {"damping_a": 0.5, "friction_a": 0.3, "cubic_stiffness_a": 0.7, "drag_b": 0.2}
        | {"stiffness_b": 5.0}
    )
    t = np.arange(0, 1, 0.01)
    u, x0 = np.stack([0.2 * np.sin(5 * t), np.cos(3 * t)], axis=1), [0.3, -0.2, 0.5, 1.0]
    one, other = (model.simulate(t, u, x0).y for model in (found, again))
    np.testing.assert_allclose(one, other, atol=1e-9)
    assert "<!-- kept -->" in (tmp_path / "found.xml").read_text()


@pytest.mark.parametrize("angle", ["degree", "radian"])
def test_the_rest_of_a_spring_is_an_angle_of_the_file(mjcf, tmp_path, angle):
    text = mjcf.read_text().replace("<worldbody>", f'<compiler angle="{angle}"/><worldbody>')
    mjcf.write_text(text)
    found = from_mjcf(mjcf) + effects.LinearStiffness("a", stiffness=4.0)
    found += effects.ConstantLoad("a", load=-2.0)
    m = mujoco.MjModel.from_xml_path(str(to_mjcf(found, mjcf, tmp_path / "found.xml")))
    np.testing.assert_allclose(m.qpos_spring, [0.5, 0.0])


def test_actuators_get_limits_gears_and_delays(mjcf, tmp_path):
    found = from_mjcf(mjcf) + effects.InputSaturation("m_a", limit=0.8)
    found += effects.InputGain("mb", error=-0.25)
    found += effects.InputDelay("mb", delay=0.031)
    m = mujoco.MjModel.from_xml_path(str(to_mjcf(found, mjcf, tmp_path / "found.xml")))
    np.testing.assert_allclose(m.actuator_ctrlrange[0], [-0.8, 0.8])
    assert m.actuator_ctrllimited.tolist() == [True, False]
    np.testing.assert_allclose(m.actuator_gear[:, 0], [20.0, 0.75])
    np.testing.assert_allclose(m.actuator_delay, [0.0, 0.031])
    again = from_mjcf(tmp_path / "found.xml")
    assert again.parameters["delay_mb"].value == pytest.approx(0.031)


def test_armatures_are_written(tmp_path, mjcf):
    mjcf.write_text(PAIR.format('armature="0.2"'))
    found = from_mjcf(mjcf).with_parameters(armature_a=0.35)
    m = mujoco.MjModel.from_xml_path(str(to_mjcf(found, mjcf, tmp_path / "found.xml")))
    np.testing.assert_allclose(m.dof_armature, [0.35, 0.0])


@pytest.mark.filterwarnings("ignore:.*not how stiff:sklearn_pgnn.exceptions.ModelWarning")
def test_end_stops_are_the_ends_of_the_travel(urdf, mjcf, tmp_path):
    stop = {"upper": 0.75, "stiffness": 1e4}
    found = from_urdf(urdf) + effects.EndStop("j1", lower=-0.5, **stop)
    found += effects.EndStop("j2", **stop)
    m = mujoco.MjModel.from_xml_path(str(to_urdf(found, urdf, tmp_path / "found.urdf")))
    np.testing.assert_allclose(m.jnt_range, [[-0.5, 0.75], [-3, 0.75]])
    found = from_mjcf(mjcf) + effects.EndStop("a", lower=-0.5, **stop)
    m = mujoco.MjModel.from_xml_path(str(to_mjcf(found, mjcf, tmp_path / "found.xml")))
    np.testing.assert_allclose(m.jnt_range[0], [-0.5, 0.75])
    assert m.jnt_limited.tolist() == [1, 0]
    mjcf.write_text(PAIR.format('range="-40 60"'))
    found = from_mjcf(mjcf) + effects.EndStop("a", **stop)
    m = mujoco.MjModel.from_xml_path(str(to_mjcf(found, mjcf, tmp_path / "found.xml")))
    np.testing.assert_allclose(m.jnt_range[0], [np.radians(-40), 0.75])


def test_the_stiffness_of_a_stop_is_left_out_with_a_word(urdf, tmp_path):
    found = from_urdf(urdf) + effects.EndStop("j2", upper=0.75, stiffness=1e4)
    with pytest.warns(ModelWarning, match=r"where joint j2 stops, .* 10000 N m/rad. Remedy: give"):
        to_urdf(found, urdf, tmp_path / "found.urdf")


def test_a_stop_without_a_place_in_the_file_is_refused(urdf, mjcf, tmp_path):
    stop = effects.EndStop("a", upper=0.75, stiffness=1e4)
    with pytest.raises(ModelError, match=r"one end of joint a without a range. Remedy"):
        to_mjcf(from_mjcf(mjcf) + stop, mjcf, tmp_path / "found.xml")
    urdf.write_text(urdf.read_text().replace("revolute", "continuous"))
    stop = effects.EndStop("j1", upper=0.75, stiffness=1e4)
    with pytest.raises(ModelError, match=r"stop at joint j1 without a <limit>, .* type revolute"):
        to_urdf(from_urdf(urdf) + stop, urdf, tmp_path / "found.urdf")


def same_motion(found, again, seed):
    """Assert that two models move alike under the same inputs."""
    rng, t = np.random.default_rng(seed), np.arange(0, 0.5, 0.01)
    pace, size = rng.uniform(3, 20, 2), rng.uniform(2, 90, 2)
    u, x0 = size * np.sin(np.outer(t, pace)), rng.uniform(-0.5, 0.5, 4)
    one, other = (model.simulate(t, u, x0).y for model in (found, again))
    np.testing.assert_allclose(one, other, atol=1e-8)


def resisted(model, names, rng):
    """Return a model with friction, damping and more at its joints, of random sizes."""
    for name in names:
        model += effects.CoulombFriction(name, level=rng.uniform(0.1, 2.0))
        model += effects.ViscousFriction(name, coefficient=rng.uniform(0.1, 2.0))
    return model


@pytest.mark.parametrize("seed", range(2))
def test_a_model_of_a_urdf_that_was_written_moves_alike(urdf, tmp_path, seed):
    rng = np.random.default_rng(seed)
    options = {"effort_limits": True}
    found = resisted(from_urdf(urdf, **options), ["j1", "j2"], rng)
    found += effects.InputSaturation("tau_j2", limit=rng.uniform(20, 60))
    again = from_urdf(to_urdf(found, urdf, tmp_path / "found.urdf"), **options)
    assert again.parameters["high_j1"].value == 300
    assert 20 < again.parameters["high_j2"].value < 60
    same_motion(found, again, seed)


@pytest.mark.parametrize("seed", range(2))
def test_a_model_of_an_mjcf_that_was_written_moves_alike(mjcf, tmp_path, seed):
    rng = np.random.default_rng(seed)
    found = resisted(from_mjcf(mjcf, armatures=True), ["a", "b"], rng)
    armatures = dict(zip(["armature_a", "armature_b"], rng.uniform(0.1, 0.4, 2), strict=True))
    found = found.with_parameters(**armatures)
    found += effects.LinearStiffness("b", stiffness=rng.uniform(1, 9))
    found += effects.ConstantLoad("b", load=rng.uniform(-2, 2))
    found += effects.QuadraticDrag("a", coefficient=rng.uniform(0.1, 0.5))
    found += effects.InputSaturation("m_a", limit=rng.uniform(0.5, 2))
    found += effects.InputGain("mb", error=rng.uniform(-0.3, 0.3))
    found += effects.InputDelay("mb", delay=rng.uniform(0.02, 0.05))
    again = from_mjcf(to_mjcf(found, mjcf, tmp_path / "found.xml"))
    assert again.parameters["armature_b"].value == pytest.approx(armatures["armature_b"])
    same_motion(found, again, seed)


def test_of_two_limits_the_nearer_one_is_written(urdf, tmp_path):
    found = from_urdf(urdf, effort_limits=True) + effects.InputSaturation("tau_j1", limit=400.0)
    m = mujoco.MjModel.from_xml_path(str(to_urdf(found, urdf, tmp_path / "found.urdf")))
    np.testing.assert_allclose(m.jnt_actfrcrange[0], [-300, 300])


def test_a_urdf_has_no_word_for_an_armature(urdf, tmp_path):
    arm = from_urdf(urdf, armatures=True)
    assert arm.parameters["armature_j1"].value == 0.0
    to_urdf(arm, urdf, tmp_path / "same.urdf")
    said = r"an armature of 0.3 N m/\(rad/s\^2\) at joint j2, which MJCF can.*Remedy"
    with pytest.raises(ModelError, match=said):
        to_urdf(arm.with_parameters(armature_j2=0.3), urdf, tmp_path / "found.urdf")


def test_inertias_that_stand_for_several_links_are_not_written(urdf, tmp_path):
    arm = from_urdf(urdf, base_parameters=True)
    to_urdf(arm, urdf, tmp_path / "same.urdf")
    with pytest.raises(ModelError, match=r"moment_x_j2 = 9 kg m in place of .* combination"):
        to_urdf(arm.with_parameters(moment_x_j2=9.0), urdf, tmp_path / "found.urdf")


def test_the_armature_of_an_actuator_is_not_taken_from_its_joint(mjcf, tmp_path):
    mjcf.write_text(mjcf.read_text().replace('gear="20"', 'gear="20" armature="0.02"'))
    geared = from_mjcf(mjcf)
    assert geared.parameters["armature_a"].value == pytest.approx(8)
    more = to_mjcf(geared.with_parameters(armature_a=9.5), mjcf, tmp_path / "found.xml")
    assert mujoco.MjModel.from_xml_path(str(more)).dof_armature[0] == pytest.approx(1.5)
    with pytest.raises(ModelError, match="an armature at joint a below that of its actuators, 8"):
        to_mjcf(geared.with_parameters(armature_a=3.0), mjcf, tmp_path / "less.xml")


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        (effects.StribeckFriction("j2", 1.0, 0.5, 0.1), "exp.* at joint j2"),
        (effects.QuadraticDrag("j2", coefficient=0.1), "drag at joint j2"),
        (effects.ConstantLoad("j1", load=2.0), "2 at joint j1"),
        (effects.InputDelay("tau_j1", delay=0.1), "a delay of tau_j1"),
        (effects.InputBias("tau_j1", bias=0.1), "0.1 at joint j1"),
        (effects.InputDeadZone("tau_j1", threshold=0.1), "the drive .* at joint j1"),
        (effects.SensorBias("q_j2", bias=0.1), "what a sensor does, q_j2 ="),
        (effects.ActuatorLag("tau_j2", time_constant=0.1), "what its state tau_j2_lagged does"),
    ],
)
def test_a_urdf_refuses_what_it_cannot_say_and_nothing_is_written(urdf, tmp_path, effect, said):
    path = tmp_path / "found.urdf"
    with pytest.raises(ModelError, match=f"(?s)cannot say .*{said}.*Remedy: write the model"):
        to_urdf(from_urdf(urdf) + effect, urdf, path)
    assert not path.exists()


def test_a_payload_without_a_shape_is_refused(urdf, tmp_path):
    held = from_urdf(urdf, payload="l2").with_parameters(payload=1.5)
    with pytest.raises(ModelError, match=r"a payload of 1.5 kg without its shape"):
        to_urdf(held, urdf, tmp_path / "found.urdf")


def test_a_model_of_another_machine_is_refused(urdf, mjcf, tmp_path):
    with pytest.raises(ModelError, match=r"without a joint 'a'. Remedy: the file that"):
        to_mjcf(from_urdf(urdf), mjcf, tmp_path / "found.xml")
    arm = from_urdf(urdf)
    moved = arm.replace(equations={**arm.equations, "w_j1": arm.equations["w_j1"] - symbol("q_j1")})
    with pytest.raises(ModelError, match=r"through its torque, in every rate"):
        to_urdf(moved, urdf, tmp_path / "found.urdf")


def test_the_written_file_reproduces_the_records_in_its_own_simulator(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(six_axes(2))
    truth = mujoco.MjModel.from_xml_string(six_axes(2, friction=(0.0, 9.0)))
    X = moved_records(truth, ["j1", "j2"], records=1, samples=200, noise=0.0)
    arm = from_urdf(path) + effects.CoulombFriction("j2", level=9.0)
    m = mujoco.MjModel.from_xml_path(str(to_urdf(arm, path, tmp_path / "found.urdf")))
    again = moved_records(m, ["j1", "j2"], records=1, samples=200, noise=0.0)
    np.testing.assert_allclose(again.to_numpy(), X.to_numpy(), atol=1e-9)
