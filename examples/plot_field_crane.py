"""
Crane: friction at a joint of a coupled machine
===============================================

A trolley with a swinging load: the motor's force in, position and angle of the rope out. The model
has no friction, and the simulated crane drifts away.
"""

# %%
# The files
# ---------
# A simulated crane writes them. Its rail rubs, forwards more than backwards, and what rubs at the
# trolley acts on the load as well: both accelerations feel it.
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, trajectories

folder, rng, t = Path(tempfile.mkdtemp()), np.random.default_rng(6), np.arange(0, 12, 0.02)
for run in range(3):
    parts = rng.uniform(0.1, 0.8, 3), rng.uniform(0, 2 * np.pi, 3)
    F = 60 * np.sin(2 * np.pi * np.outer(t, parts[0]) + parts[1]).sum(axis=1)

    def crane(now, s, F=F):
        _, v, a, w = s
        rubs = np.tanh(v / 2e-4)
        force = F[min(int(now / 0.02 + 1e-9), len(F) - 1)] - (25 if v > 0 else 15) * rubs
        rates = [[60, 15 * 1.2 * np.cos(a)], [np.cos(a), 1.2]]
        forces = [force + 15 * 1.2 * w**2 * np.sin(a), -9.81 * np.sin(a)]
        dv, dw = np.linalg.solve(rates, forces)
        return [v, dv, w, dw]

    how = {"max_step": 2e-3, "rtol": 1e-7, "atol": 1e-9, "method": "LSODA"}
    x, _, a, _ = solve_ivp(crane, (0, t[-1]), [0] * 4, t_eval=t, **how).y
    table = {"t": t, "F_motor": F, "x [mm]": 1e3 * x + 0.5 * rng.normal(size=t.size)}
    table["rope [deg]"] = np.degrees(a) + 0.02 * rng.normal(size=t.size)
    pd.DataFrame(table).to_csv(folder / f"crane_{run + 1}.csv", index=False)

# %%
# The model file
# --------------
# The equations are given as masses and forces; the package solves them for the accelerations. What
# acts at ``v`` is then a force at the trolley, whichever equations contain it.
(folder / "crane.yaml").write_text("""\
name: crane
states: {x: m, v: m/s, a: rad, w: rad/s}
inputs: {F: N}
outputs: {x: x, a: a}
parameters:
  M: {value: 45, unit: kg, spread: 0.1}
  m: {value: 15, unit: kg, fixed: true}
  l: {value: 1.2, unit: m, fixed: true}
  g: {value: 9.81, unit: m/s^2, fixed: true}
equations: {x: v, a: w}
inertia:
  v: [M + m, m*l*cos(a)]
  w: [m*l*cos(a), m*l**2]
forces:
  v: F + m*l*w**2*sin(a)
  w: -m*g*l*sin(a)
columns: {F: F_motor, a: rope}
""")
model = PhysicsModel.from_yaml(folder / "crane.yaml")
X, y = trajectories.read_files(sorted(folder.glob("crane_*.csv")), model)

# %%
# The diagnosis
# -------------
diagnosis = ModelDiagnosis(model).fit(X, y)
print(diagnosis.verdict_)
for cause in diagnosis.causes_:
    print(cause, cause.summary, sep="\n")
for name, value in diagnosis.parameters_.items():
    print(name, value)

# %%
# Measured, as given and extended, in windows:
display = diagnosis.plot()

# %%
# The decision
# ------------
# The rail, not the rope. Dry friction and a constant load are together a friction that is larger in
# one direction: a wheel that runs on its flange. A rail that is not level does the same, and so
# does a motor whose zero is off, and no record separates these; a spirit level does. Until the rail
# is set right both are compensated in the motor's command, and the free run of the extended model,
# in metres, says how well that will do.
print(diagnosis.free_run_["x"])

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_field_crane.txt
#    :language: none
#
# .. image:: /_static/examples/plot_field_crane.png
#    :alt: Measured motion, model as given and extended model
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_field_crane.png'
