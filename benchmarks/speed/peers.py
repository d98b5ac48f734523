"""The same pendulum in other hands: loops written for it, and the packages that simulate."""

import ctypes
import math
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi
import control
import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from sklearn_pgnn import PhysicsModel, systems

STEP = 1e-3
GOLF = systems.golf_robot()
#: the golf robot without its dry friction
PENDULUM = PhysicsModel(
    name="pendulum",
    states=GOLF.states,
    equations={"phi": "omega", "omega": "(-m*g*a*sin(phi) - d*omega + 4*torque)/J"},
    parameters={name: GOLF.parameters[name] for name in ("m", "a", "J", "d", "g")},
    inputs=GOLF.inputs,
    outputs=GOLF.outputs,
)
M, A, J, D, G = (PENDULUM.parameters[name].value for name in ("m", "a", "J", "d", "g"))


def record(samples):
    """Return time and a torque that does not drive the pendulum over the top."""
    t = np.arange(samples) * STEP
    return t, 0.1 * np.sin(2 * t) + 0.1 * np.sin(7 * t)


@njit(error_model="numpy")
def _acceleration(phi, omega, torque):
    return (-M * G * A * math.sin(phi) - D * omega + 4 * torque) / J


@njit(error_model="numpy")
def numba_loop(t, u, states):
    """Step RK4 by hand; the torque is held."""
    phi = omega = 0.0
    for k in range(t.size):
        states[k, 0], states[k, 1] = phi, omega
        h = t[k + 1] - t[k] if k + 1 < t.size else 0.0
        v1, a1 = omega, _acceleration(phi, omega, u[k])
        v2 = omega + h / 2 * a1
        a2 = _acceleration(phi + h / 2 * v1, v2, u[k])
        v3 = omega + h / 2 * a2
        a3 = _acceleration(phi + h / 2 * v2, v3, u[k])
        v4 = omega + h * a3
        a4 = _acceleration(phi + h * v3, v4, u[k])
        phi += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        omega += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


C_LOOP = f"""
#include <math.h>

static double acceleration(double phi, double omega, double torque)
{{
    return (-{M!r} * {G!r} * {A!r} * sin(phi) - {D!r} * omega + 4 * torque) / {J!r};
}}

void run(long n, const double *t, const double *u, double *states)
{{
    double phi = 0, omega = 0;
    for (long k = 0; k < n; k++) {{
        states[2 * k] = phi;
        states[2 * k + 1] = omega;
        double h = k + 1 < n ? t[k + 1] - t[k] : 0;
        double v1 = omega, a1 = acceleration(phi, omega, u[k]);
        double v2 = omega + h / 2 * a1, a2 = acceleration(phi + h / 2 * v1, v2, u[k]);
        double v3 = omega + h / 2 * a2, a3 = acceleration(phi + h / 2 * v2, v3, u[k]);
        double v4 = omega + h * a3, a4 = acceleration(phi + h * v3, v4, u[k]);
        phi += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
        omega += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }}
}}
"""


def c_loop():
    """Return the loop in C, compiled by gcc, as a function of time, torque and states."""
    with TemporaryDirectory() as folder:
        source, library = Path(folder, "loop.c"), Path(folder, "loop.so")
        source.write_text(C_LOOP, encoding="utf-8")
        options = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run(["gcc", *options, source, "-o", library, "-lm"], check=True)
        run = ctypes.CDLL(str(library)).run
    run.argtypes = [ctypes.c_long, *[ctypes.c_void_p] * 3]
    run.restype = None
    return lambda t, u, states: run(t.size, t.ctypes.data, u.ctypes.data, states.ctypes.data)


def casadi_run(t, u):
    """Return a simulation by CasADi's ``mapaccum`` of one RK4 step."""
    x, torque = casadi.SX.sym("x", 2), casadi.SX.sym("torque")

    def rates(x):
        turning = -M * G * A * casadi.sin(x[0]) - D * x[1] + 4 * torque
        return casadi.vertcat(x[1], turning / J)

    k1 = rates(x)
    k2 = rates(x + STEP / 2 * k1)
    k3 = rates(x + STEP / 2 * k2)
    k4 = rates(x + STEP * k3)
    after = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    run = casadi.Function("step", [x, torque], [after]).mapaccum(t.size - 1)
    return lambda: run(np.zeros(2), u[None, :-1])


def control_run(t, u):
    """Return a simulation by python-control, in steps no longer than a sample."""

    def rates(now, x, torque, parameters):
        return np.array([x[1], (-M * G * A * math.sin(x[0]) - D * x[1] + 4 * torque[0]) / J])

    system = control.nlsys(rates, None, inputs=1, states=2, outputs=2)
    options = {"max_step": STEP}
    return lambda: control.input_output_response(system, t, u, solve_ivp_kwargs=options)


def scipy_run(t, u, tolerance):
    """Return a simulation by SciPy, the torque being held from sample to sample."""

    def rates(now, x):
        k = min(int(now / STEP + 1e-9), t.size - 1)
        return x[1], (-M * G * A * math.sin(x[0]) - D * x[1] + 4 * u[k]) / J

    def run():
        return solve_ivp(
            rates, (t[0], t[-1]), [0.0, 0.0], t_eval=t, max_step=STEP, rtol=tolerance, atol=1e-12
        ).y.T

    return run
