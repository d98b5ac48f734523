"""Robots from URDF and MJCF: MuJoCo's dynamics, free inertias, balances, what is refused."""

import pickle
import sys
import warnings

import numpy as np
import pytest
import sympy
from robots import TREE, six_axes

from sklearn_pgnn import PhysicsModelRegressor
from sklearn_pgnn.effects import CoulombFriction
from sklearn_pgnn.exceptions import FitWarning, ModelError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.priors import from_mjcf, from_urdf
from sklearn_pgnn.simulation.pointwise import evaluate_samples

mujoco = pytest.importorskip("mujoco")
MOTOR = '<actuator><motor name="drive" joint="j" {}/></actuator>'


def one_joint(joint="", actuator="", rest=""):
    """Return a pendulum in MJCF."""
    return (
        f'<mujoco>{rest}<worldbody><body><joint name="j" axis="0 1 0" {joint}/>'
        f'<inertial pos="0.3 0 0" mass="2" diaginertia="0.1 0.2 0.3"/></body></worldbody>'
        f"{actuator}</mujoco>"
    )


def written(folder, text):
    """Write a description; return where."""
    path = folder / ("robot.urdf" if "<robot" in text else "robot.xml")
    path.write_text(text)
    return path


def accelerations(model, points):
    """Return what the model's equations give at values of its quantities."""
    table = {name: points[:, i] for i, name in enumerate((*model.states, *model.inputs))}
    table |= {name: p.value for name, p in model.parameters.items()}
    rates = list(model.equations.values())[len(model.states) // 2 :]
    return np.stack([evaluate_samples(rate, table, len(points)) for rate in rates], axis=1)


def accelerations_of_mujoco(m, points, control="qfrc_applied"):
    """Return MuJoCo's accelerations; contacts and limits are left out, as in the model."""
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    data, found = mujoco.MjData(m), []
    for point in points:
        data.qpos[:], data.qvel[:] = point[: m.nv], point[m.nv : 2 * m.nv]
        getattr(data, control)[:] = point[2 * m.nv :]
        mujoco.mj_forward(m, data)
        found.append(data.qacc.copy())
    return np.array(found)


def assert_same_dynamics(model, m, control="qfrc_applied", rtol=1e-9):
    n = len(model.states) + len(model.inputs)
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (40, n))
    expected = accelerations_of_mujoco(m, points, control)
    found = accelerations(model, points)
    np.testing.assert_allclose(found, expected, rtol=rtol, atol=rtol * np.abs(expected).max())


def test_an_arm_of_six_axes_has_mujocos_dynamics(tmp_path):
    path = written(tmp_path, six_axes())
    assert_same_dynamics(from_urdf(path), mujoco.MjModel.from_xml_path(str(path)))


def test_so_has_a_tree_with_slides_armatures_and_other_zero_positions(tmp_path):
    path = written(tmp_path, TREE)
    tree = from_mjcf(path)
    assert list(tree.states) == [*(f"q_{j}" for j in "abcde"), "w_a", "w_b", "w_c", "v_d", "w_e"]
    assert (tree.states["q_d"], tree.inputs["F_d"]) == ("m", "N")
    assert tree.initial_state["q_c"] == pytest.approx(np.radians(15))
    assert_same_dynamics(tree, mujoco.MjModel.from_xml_path(str(path)))


def test_a_payload_is_a_mass_at_a_point_of_a_body(tmp_path):
    hand = from_mjcf(written(tmp_path, TREE), payload=("hand", (0.1, 0.0, 0.05)))
    held = TREE.replace(
        'pos="0.3 .1 0">',
        'pos="0.3 .1 0"><body pos="0.1 0 0.05"><inertial pos="0 0 0" mass="0.7" '
        'diaginertia="1e-12 1e-12 1e-12"/></body>',
    )
    other = mujoco.MjModel.from_xml_string(held)
    assert_same_dynamics(hand.with_parameters(payload=0.7), other)


