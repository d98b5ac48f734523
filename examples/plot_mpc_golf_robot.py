"""
Does a controller profit from the mended model?
===============================================

A model predictive controller moves a golf robot slowly, where friction that is higher at rest than
in motion makes it stick and slip. The controller plans with a model: once with the model that does
not know of the stick-slip, and once with the mended one, as a diagnosis hands it over. The robot
itself is simulated with friction that sticks.
"""

# %%
# The models
# ----------
# An optimiser has to differentiate: `to_casadi` rounds the jump of dry friction off over a small
# speed.
import casadi
import matplotlib.pyplot as plt
import numpy as np

from sklearn_pgnn import effects, systems
from sklearn_pgnn.export import to_casadi

STEP, AHEAD = 0.02, 25
prior = systems.golf_robot()
machine = prior + effects.StribeckFriction("omega", level=0.1, peak=0.15, velocity=0.2)


def predicted_step(model):
    """Return the next sample of a model, and its derivatives."""
    step = to_casadi(model, STEP, friction_width=0.02, substeps=4)
    return step, step.jacobian()


# %%
# The controller
# --------------
# In every sample the model is linearised where the robot is, and a quadratic program finds the
# torques of the next half second: near the wanted angle, with little change, within 1 N m.


def make_controller(model):
    """Return a function of state, last torque and wanted angles that gives the next torque."""
    step, jacobian = predicted_step(model)
    program = casadi.Opti("conic")
    x, u = program.variable(2, AHEAD + 1), program.variable(1, AHEAD)
    now, last, wanted = program.parameter(2), program.parameter(), program.parameter(1, AHEAD)
    following, by_x, by_u = program.parameter(2), program.parameter(2, 2), program.parameter(2, 1)
    for k in range(AHEAD):
        moved = by_x @ (x[:, k] - now) + by_u @ (u[:, k] - last)
        program.subject_to(x[:, k + 1] == following + moved)
    change = casadi.diff(casadi.horzcat(last, u), 1, 1)
    program.subject_to(x[:, 0] == now)
    program.subject_to(program.bounded(-1, u, 1))
    program.minimize(100 * casadi.sumsqr(x[0, 1:] - wanted) + 0.1 * casadi.sumsqr(change))
    program.solver("qrqp", {"print_iter": False, "print_header": False, "print_time": False})

    def act(state, torque, angles):
        slopes = jacobian(state, [torque], [], 0, [], [])
        program.set_value(now, state)
        program.set_value(last, torque)
        program.set_value(wanted, angles)
        program.set_value(following, step(state, [torque], [], 0)[0])
        program.set_value(by_x, slopes[0])
        program.set_value(by_u, slopes[1])
        return float(program.solve().value(u)[0])

    return act


# %%
# Slowly up, and back
# -------------------
# The wanted angle rises to 0.6 rad within four seconds, waits, and falls back.
T = np.arange(600) * STEP
WANTED = np.interp(T, [0, 1, 5, 7, 11], [0.0, 0.0, 0.6, 0.6, 0.0])


def steer(model):
    """Return the angles of the robot, steered with a model."""
    act, state, torque, angles = make_controller(model), np.zeros(2), 0.0, []
    for k in range(len(T) - AHEAD):
        angles.append(state[0])
        torque = act(state, torque, WANTED[k + 1 : k + 1 + AHEAD])
        state = machine.simulate([0, STEP], [torque, torque], state, substeps=4).x[1]
    return np.array(angles)


figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.plot(T, WANTED, color="0.7", linewidth=4, label="wanted")
for name, model in (("the model without stick-slip", prior), ("the mended model", machine)):
    angle = steer(model)
    error = angle - WANTED[: len(T) - AHEAD]
    axes.plot(T[: len(angle)], angle, label=f"with {name}")
    print(f"with {name}: {1e3 * np.sqrt(np.mean(error**2)):.1f} mrad from the wanted angle")
axes.set(xlabel="t [s]", ylabel="angle [rad]")
axes.legend()

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_mpc_golf_robot.txt
#    :language: none
#
# .. image:: /_static/examples/plot_mpc_golf_robot.png
#    :alt: The wanted angle, and the angle of the robot steered with either model
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_mpc_golf_robot.png'
