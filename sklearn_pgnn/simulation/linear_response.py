r"""Linear response of the outputs to a small input added along a model's trajectories.

Along the trajectory of a window the response to a hidden input :math:`\theta` is linear,

.. math:: s_{k+1} = F_k s_k + G_k \tfrac12 (\theta_k + \theta_{k+1}), \qquad
          e_k = H_k s_k + D_k \theta_k,

with the transitions :math:`F_k, G_k` of one sample interval. So the responses to a hundred
candidate inputs cost little more than one simulation.
"""

import numpy as np
from numba import njit, types

from sklearn_pgnn.exceptions import SimulationError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.hidden_input import with_hidden_input
from sklearn_pgnn.simulation.kalman import filter_samples, multiply, set_unit
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.simulate import parameter_values
from sklearn_pgnn.simulation.source import differentiate
from sklearn_pgnn.simulation.stepping import INNER, OPTIONS, copy_rows
from sklearn_pgnn.simulation.windows import ShootingWindows

_F2, _F3, _I1 = types.float64[:, ::1], types.float64[:, :, ::1], types.int64[::1]


@njit(**INNER)
def _clear(table):
    """Fill a table with zeros."""
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            table[i, j] = 0.0


@njit(types.void(_F3, _F3, _I1, _I1, _F2, _F3, _F3), **OPTIONS)
def _respond(F, H, starts, lengths, theta, E, E0):
    """Fill E with the responses to the columns of theta, E0 with those to the initial states."""
    nx, m = F.shape[1] - 1, theta.shape[1]
    s, moved = np.zeros((nx + 1, m)), np.zeros((nx + 1, m))  # the input is the last state
    s0, moved0 = np.zeros((nx + 1, nx)), np.zeros((nx + 1, nx))
    for w in range(starts.size):
        end = starts[w] + lengths[w]
        _clear(s)
        set_unit(s0)
        for k in range(starts[w], end):
            for o in range(H.shape[1]):
                for i in range(nx):
                    for j in range(m):
                        E[k, o, j] += H[k, o, i] * s[i, j]
                    for j in range(nx):
                        E0[k, o, j] += H[k, o, i] * s0[i, j]
                for j in range(m):
                    E[k, o, j] += H[k, o, nx] * theta[k, j]
            if k + 1 == end:
                continue
            for j in range(m):
                s[nx, j] = 0.5 * (theta[k, j] + theta[k + 1, j])
            multiply(F[k], s, moved)
            multiply(F[k], s0, moved0)
            copy_rows(moved, s)
            copy_rows(moved0, s0)


def linear_responses(
    model: PhysicsModel, windows: ShootingWindows, x0: np.ndarray, channel: str, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the responses of the outputs to inputs added at a channel and to initial states."""
    F, H = linearise(model, windows, x0, channel)
    size, n_outputs = windows.y.shape
    responses = np.zeros((size, n_outputs, theta.shape[1]))
    by_state = np.zeros((size, n_outputs, len(model.states)))
    _respond(
        F, H, windows.starts, windows.lengths, np.ascontiguousarray(theta), responses, by_state
    )
    if not (np.isfinite(responses).all() and np.isfinite(by_state).all()):
        raise SimulationError(
            f"the responses of {model.name!r} to an input at {channel} become non-finite. "
            f"Remedy: shorter windows or more substeps (now {windows.substeps})."
        )
    return responses, by_state


def without_states(windows: ShootingWindows, table: np.ndarray, by_state: np.ndarray) -> np.ndarray:
    """Concatenate windows and outputs, less what the initial states of the windows explain."""
    rows = []
    for a, n in zip(windows.starts, windows.lengths, strict=True):
        measured = np.isfinite(windows.y[a : a + n])[..., None]
        part, known = (
            np.where(measured, values[a : a + n] / windows.scale[:, None], 0.0)
            for values in (table, by_state)
        )
        part = part.reshape(-1, table.shape[-1])
        basis = np.linalg.qr(known.reshape(-1, known.shape[-1]))[0]
        rows.append(part - basis @ (basis.T @ part))
    return np.concatenate(rows)


def linearise(
    model: PhysicsModel, windows: ShootingWindows, x0: np.ndarray, channel: str
) -> tuple[np.ndarray, np.ndarray]:
    """Linearise a model with a hidden input along the trajectories of windows."""
    extended = with_hidden_input(model, channel)
    F, x = transitions(extended, windows, np.column_stack([x0, np.zeros(len(x0))]))
    return F, output_slopes(extended, windows, x)


def transitions(
    model: PhysicsModel, windows: ShootingWindows, x0: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the transition over every sample interval, and the states, window by window."""
    compiled = compile_model(model, (), windows.method)
    u, p, nx = windows.acting_inputs(model), parameter_values(model), len(model.states)
    F, x = np.zeros((windows.t.size, nx, nx)), np.zeros((windows.t.size, nx))
    unseen = np.full(windows.y.shape, np.nan)
    noise = np.zeros(nx), np.full(windows.y.shape[1], np.inf)
    of_windows = windows.starts, windows.lengths, windows.usual_intervals
    for a, n, usual, start in zip(*of_windows, x0, strict=True):
        rows = slice(a, a + n)
        unused = np.empty((n, nx, nx)), np.empty((n, nx)), np.empty((n, nx, nx))
        first, into = (start, np.zeros((nx, nx))), (x[rows], *unused, F[rows])
        filter_samples(compiled, windows, rows, u, unseen, usual, p, first, noise, into)
    return F, x


def output_slopes(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray) -> np.ndarray:
    """Differentiate the outputs by the states at every sample."""
    table = sample_table(model, windows, x)
    slopes = np.zeros((windows.t.size, len(model.outputs), len(model.states)))
    for i, g in enumerate(model.outputs.values()):
        for j, state in enumerate(map(symbol, model.states)):
            if state in g.free_symbols:
                slope = differentiate(g, state)
                slopes[:, i, j] = evaluate_samples(slope, table, windows.t.size)
    return slopes