@pytest.mark.parametrize("options", [{}, {"payload": "hand"}, {"base_parameters": True}])
def test_sensitivities_are_the_slopes_of_simulations(tmp_path, options):
    tree = from_mjcf(written(tmp_path, TREE), **options)
    t, n = np.arange(0, 0.3, 0.01), len(tree.inputs)
    u = np.sin(np.outer(t, np.arange(1, n + 1)))
    x0 = np.random.default_rng(1).normal(size=2 * n)
    wrt = tuple(tree.parameters)
    known = tree.simulate(t, u, x0, wrt=wrt).sensitivities
    for i, name in enumerate(wrt):
        value, step = tree.parameters[name].value, 1e-5
        ends = [tree.with_parameters(**{name: value + by}).simulate(t, u, x0) for by in (step, 0)]
        slope = (ends[0].y - ends[1].y) / step
        scale = np.abs(slope).max()
        np.testing.assert_allclose(known[..., i], slope, atol=1e-3 * scale)
    for i in range(2 * n):
        off = 1e-6 * (np.arange(2 * n) == i)
        ends = [tree.simulate(t, u, x0 + off), tree.simulate(t, u, x0 - off)]
        slope = (ends[0].y - ends[1].y) / 2e-6
        np.testing.assert_allclose(known[..., len(wrt) + i], slope, atol=1e-6 * np.abs(slope).max())


def test_without_torques_and_resistance_energy_stays(tmp_path):
    path = written(tmp_path, six_axes(damping=(0.0,) * 6))
    arm, m = from_urdf(path), mujoco.MjModel.from_xml_path(str(path))
    t = np.arange(0, 1.0, 0.002)
    x0 = np.array([0.3, -0.2, 0.5, 0.1, 0.4, -0.3, 1.0, -0.5, 0.8, 1.0, -1.0, 0.5])
    run = arm.simulate(t, np.zeros((len(t), 6)), x0, substeps=8)
    m.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data, energy = mujoco.MjData(m), []
    for x in run.x[::25]:
        data.qpos[:], data.qvel[:] = x[:6], x[6:]
        mujoco.mj_forward(m, data)
        energy.append(data.energy.sum())
    assert np.ptp(energy) < 1e-9 * np.mean(energy)


def test_every_joint_is_a_port_through_the_whole_mass_matrix(tmp_path):
    path = written(tmp_path, six_axes())
    arm, m = from_urdf(path), mujoco.MjModel.from_xml_path(str(path))
    rubbed = arm + CoulombFriction("j2", level=4.0)
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (20, 18))
    torque = np.zeros_like(points)
    torque[:, 13] = -4.0 * np.sign(points[:, 7])
    np.testing.assert_allclose(
        accelerations(rubbed, points), accelerations_of_mujoco(m, points + torque), rtol=1e-9
    )
    port = arm.port("j2")
    assert (port.flow, port.displacement, port.unit) == (symbol("w_j2"), symbol("q_j2"), "N m")


def test_what_the_file_says_of_joints_are_parameters(tmp_path):
    joint = 'damping="1 0.2 0.3" stiffness="4 0.5 0.6" springref="20" armature="0.1"'
    path = written(tmp_path, one_joint(joint))
    model, m = from_mjcf(path), mujoco.MjModel.from_xml_path(str(path))
    assert {name: (p.value, p.unit) for name, p in model.parameters.items()} == {
        "damping_j": (1.0, "N m/(rad/s)"),
        "drag_j": (0.2, "N m/(rad/s)^2"),
        "cubic_drag_j": (0.3, "N m/(rad/s)^3"),
        "stiffness_j": (4.0, "N m/rad"),
        "quadratic_stiffness_j": (0.5, "N m/rad^2"),
        "cubic_stiffness_j": (0.6, "N m/rad^3"),
        "armature_j": (0.1, "N m/(rad/s^2)"),
    }
    assert_same_dynamics(model, m)
    rubbed = from_mjcf(written(tmp_path, one_joint('frictionloss="0.7"')))
    assert rubbed.equations["w_j"].has(sympy.sign(symbol("w_j")))
    assert rubbed.parameters["friction_j"].value == 0.7


