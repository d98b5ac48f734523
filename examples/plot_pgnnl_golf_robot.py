"""
Five ways to mend the model of a golf robot
===========================================

A golf robot is a driven pendulum whose bearing sticks and slips; its physical model only knows dry
friction that grows with the load. Residual modelling, sparse regression (SINDYc), a plain network
and the physics-guided network (PGNN-L) learn from the same records and then run freely along one
that none of them has seen.

Needs ``pip install ".[network,sindy]"``.
"""

# %%
# The records
# -----------
# Six records of ten seconds to learn from, and a multi-sine as reference: the motor's torque and
# the measured angle with 1 mrad of noise. Of the states only the first row of a record is known.
import matplotlib.pyplot as plt
import numpy as np
from threadpoolctl import threadpool_limits

from sklearn_pgnn import (
    PGNNLRegressor,
    ResidualRegressor,
    SINDYcRegressor,
    datasets,
    make_pgnn_pipeline,
    systems,
)

threadpool_limits(1)  # more threads only cost time for networks this small
golf = systems.golf_robot()
X, y = datasets.make_golf_robot(sample_rate=200)
X_reference, y_reference = datasets.make_golf_robot(reference=True, sample_rate=200)
t, measured = X_reference["t"].to_numpy(), y_reference.to_numpy().ravel()

# %%
# The candidates
# --------------
# The library of the second SINDYc is made of the terms of the model's own equations and of a sharp
# change of the friction's sign; that of the first one knows nothing of friction. The pipeline of
# the PGNN-L simulates the model, standardises what comes out, and trains the network.
candidates = {
    "residual model": ResidualRegressor(golf),
    "SINDYc, states and sines": SINDYcRegressor(golf, library=["polynomial", "fourier"], degree=1),
    "SINDYc, the model's terms": SINDYcRegressor(golf, library=["model", "tanh(omega/0.02)"]),
    "plain network": PGNNLRegressor(states=["phi", "omega"]),
    "PGNN-L": make_pgnn_pipeline(golf),
}

# %%
# Free runs along the reference
# -----------------------------
# Nothing measured is fed back: every error made on the way is carried on.
start = X_reference[["phi", "omega"]].iloc[0]
runs = {"physical model": golf.simulate(t, X_reference[["torque"]], start).y.ravel()}
for name, estimator in candidates.items():
    runs[name] = np.ravel(estimator.fit(X, y).predict(X_reference))

error = {name: np.sqrt(np.mean((run - measured) ** 2)) for name, run in runs.items()}
for name, value in error.items():
    share = value / error["physical model"]
    print(f"{name:26} {1000 * value:6.1f} mrad, {share:.2f} of the model's")

# %%
# What was found
# --------------
# SINDYc writes equations, and a PGNN-L says which structure it took: here it corrects the model's
# own step. A residual model cannot act back on the simulation it corrects.
print("\n".join(candidates["SINDYc, the model's terms"].equations_))
print(candidates["PGNN-L"][-1].structure_)

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), sharex=True, layout="constrained")
above.plot(t, measured, color="0.7", linewidth=3, label="measured")
for name in ("physical model", "plain network", "PGNN-L"):
    above.plot(t, runs[name], linewidth=1, label=name)
for name in ("physical model", "residual model", "SINDYc, the model's terms", "PGNN-L"):
    below.plot(t, 1000 * (runs[name] - measured), linewidth=1, label=name)
above.set_ylabel("angle [rad]")
below.set(xlabel="time [s]", ylabel="error [mrad]")
for axes in (above, below):
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, frameon=False, fontsize="small")

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_pgnnl_golf_robot.txt
#    :language: none
#
# .. image:: /_static/examples/plot_pgnnl_golf_robot.png
#    :alt: Free runs of the models along a record that none has seen
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_pgnnl_golf_robot.png'
