"""
Process: a vessel that fouls
============================

Six batches were heated in one vessel, one after the other. The model of the first fits; by the
sixth the vessel heats too slowly. Is it a heater that ages, or the wall that fouls?
"""

# %%
# The files
# ---------
# A simulated vessel writes them: its heat transfer from the jacket falls from batch to batch.
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, trajectories

folder, rng, t = Path(tempfile.mkdtemp()), np.random.default_rng(4), np.arange(0, 7200, 20.0)
for batch in range(6):
    jacket = 40 + 30 * np.repeat(rng.uniform(0, 1, size=24), 15)
    UA = 420 - 25 * batch

    def vessel(now, T, jacket=jacket, UA=UA):
        k = min(int(now / 20 + 1e-9), len(jacket) - 1)
        return (UA * (jacket[k] - T) - 15 * (T - 20)) / 8.4e5

    T = solve_ivp(vessel, (0, t[-1]), [22.0], t_eval=t, max_step=10).y[0]
    table = {"Time (min)": t / 60, "TT101 (degC)": jacket, "TT102 (degC)": T}
    table["TT102 (degC)"] += 0.05 * rng.normal(size=t.size)
    pd.DataFrame(table).to_csv(folder / f"batch_{batch + 1}.csv", index=False)

# %%
# The model file
# --------------
(folder / "vessel.yaml").write_text("""\
name: vessel
states: {T: degC}
inputs: {jacket: degC}
outputs: {T_vessel: T}
parameters:
  C: {value: 8.4e+5, unit: J/K, spread: 0.05}
  UA: {value: 400, unit: W/K, spread: 0.3}
  loss: {value: 15, unit: W/K, fixed: true}
  room: {value: 20, unit: degC, fixed: true}
equations: {T: (UA*(jacket - T) - loss*(T - room))/C}
capacity: {T: C}
initial_state: {T: 22}
columns: {t: "Time (min) [min]", jacket: TT101, T_vessel: TT102}
""")
model = PhysicsModel.from_yaml(folder / "vessel.yaml")
X, y = trajectories.read_files(sorted(folder.glob("batch_*.csv")), model)

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
# The heat transfer falls by 25 W/K from batch to batch, and nothing else changes: the wall fouls.
# In six more batches half of what is left is lost, and cleaning has to be planned before that. A
# new batch is predicted with its place in the sequence, 0 for the first and 1 for the sixth.
print(diagnosis.groups_)

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_field_process.txt
#    :language: none
#
# .. image:: /_static/examples/plot_field_process.png
#    :alt: Measured temperature, model as given and extended model
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_field_process.png'
