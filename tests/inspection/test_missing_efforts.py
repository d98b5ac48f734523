"""The torque that is missing at a joint is told before any simulation."""

import numpy as np
import pandas as pd
import pytest
from robots import moved_records, six_axes

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.inspection import missing_efforts
from sklearn_pgnn.physics.effects.wiring import ReversedInput
from sklearn_pgnn.priors import from_urdf
from sklearn_pgnn.record_quality.joint_torques import told_by_torques
from sklearn_pgnn.record_quality.wiring import find_wiring
from sklearn_pgnn.trajectories import read_records


def records_of(friction, n, tmp_path, **options):
    """Return the model of an arm without friction, and records of MuJoCo's with it."""
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "arm.urdf"
    path.write_text(six_axes(n))
    m = mujoco.MjModel.from_xml_string(six_axes(n, friction=friction))
    table = moved_records(m, [f"j{k + 1}" for k in range(n)], **options)
    arm = from_urdf(path)
    return arm, table[["trajectory", "t", *arm.inputs]], table[list(arm.outputs)]


@pytest.mark.slow
@pytest.mark.parametrize("rubbing", [{1: 12.0}, {2: 5.0, 3: 0.8}, {}])
def test_the_joints_with_friction_are_seen_at_once(rubbing, tmp_path):
    friction = tuple(rubbing.get(k, 0.0) for k in range(6))
    found = missing_efforts(*records_of(friction, 6, tmp_path))
    for k, name in enumerate(found.index):
        if k in rubbing:
            assert found.loc[name, "missing"] == pytest.approx(rubbing[k], rel=0.25)
            assert found.loc[name, "sign(flow)"] > 0.7
            assert found.loc[name, "sign(flow)"] == found.loc[name].iloc[2:-1].max()
        else:
            assert found.loc[name, "all"] < 0.05
    assert set(found["unit"]) == {"N m"}


def test_it_is_exact_where_the_records_are():
    cart = systems.cart_on_spring()
    t = np.arange(0, 10, 0.01)
    u = 30 * np.sin(2 * t) + 20 * np.sin(5 * t)
    run = (cart + effects.ViscousFriction("v", coefficient=7.0)).simulate(t, u, hold="foh")
    table = pd.DataFrame({"t": t, "force": u})
    found = missing_efforts(cart.replace(simulation={"hold": "foh"}), table, run.y)
    assert found.loc["v", "flow"] > 0.999
    v = np.gradient(run.x[:, 0], t)
    assert found.loc["v", "missing"] == pytest.approx(
        7.0 * np.sqrt(np.mean(v[20:-20] ** 2)), rel=0.01
    )


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (systems.two_tanks(), "no port whose flow is the slope of a state"),
        (
            systems.cart_on_spring().replace(outputs={"speed": "v**2"}),
            "no measured position of v, x",
        ),
        (
            PhysicsModel(
                {"x": "m", "v": "m/s"},
                {"x": "v", "v": "u/m"},
                {"m": 1.0, "late": 0.1},
                {"u": "N"},
                inertia={"v": "m"},
                delays={"u": "late"},
            ),
            "delays of u",
        ),
    ],
)
def test_what_is_no_mechanism_is_refused(model, said):
    X, y = np.zeros((30, 1 + len(model.inputs))), np.zeros((30, len(model.outputs)))
    with pytest.raises(ModelError, match=f"a port for every velocity.*{said}.*Remedy: declare"):
        missing_efforts(model, X, y)


@pytest.mark.slow
def test_channels_of_joints_whose_torque_agrees_are_not_doubted(tmp_path):
    arm, X, y = records_of((0.0, 9.0, 0.0), 3, tmp_path, records=2, samples=300)
    turned = X.assign(tau_j3=-X["tau_j3"])
    right = [told_by_torques(arm, read_records(arm, given, y), None) for given in (X, turned)]
    assert right[0] == {*X.columns[2:], *y.columns}
    assert right[1] == {"q_j1", "q_j2", "tau_j1", "tau_j2"}
    found = find_wiring(arm, read_records(arm, turned, y))
    assert found.wirings[0] == ReversedInput("tau_j3")
