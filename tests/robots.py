"""A six-axis arm of generic numbers as URDF, a tree of hinges and slides, and their records."""

import numpy as np
import pandas as pd

#: link before, origin, axis, mass, centre of mass, principal moments
SIX = (
    ("base", "0 0 0.3", "0 0 1", 18.0, "0.02 0.01 0.12", (0.3, 0.28, 0.2)),
    ("l1", "0.1 0 0.18", "0 1 0", 22.0, "0 0.04 0.3", (0.9, 0.95, 0.15)),
    ("l2", "0 0 0.62", "0 1 0", 9.0, "0.05 0 0.08", (0.09, 0.12, 0.1)),
    ("l3", "0.25 0 0.1", "1 0 0", 6.0, "0.18 0 0.01", (0.02, 0.08, 0.08)),
    ("l4", "0.38 0 0", "0 1 0", 2.2, "0.04 0 0", (0.004, 0.006, 0.006)),
    ("l5", "0.09 0 0", "1 0 0", 0.8, "0.03 0.004 0", (0.001, 0.0009, 0.0009)),
)
DAMPING = (2.0, 3.0, 2.0, 0.3, 0.1, 0.02)

TREE = """<mujoco model="tree"><option gravity="1 2 -9"/><worldbody>
<body pos="0 0 .3" euler="10 20 30"><joint name="a" axis="0 0 1" armature="0.3"/>
  <inertial pos="0.05 0.02 .1" mass="5" fullinertia="0.05 0.04 0.06 0.001 0.002 -0.003"/>
  <body pos="0.1 0 .2" euler="0 90 0"><joint name="b" axis="0 1 0.2" pos="0.01 0.02 0"/>
    <inertial pos="0.2 0 .1" mass="4" diaginertia="0.05 0.04 0.06"/>
    <body pos="0.4 0 0"><joint name="c" axis="0 1 0" ref="15"/>
      <joint name="d" type="slide" axis="1 0 0"/>
      <inertial pos="0.2 0 .1" mass="3" diaginertia="0.02 0.04 0.03"/>
      <body name="hand" pos="0.3 .1 0">
        <inertial pos="0.1 0 .1" mass=".3" diaginertia="0.002 0.004 0.003"/></body>
    </body>
  </body>
  <body pos="-.3 0 0"><joint name="e" axis="1 1 0"/>
    <inertial pos="0.1 0 .1" mass="1.2" diaginertia="0.002 0.004 0.003"/></body>
</body></worldbody></mujoco>"""


def six_axes(n: int = 6, damping=DAMPING, friction=(0.0,) * 6) -> str:
    """Return the URDF of the arm, or of its first joints."""
    parts = ['<robot name="six"><link name="base"/>']
    for k, (before, xyz, axis, mass, at, (ixx, iyy, izz)) in enumerate(SIX[:n]):
        parts.append(
            f'<link name="l{k + 1}"><inertial><origin xyz="{at}" rpy="0.1 0 0.2"/>'
            f'<mass value="{mass}"/><inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" '
            f'iyz="0"/></inertial><visual><geometry><mesh filename="package://six/{k}.stl"/>'
            f"</geometry></visual></link>"
            f'<joint name="j{k + 1}" type="revolute"><parent link="{before}"/>'
            f'<child link="l{k + 1}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
            f'<limit lower="-3" upper="3" effort="300" velocity="3"/>'
            f'<dynamics damping="{damping[k]}" friction="{friction[k]}"/></joint>'
        )
    return "\n".join([*parts, "</robot>"])


def moved_records(m, names, *, records=5, samples=500, interval=0.01, seed=0, noise=1e-4):
    """Return records of MuJoCo's own simulation under torques that follow sums of sines."""
    import mujoco

    m.opt.timestep, m.opt.integrator = interval / 20, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    m.jnt_limited[:] = 0
    data, rng, n = mujoco.MjData(m), np.random.default_rng(seed), m.nv
    tables = []
    for number in range(records):
        size, f, phase = (rng.uniform(a, b, (n, 4)) for a, b in ((0.1, 0.35), (0.1, 0.7), (0, 6.3)))
        middle, pace = 0.3 * rng.normal(size=n), 2 * np.pi * f
        mujoco.mj_resetData(m, data)
        data.qpos[:] = middle + (size * np.sin(phase)).sum(axis=1)
        data.qvel[:] = (size * pace * np.cos(phase)).sum(axis=1)
        rows = []
        for k in range(samples):
            t, torque = k * interval, np.zeros(n)
            wave, slope = np.sin(pace * t + phase), pace * np.cos(pace * t + phase)
            mujoco.mj_forward(m, data)
            wanted = (
                -(size * pace**2 * wave).sum(axis=1)
                + 100.0 * (middle + (size * wave).sum(axis=1) - data.qpos)
                + 20.0 * ((size * slope).sum(axis=1) - data.qvel)
            )
            mujoco.mj_mulM(m, data, torque, wanted)
            torque += data.qfrc_bias + m.dof_damping * data.qvel
            rows.append([number, t, *data.qpos, *torque])
            data.qfrc_applied[:] = torque
            for _ in range(20):
                mujoco.mj_step(m, data)
        tables.append(np.array(rows))
    columns = ["trajectory", "t", *(f"q_{j}" for j in names), *(f"tau_{j}" for j in names)]
    table = pd.DataFrame(np.vstack(tables), columns=columns).astype({"trajectory": int})
    table.iloc[:, 2 : 2 + n] += noise * rng.normal(size=(len(table), n))
    return table