@pytest.mark.parametrize(
    "actuator",
    [
        MOTOR.format('gear="30"'),
        MOTOR.format('gear="30" ctrlrange="-0.5 0.7" forcerange="-0.4 0.4"'),
        '<actuator><position name="drive" joint="j" kp="50" kv="3" gear="2"/></actuator>',
        '<actuator><velocity name="drive" joint="j" kv="3"/></actuator>',
        MOTOR.format('gear="5" armature="0.02"'),
    ],
    ids=["gear", "limits", "position", "velocity", "rotor"],
)
def test_actuators_drive_as_in_mujoco(tmp_path, actuator):
    joint = 'actuatorfrcrange="-40 40"' if "kp" in actuator else ""
    path = written(tmp_path, one_joint(joint, actuator))
    model = from_mjcf(path)
    assert list(model.inputs) == ["drive"]
    assert_same_dynamics(model, mujoco.MjModel.from_xml_path(str(path)), "ctrl")
    assert list(from_mjcf(path, controls=False).inputs) == ["tau_j"]


def test_a_delayed_actuator_is_a_delayed_input(tmp_path):
    path = written(tmp_path, one_joint("", MOTOR.format('delay="0.03" nsample="20"')))
    model = from_mjcf(path)
    assert dict(model.delays) == {"drive": "delay_drive"}
    assert model.parameters["delay_drive"].value == 0.03


def test_a_model_can_be_pickled(tmp_path):
    arm = from_urdf(written(tmp_path, six_axes(2)))
    again = pickle.loads(pickle.dumps(arm))
    points = np.random.default_rng(3).normal(size=(5, 6))
    np.testing.assert_array_equal(accelerations(again, points), accelerations(arm, points))


BALL = '<mujoco><worldbody><body>{}<geom size="1"/></body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<robot", "got no XML"),
        ("<sdf/>", "expected an MJCF file, <mujoco>, got <sdf>"),
        (BALL.format("<freejoint/>"), "floats or is a ball: joint 1. Remedy: fix the robot's base"),
        (BALL.format('<joint type="ball"/>'), "write a ball as three hinges"),
        (BALL.format(""), "at least one joint that moves"),
        (one_joint("", '<equality><joint joint1="j"/></equality>'), "equality constraints"),
        (one_joint(rest='<option density="1.2"/>'), "no fluid"),
        (one_joint('range="3"'), "MuJoCo refuses it"),
        (
            one_joint(
                "", '<actuator><intvelocity name="drive" joint="j" actrange="-1 1"/></actuator>'
            ),
            "actuator drive: expected a motor.*Remedy: from_mjcf",
        ),
    ],
)
def test_what_is_no_tree_of_joints_is_refused(tmp_path, text, said):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    with pytest.raises(ModelError, match=said):
        from_mjcf(path)


def test_a_body_that_does_not_move_holds_no_payload(tmp_path):
    path = written(tmp_path, six_axes(2))
    with pytest.raises(ModelError, match=r"expected a body among l1, l2, got 'base'"):
        from_urdf(path, payload="base")
    with pytest.raises(ModelError, match="three numbers"):
        from_urdf(path, payload=("l2", (0.0, 1.0)))


def test_without_mujoco_it_is_said_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ModuleNotFoundError, match=r"needs mujoco.*sklearn-pgnn\[robots\]"):
        from_urdf(written(tmp_path, six_axes(1)))


def inertia_of(m, body):
    """Return mass, first moment and tensor of a body about its frame's origin."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, m.body_iquat[body])
    turn, mass, at = turn.reshape(3, 3), m.body_mass[body], m.body_ipos[body]
    tensor = turn @ np.diag(m.body_inertia[body]) @ turn.T
    return mass, mass * at, tensor + mass * (at @ at * np.eye(3) - np.outer(at, at))


def put_inertia(m, body, mass, moment, tensor):
    """Give a body another inertia."""
    at, quaternion = moment / mass, np.zeros(4)
    values, axes = np.linalg.eigh(tensor - mass * (at @ at * np.eye(3) - np.outer(at, at)))
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    m.body_mass[body], m.body_ipos[body] = mass, at
    m.body_inertia[body], m.body_iquat[body] = values, quaternion
    mujoco.mj_setConst(m, mujoco.MjData(m))


def torques_by_inertias(m, states=100):
    """Return slopes of MuJoCo's inverse dynamics by ten numbers of every moving body."""
    rng, data = np.random.default_rng(0), mujoco.MjData(m)
    points = rng.uniform(-2, 2, (states, 3, m.nv))

    def torques(body, inertia):
        put_inertia(m, body, *inertia)
        found = []
        for data.qpos[:], data.qvel[:], data.qacc[:] in points:
            mujoco.mj_inverse(m, data)
            found.append(data.qfrc_inverse.copy())
        return np.concatenate(found)

    columns = []
    for body in np.flatnonzero(m.body_dofnum):
        known = inertia_of(m, body)
        for change in changes(known[0]):
            ends = (
                torques(body, [now + sign * by for now, by in zip(known, change, strict=True)])
                for sign in (1, -1)
            )
            columns.append(next(ends) - next(ends))
        put_inertia(m, body, *known)
    return np.stack(columns, axis=1)


