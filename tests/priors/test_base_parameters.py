"""The free inertias of a robot are as many as act, and records determine all of them."""

import warnings

import numpy as np
import pytest
from robots import TREE, six_axes

from sklearn_pgnn import PhysicsModelRegressor
from sklearn_pgnn.exceptions import FitWarning
from sklearn_pgnn.priors import from_mjcf, from_urdf
from sklearn_pgnn.simulation.pointwise import evaluate_samples

mujoco = pytest.importorskip("mujoco")


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
    found, expected = accelerations(free.with_parameters(**values), points), driven_by(m, points)
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def accelerations(model, points):
    table = {name: points[:, i] for i, name in enumerate((*model.states, *model.inputs))}
    table |= {name: p.value for name, p in model.parameters.items()}
    rates = [model.equations[name] for name in ("w_j1", "w_j2")]
    return np.stack([evaluate_samples(rate, table, len(points)) for rate in rates], axis=1)


def driven_by(m, points):
    data, found = mujoco.MjData(m), []
    for point in points:
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = point.reshape(3, 2)
        mujoco.mj_forward(m, data)
        found.append(data.qacc.copy())
    return np.array(found)


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
