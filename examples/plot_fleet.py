"""
A fleet of carts
================

Ten carts of one kind, each with a mass of its own. Two of them rub, and one lost its oil since the
last time.
"""

# %%
# The machines and their records
# ------------------------------
import matplotlib.pyplot as plt
import numpy as np

from sklearn_pgnn import FleetDiagnosis, PhysicsModel, effects

cart = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}, inertia={"v": "m"}
)
t = np.arange(0, 30, 0.02)
F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
rng = np.random.default_rng(0)


def records(machine):
    v = machine.simulate(t, F, substeps=5).y
    return np.column_stack([t, F]), v + 1e-3 * rng.normal(size=v.shape)


rigs = {f"cart {k}": cart.with_parameters(m=2.0 + 0.05 * rng.normal()) for k in range(10)}
for name in ("cart 3", "cart 8"):
    rigs[name] += effects.CoulombFriction("v", level=0.3)

# %%
# The first time
# --------------
options = {"catalogue": ["coulomb_friction", "quadratic_drag", "input_bias"]}
march = FleetDiagnosis(cart, options=options)
march.fit({name: records(rig) for name, rig in rigs.items()})
print(march.to_frame()[["machine", "verdict", "causes", "sure"]].to_string())

# %%
# What is usual
# -------------
mass = march.parameters_["m"]
print(f"mass: usually {mass.usual:.3f} kg, {mass.spread:.3f} kg between carts")
names, found = list(mass.values), np.array(list(mass.values.values()))
errors = np.abs(found[:, 1:] - found[:, :1]).T
plt.errorbar(names, found[:, 0], errors, fmt="o")
plt.axhline(mass.usual, color="gray")
plt.ylabel("m [kg]")
plt.xticks(rotation=45)
plt.tight_layout()

# %%
# The next time
# -------------
# The damping of one cart has doubled; nothing else is significant.
rigs["cart 5"] = rigs["cart 5"].with_parameters(d=1.0)
april = FleetDiagnosis(cart, options=options, earlier=march)
april.fit({name: records(rig) for name, rig in rigs.items()})
print(april.changes_frame().to_string())