def changes(mass):
    """Yield small changes of the ten numbers, as mass, first moment and tensor."""
    yield 0.01 * mass, np.zeros(3), np.zeros((3, 3))
    for place in range(3):
        yield 0.0, 1e-3 * mass * np.eye(3)[place], np.zeros((3, 3))
    for i in range(3):
        for j in range(i, 3):
            tensor = np.zeros((3, 3))
            tensor[i, j] = tensor[j, i] = 1e-4 * mass
            yield 0.0, np.zeros(3), tensor


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(six_axes(2))
    return path


@pytest.mark.parametrize(("joints", "expected"), [(2, 8), (6, 36)])
def test_there_are_as_many_as_the_rank_of_the_regressor(tmp_path, joints, expected):
    path = tmp_path / "arm.urdf"
    path.write_text(six_axes(joints))
    free = set(from_urdf(path, base_parameters=True).parameters) - set(from_urdf(path).parameters)
    m = mujoco.MjModel.from_xml_string(six_axes(joints))
    values = np.linalg.svd(torques_by_inertias(m), compute_uv=False)
    assert len(free) == np.sum(values > 1e-7 * values[0]) == expected


def test_an_armature_takes_the_place_of_the_inertia_that_acts_alike(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(TREE)
    found = from_mjcf(path, base_parameters=True).parameters
    assert "armature_a" in found
    assert "inertia_zz_a" not in found
    assert "mass_d" in found


def test_values_of_the_file_change_nothing_and_others_act_as_in_mujoco(arm):
    bare, free = from_urdf(arm), from_urdf(arm, base_parameters=True)
    points = np.random.default_rng(1).uniform(-1, 1, (20, 6))
    np.testing.assert_allclose(accelerations(free, points), accelerations(bare, points), rtol=1e-9)
    m = mujoco.MjModel.from_xml_path(str(arm))
    mass, moment, tensor = inertia_of(m, m.body("l2").id)
    moment[0] += 0.2
    tensor[0, 1] = tensor[1, 0] = tensor[0, 1] + 0.03
    put_inertia(m, m.body("l2").id, mass, moment, tensor)
    changes = {"moment_x_j2": 0.2, "inertia_xy_j2": 0.03}
    values = {name: free.parameters[name].value + by for name, by in changes.items()}
    found = accelerations(free.with_parameters(**values), points)
    np.testing.assert_allclose(found, accelerations_of_mujoco(m, points), rtol=1e-8)


def test_a_fit_leaves_no_direction_undetermined(arm):
    free = from_urdf(arm, base_parameters=True)
    rng, t = np.random.default_rng(2), np.arange(0, 2.0, 0.01)
    values = {
        name: p.value * rng.uniform(0.95, 1.05) + 0.01 * p.value * rng.normal()
        for name, p in free.parameters.items()
    }
    truth = free.with_parameters(**values)
    u = np.stack([60 * np.sin(7 * t) + 30 * np.sin(17 * t), 80 * np.cos(5 * t)], axis=1)
    run = truth.simulate(t, u, np.array([0.2, -0.3, 0.5, -0.5]))
    with warnings.catch_warnings():
        warnings.simplefilter("error", FitWarning)
        fit = PhysicsModelRegressor(free).fit(np.column_stack([t, u]), run.y)
    found = {name: p.value for name, p in fit.model_.parameters.items()}
    assert found == pytest.approx(values, rel=1e-3, abs=1e-3)
