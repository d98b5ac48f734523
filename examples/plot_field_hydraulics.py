"""
Hydraulic axis: the valve that does nothing at first
====================================================

A cylinder moves a slide. Voltage at the servo valve in, position and pressure out. Fast motions are
simulated well; slow ones hardly begin.
"""

# %%
# The files
# ---------
# A simulated axis writes them. Its valve spool overlaps: small voltages open nothing.
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, trajectories

folder, rng, t = Path(tempfile.mkdtemp()), np.random.default_rng(5), np.arange(0, 6, 0.005)
for run, size in enumerate((0.6, 1.2, 2.5)):
    parts = rng.uniform(0.3, 2.0, 3), rng.uniform(0, 2 * np.pi, 3)
    U = size * np.sin(2 * np.pi * np.outer(t, parts[0]) + parts[1]).sum(axis=1) / 1.5

    def axis(now, s, U=U):
        _, v, p = s
        u = U[min(int(now / 0.005 + 1e-9), len(U) - 1)]
        flow = 8e-5 * np.sign(u) * max(abs(u) - 0.22, 0.0)
        return [v, (8e-4 * p * 1e5 - 900 * v) / 80, (flow - 8e-4 * v - 2e-7 * p) / 4e-7]

    x, _, p = solve_ivp(axis, (0, t[-1]), [0, 0, 0], t_eval=t, max_step=1e-3, method="LSODA").y
    table = {"t;s": t, "U_valve;V": U, "x;mm": 1e3 * x + 0.02 * rng.normal(size=t.size)}
    table["p_load;bar"] = p + 0.02 * rng.normal(size=t.size)
    frame = pd.DataFrame(table)
    frame.columns = pd.MultiIndex.from_tuples([tuple(name.split(";")) for name in frame.columns])
    frame.to_csv(folder / f"axis_{run + 1}.csv", index=False)

# %%
# The model file
# --------------
# The files have a row with units below their header; it is read.
(folder / "axis.yaml").write_text("""\
name: hydraulic axis
states: {x: m, v: m/s, p: bar}
inputs: {U: V}
outputs: {x: x, p: p}
parameters:
  A: {value: 8.0e-4, unit: m^2, fixed: true}
  per_bar: {value: 1.0e+5, unit: Pa/bar, fixed: true}
  m: {value: 80, unit: kg}
  d: {value: 900, unit: N s/m, spread: 0.3}
  K: {value: 8.0e-5, unit: m^3/(s V), spread: 0.2}
  G: {value: 2.0e-7, unit: m^3/(s bar), spread: 0.5}
  Ch: {value: 4.0e-7, unit: m^3/bar, spread: 0.2}
equations:
  x: v
  v: (per_bar*A*p - d*v)/m
  p: (K*U - A*v - G*p)/Ch
inertia: {v: m}
columns: {U: U_valve, p: p_load}
""")
model = PhysicsModel.from_yaml(folder / "axis.yaml")
X, y = trajectories.read_files(sorted(folder.glob("axis_*.csv")), model)

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
# A dead zone in the valve, not friction in the cylinder: seals would not help. Its inverse in the
# controller, a jump of the voltage by twice the threshold through zero, makes slow motions follow;
# the extended model in C is what the controller needs for that
# (``sklearn-pgnn export --model extended_model.yaml --to c``).
print(diagnosis.free_run_["x"])

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_field_hydraulics.txt
#    :language: none
#
# .. image:: /_static/examples/plot_field_hydraulics.png
#    :alt: Measured position and pressure, model as given and extended model
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_field_hydraulics.png'
