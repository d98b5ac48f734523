"""
Battery: a cell that recovers
=============================

A cell is charged and discharged in pulses by a cycler. Its model is a charge, a line of the
open-circuit voltage, and a resistance. After every pulse the measured voltage creeps for minutes,
and the simulated one jumps.
"""

# %%
# The files
# ---------
# Cyclers write one file a test. Here a simulated cell stands for the real one: between its
# terminals something relaxes.
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, trajectories

folder, rng = Path(tempfile.mkdtemp()), np.random.default_rng(1)
for test in range(3):
    current = np.repeat(rng.choice([-4.0, -2.0, 0.0, 0.0, 2.0, 4.0], size=30), 60)
    charge = 0.5 + np.cumsum(np.r_[0.0, current[:-1]]) / 10440
    relaxed = np.zeros(len(current))
    for k in range(1, len(current)):
        end = 0.018 * current[k - 1]
        relaxed[k] = end + (relaxed[k - 1] - end) * np.exp(-1 / 45)
    voltage = 3.30 + 0.8 * charge + 0.031 * current + relaxed
    table = {"Test_Time(s)": np.arange(len(current)), "Current(A)": current}
    table["Voltage(V)"] = np.round(voltage + 5e-4 * rng.normal(size=len(current)), 4)
    pd.DataFrame(table).to_csv(folder / f"cell_{test + 1}.csv", index=False)

# %%
# The model file
# --------------
# ``spread`` is how far a value may be off, as a share: the resistance of the data sheet is half a
# guess, and the line of the open-circuit voltage was measured at rest.
(folder / "cell.yaml").write_text("""\
name: cell
states: {z: ""}
inputs: {I: A}
outputs: {V: E0 + E1*z + R0*I}
parameters:
  Q: {value: 10440, unit: A s, fixed: true}
  E0: {value: 3.3, unit: V, fixed: true}
  E1: {value: 0.8, unit: V, spread: 0.02}
  R0: {value: 0.04, unit: Ohm, spread: 0.5}
equations: {z: I/Q}
initial_state: {z: 0.5}
columns: {t: Test_Time(s), I: Current(A), V: Voltage(V)}
""")
model = PhysicsModel.from_yaml(folder / "cell.yaml")
X, y = trajectories.read_files(sorted(folder.glob("cell_*.csv")), model)

# %%
# The diagnosis
# -------------
# On the command line: ``sklearn-pgnn diagnose --model cell.yaml cell_*.csv --output cell``.
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
# What the data sheet calls a resistance is two things: one that acts at once, and a branch that
# takes three quarters of a minute. A charger that reads the voltage under load waits that long, or
# uses the extended model, which is one line longer:
print(diagnosis.extended_model_.to_text())

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_field_battery.txt
#    :language: none
#
# .. image:: /_static/examples/plot_field_battery.png
#    :alt: Measured voltage, model as given and extended model
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_field_battery.png'
