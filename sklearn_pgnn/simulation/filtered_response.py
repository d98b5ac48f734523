r"""Linear response to a hidden input along the states estimated by a filter.

If a model does not follow a record, a linearisation along its own trajectory says little about the
states in which the machine was: the scale of a nonlinear sensor bends elsewhere. An extended Kalman
filter estimates these states, :math:`\hat x_{k|k-1}` before a sample is read and
:math:`\hat x_{k|k}` after it. Near them the model is

.. math:: x_{k+1} = \hat x_{k+1|k} + F_k (x_k - \hat x_{k|k}), \qquad
          y_k = h(\hat x_{k|k-1}) + H_k (x_k - \hat x_{k|k-1}).

Every sample is predicted from those before it, so likelihoods stay those of predictions [1]_.

References
----------
.. [1] A. H. Jazwinski, "Stochastic Processes and Filtering Theory", Academic Press, 1970, ch. 8.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, types

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.disturbance import Disturbance
from sklearn_pgnn.simulation.hidden_input import with_hidden_input
from sklearn_pgnn.simulation.kalman import filter_samples
from sklearn_pgnn.simulation.linear_response import output_slopes
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.simulate import parameter_values
from sklearn_pgnn.simulation.stepping import OPTIONS, copy_values
from sklearn_pgnn.simulation.windows import ShootingWindows

_F2, _F3, _I1 = types.float64[:, ::1], types.float64[:, :, ::1], types.int64[::1]


class Starts(NamedTuple):
    """Where windows begin.

    `x0` are the initial states of their simulations, `mean` the expected ones minus those, of shape
    (n_windows, n_states), and `covariance`, (n_windows, n_states, n_states), their uncertainty.
    """

    x0: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray


def linearise_filtered(
    model: PhysicsModel,
    windows: ShootingWindows,
    starts: Starts,
    channel: str,
    disturbance: Disturbance,
    variance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Linearise a model with a hidden input along the states estimated by a filter in windows."""
    extended = with_hidden_input(model, channel)
    filtered, predicted, F = _filter(extended, windows, starts, disturbance, variance)
    H = output_slopes(extended, windows, predicted)
    table = sample_table(extended, windows, predicted)
    outputs = [evaluate_samples(g, table, windows.t.size) for g in extended.outputs.values()]
    residual = np.ascontiguousarray(windows.y - np.column_stack(outputs))
    begun = np.column_stack([starts.x0, np.zeros(len(windows))])
    _subtract_response(F, H, filtered, predicted, windows.starts, windows.lengths, begun, residual)
    return F, H, residual


def _filter(model, windows, starts: Starts, disturbance: Disturbance, variance):
    """Return the states after and before every sample, and the transitions, window by window."""
    compiled = compile_model(model, (), windows.method)
    u, p = windows.acting_inputs(model), parameter_values(model)
    n, size = len(model.states), windows.t.size
    filtered, predicted = np.full((size, n), np.nan), np.full((size, n), np.nan)
    F, P0 = np.zeros((size, n, n)), np.zeros((n, n))
    diffusion = np.zeros(n)
    diffusion[-1], P0[-1, -1] = 2.0 * disturbance.variance / disturbance.time, disturbance.variance
    expected = np.column_stack([starts.x0 + starts.mean, np.zeros(len(windows))])
    noise = diffusion, variance
    of_windows = windows.starts, windows.lengths, windows.usual_intervals
    for w, (a, count, usual) in enumerate(zip(*of_windows, strict=True)):
        rows, P0[:-1, :-1] = slice(a, a + count), starts.covariance[w]
        P, Pp = np.empty((count, n, n)), np.empty((count, n, n))
        into, first = (filtered[rows], P, predicted[rows], Pp, F[rows]), (expected[w], P0)
        filter_samples(compiled, windows, rows, u, windows.y, usual, p, first, noise, into)
    return filtered, predicted, F


@njit(types.void(_F3, _F3, _F2, _F2, _I1, _I1, _F2, _F2), **OPTIONS)
def _subtract_response(F, H, filtered, predicted, starts, lengths, begun, residual):
    """Subtract from the prediction errors the linear model's deviation from the predictions."""
    n = F.shape[1]
    x, moved = np.zeros(n), np.zeros(n)
    for w in range(starts.size):
        copy_values(begun[w], x)
        end = starts[w] + lengths[w]
        for k in range(starts[w], end):
            for o in range(H.shape[1]):
                for i in range(n):
                    residual[k, o] -= H[k, o, i] * (x[i] - predicted[k, i])
            if k + 1 == end:
                continue
            for i in range(n):
                moved[i] = predicted[k + 1, i]
                for j in range(n):
                    moved[i] += F[k, i, j] * (x[j] - filtered[k, j])
            copy_values(moved, x)
