r"""How likely residuals are where an unmeasured input disturbs the machine.

Near the states of a window a hidden input :math:`d` changes states and outputs linearly,

.. math:: s_{k+1} = F_k s_k + G_k d_k, \qquad r_k = H_k s_k + D_k d_k + e_k, \qquad
          s_0 \sim N(m, P),

with the transitions :math:`F_k, G_k` of one sample interval, the expected initial state's distance
:math:`m` from the window's, and its variances :math:`P`. The input comes and goes,

.. math:: \mathrm{E}\, d(t)\, d(t') = v\, e^{-|t - t'|/T}.

A Kalman filter subtracts from every residual its prediction from those before; the likelihood is a
product over the remaining innovations [1]_. The common factor of all variances is profiled out; it
is not less than one.

References
----------
.. [1] F. C. Schweppe, "Evaluation of likelihood functions for Gaussian signals", IEEE Transactions
   on Information Theory 11(1), 1965, :doi:`10.1109/TIT.1965.1053737`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import njit, types
from scipy.optimize import minimize

from sklearn_pgnn.simulation.stepping import INNER, OPTIONS
from sklearn_pgnn.simulation.windows import ShootingWindows, in_parts

_F1, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_I1 = types.int64[::1]
#: decades of the hidden input's variance that are tried, about that of the channel, and of the time
#: in which it changes, about that of a window
FIRST_DECADES = [(v, T) for v in (-8.0, -6.0, -4.0, -2.0, 0.0, 2.0) for T in (-1.0, 0.0, 1.0)]
#: runs of the filter with which both are refined
RUNS = 30


class Disturbance(NamedTuple):
    """A hidden input with its variance [unit of the channel squared] over a time [s]."""

    variance: float
    time: float


@dataclass(frozen=True)
class LinearWindows:
    """Windows, linearised near their states.

    `F`, of shape (n_samples, n_states + 1, n_states + 1), are the transitions over the sample
    intervals, the hidden input last; `H`, (n_samples, n_outputs, n_states + 1), the derivatives of
    the outputs; `columns`, (n_samples, n_outputs, n_columns), the residuals' derivatives by
    parameters, if any, and the residuals, NaN where there is none. `mean`, (n_windows, n_states),
    is the expected initial states minus those of the windows, and `covariance`, (n_windows,
    n_states, n_states), their uncertainty; `variance`, (n_outputs,), is that of the outputs' noise.
    """

    windows: ShootingWindows
    F: np.ndarray
    H: np.ndarray
    columns: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    variance: np.ndarray

    def select(self, which) -> "LinearWindows":
        """Return the windows of a mask or of indices."""
        return replace(
            self,
            windows=self.windows.select(which),
            mean=self.mean[which],
            covariance=self.covariance[which],
        )


class Innovations(NamedTuple):
    """Innovations: the part of the residuals that earlier samples do not predict.

    `gram`, of shape (n_windows, n_columns, n_columns), has the products of the columns'
    innovations, in units of their standard deviations; `log_variance` is the sum of the logarithms
    of the variances, and `n` the number of residuals.
    """

    gram: np.ndarray
    log_variance: float
    n: int

    @property
    def log_likelihood(self) -> float:
        r"""The residuals' logarithmic likelihood but for a constant; minus infinity if not finite.

        .. math:: \max_{c \ge 1} \left( -\tfrac12 \sum_k \log c^2 S_k
                  - \tfrac12 \sum_k \frac{\nu_k^2}{c^2 S_k} \right)
        """
        squares = float(self.gram[:, -1, -1].sum())
        if not (math.isfinite(squares) and math.isfinite(self.log_variance) and squares > 0.0):
            return -math.inf
        factor = max(1.0, squares / self.n)
        return -0.5 * (self.log_variance + self.n * math.log(factor) + squares / factor)


def innovations(linear: LinearWindows, disturbance: Disturbance) -> Innovations:
    """Filter the residuals of windows, and their derivatives."""
    windows = linear.windows
    gaps = np.diff(windows.t, append=windows.t[-1])
    kept = np.exp(-np.maximum(gaps, 0.0) / disturbance.time)
    gram = np.zeros((len(windows), *2 * linear.columns.shape[2:]))
    log_variance, count = np.empty(len(windows)), np.empty(len(windows), dtype=int)

    def run(part):
        _filter(
            linear.F,
            linear.H,
            linear.columns,
            windows.starts[part],
            windows.lengths[part],
            kept,
            disturbance.variance,
            linear.mean[part],
            linear.covariance[part],
            linear.variance,
            gram[part],
            log_variance[part],
            count[part],
        )

    in_parts(run, windows)
    return Innovations(gram, float(log_variance.sum()), int(count.sum()))


def likeliest(
    linear: LinearWindows,
    size: float,
    time: float,
    start: Disturbance | None = None,
    each_run: Callable[[], bool | None] = lambda: None,
) -> tuple[Disturbance, float]:
    """Find the hidden input that makes residuals likeliest."""

    def at(decades) -> Disturbance:
        return Disturbance(size**2 * 10.0 ** decades[0], time * 10.0 ** decades[1])

    def badness(decades) -> float:
        each_run()
        return -innovations(linear, at(decades)).log_likelihood

    if start is None:
        first = min(FIRST_DECADES, key=badness)
    else:
        first = (math.log10(start.variance / size**2), math.log10(start.time / time))
    simplex = np.add(first, [[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]])
    found = minimize(
        badness,
        first,
        method="Nelder-Mead",
        options={"maxfev": RUNS, "initial_simplex": simplex},
    )
    return at(found.x), -float(found.fun)


@njit(**INNER)
def _take_in(residual, H, variance, s, C, gain, e, gram):
    """Let the states, in place, know of an output's residuals; return their variance.

    Products of what is left of the residuals, in units of its standard deviation, are added to
    ``gram``.
    """
    n, q = s.shape
    spread = variance
    for c in range(q):
        e[c] = residual[c]
    for i in range(n):
        gain[i] = 0.0
    for j in range(n):
        if H[j] == 0.0:
            continue
        for i in range(n):
            gain[i] += C[j, i] * H[j]
        for c in range(q):
            e[c] -= H[j] * s[j, c]
    for i in range(n):
        spread += H[i] * gain[i]
    weight = 1.0 / spread
    for a in range(q):
        for b in range(q):
            gram[a, b] += e[a] * e[b] * weight
    for i in range(n):
        share = gain[i] * weight
        for c in range(q):
            s[i, c] += share * e[c]
        for j in range(n):
            C[i, j] -= weight * (gain[i] * gain[j])
    return spread


@njit(**INNER)
def _go_on(F, left, v, s, C, moved, half):
    """Lead the states, in place, to the next sample; a share ``left`` of the hidden input stays.

    Nothing but itself changes the hidden input, the last of the states. Rows are added to rows, so
    that several numbers are worked on at once; a zero costs nothing.
    """
    n, q = s.shape
    m = n - 1
    for i in range(m):
        for c in range(q):
            moved[i, c] = 0.0
        for j in range(n):
            half[i, j] = 0.0
        for k in range(n):
            along = F[i, k]
            if along == 0.0:
                continue
            for c in range(q):
                moved[i, c] += along * s[k, c]
            for j in range(n):
                half[i, j] += along * C[k, j]
    for j in range(n):
        half[m, j] = 0.0
    for c in range(q):
        for i in range(m):
            s[i, c] = moved[i, c]
        s[m, c] *= left
    for i in range(n):
        for j in range(i):
            half[i, j], half[j, i] = half[j, i], half[i, j]
    for i in range(m):
        for j in range(i + 1):
            C[i, j] = 0.0
        for k in range(n):
            along = F[i, k]
            if along == 0.0:
                continue
            for j in range(i + 1):
                C[i, j] += along * half[k, j]
        for j in range(i):
            C[j, i] = C[i, j]
        C[i, m] = C[m, i] = left * half[m, i]
    C[m, m] = v + left**2 * (C[m, m] - v)


@njit(
    types.void(_F3, _F3, _F3, _I1, _I1, _F1, types.float64, _F2, _F3, _F1, _F3, _F1, _I1),
    **OPTIONS,
)
def _filter(
    F, H, columns, starts, lengths, kept, v, mean, covariance, variance, gram, log_variance, count
):
    """Sum up the products of the innovations of every window, and what else makes its likelihood.

    ``kept`` is the share of the hidden input that a sample interval leaves. Outputs are taken in
    one after the other, their noise being independent. ``log_variance`` becomes the sum of the
    logarithms of the innovations' variances, ``count`` their number.
    """
    n, q = F.shape[1], columns.shape[2]
    s, moved, e = np.zeros((n, q)), np.zeros((n, q)), np.zeros(q)
    C, half, gain = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    for w in range(starts.size):
        s[:], C[:] = 0.0, 0.0
        for i in range(n - 1):
            s[i, q - 1] = mean[w, i]
            for j in range(n - 1):
                C[i, j] = covariance[w, i, j]
        C[n - 1, n - 1] = v
        total, seen = 0.0, 0
        end = starts[w] + lengths[w]
        for k in range(starts[w], end):
            for o in range(H.shape[1]):
                if math.isnan(columns[k, o, q - 1]):
                    continue
                spread = _take_in(columns[k, o], H[k, o], variance[o], s, C, gain, e, gram[w])
                total += math.log(spread)
                seen += 1
            if k + 1 < end:
                _go_on(F[k], kept[k], v, s, C, moved, half)
        log_variance[w], count[w] = total, seen
