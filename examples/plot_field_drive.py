"""
Drive: the tool that was changed
================================

Five runs of a spindle with its motor: voltage in, speed and current out. The model was fitted last
year and was good. Now two of the five runs do not fit, and nobody wrote down what was different.
"""

# %%
# The files
# ---------
# Here a simulated spindle writes them. It has dry friction, which the model lacks, and in two runs
# a heavier tool.
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, trajectories

folder, rng, t = Path(tempfile.mkdtemp()), np.random.default_rng(2), np.arange(0, 8, 0.01)
for run in range(5):
    inertia = 0.026 if run in (1, 3) else 0.020
    parts = rng.uniform(0.2, 2.0, 3), rng.uniform(0, 2 * np.pi, 3)
    U = 7 * np.sin(2 * np.pi * np.outer(t, parts[0]) + parts[1]).sum(axis=1)

    def spindle(now, x, U=U, inertia=inertia):
        w, i = x
        voltage = U[min(int(now / 0.01 + 1e-9), len(U) - 1)]
        torque = 0.5 * i - 0.01 * w - 0.35 * np.tanh(w / 0.02)
        return [torque / inertia, (voltage - 2 * i - 0.5 * w) / 0.05]

    w, i = solve_ivp(spindle, (0, t[-1]), [0, 0], t_eval=t, max_step=1e-3, method="LSODA").y
    table = {
        "time": t,
        "U / V": U,
        "speed / rpm": 60 / (2 * np.pi) * w + 0.3 * rng.normal(size=t.size),
    }
    table["current / A"] = i + 0.01 * rng.normal(size=t.size)
    pd.DataFrame(table).to_csv(folder / f"run_{run + 1}.csv", index=False)

# %%
# The model file
# --------------
# The speed in the files is in rpm, that of the model in rad/s; it is converted.
(folder / "spindle.yaml").write_text("""\
name: spindle
states: {w: rad/s, i: A}
inputs: {U: V}
outputs: {speed: w, current: i}
parameters:
  J: {value: 0.021, unit: kg m^2}
  d: {value: 0.01, unit: N m s, spread: 0.5}
  K: {value: 0.5, unit: V s, fixed: true}
  R: {value: 2.0, unit: Ohm}
  L: {value: 0.05, unit: H, fixed: true}
equations: {w: (K*i - d*w)/J, i: (U - R*i - K*w)/L}
inertia: {w: J}
columns: {t: time}
""")
model = PhysicsModel.from_yaml(folder / "spindle.yaml")
X, y = trajectories.read_files(sorted(folder.glob("run_*.csv")), model)

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
# There are two causes, and the report names the runs of the second. The friction belongs into the
# model; the inertia into the log book: which tool was on the spindle is an input of the extended
# model from now on, 1 in the runs with the heavy one.
print(diagnosis.groups_)

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_field_drive.txt
#    :language: none
#
# .. image:: /_static/examples/plot_field_drive.png
#    :alt: Measured speed and current, model as given and extended model
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_field_drive.png'
