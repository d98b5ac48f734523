r"""The time loop: explicit Runge-Kutta steps of a model and of its sensitivities, compiled.

The sensitivities :math:`S = \partial x / \partial(p, x_0)` follow
:math:`\dot S = \frac{\partial f}{\partial x} S + \frac{\partial f}{\partial p}` and are carried
through the same steps.

Dry friction is not smoothed. Between two changes of sign the equations are smooth; where a state
under dry friction crosses zero the step is cut there, and the state sticks as long as both
directions push it back (Filippov's rule). At such an event at time :math:`\tau` the sensitivities
jump, :math:`S^+ = S^- - (f^- - f^+)\, S_i^- / f_i^-`, with :math:`i` the state that crossed.
"""

import math

import numpy as np
from numba import boolean, int64, njit, types

from sklearn_pgnn.simulation.cache_folder import numba_caches
from sklearn_pgnn.simulation.compiled import FUNCTION, call
from sklearn_pgnn.simulation.lanes import LANES, add_multiple
from sklearn_pgnn.simulation.model_function import OBSERVE, RATES, STEP

#: an interval of more than so many usual ones takes more steps than they do
LONG = 1.5
#: most usual intervals that one counts for: a gap of years must not stall a simulation
MOST_SAMPLES = 1e6
#: events handled exactly within one step; further ones are stepped over
MAX_EVENTS = 6

_F = types.float64
_F1, _F2 = types.float64[::1], types.float64[:, ::1]
_F3, _F4 = types.float64[:, :, ::1], types.float64[:, :, :, ::1]
_B1 = boolean[::1]
OPTIONS = {"cache": numba_caches(), "error_model": "numpy", "nogil": True}
#: for functions that allocate nothing, called by compiled ones only: counting references takes
#: longer than a step, and wrappers for other callers take long to compile
APART = {**OPTIONS, "_nrt": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
#: for those that every step needs
INNER = {**APART, "forceinline": True}


@njit(**INNER)
def _step(function, t, h, x, S, u, u_end, p, s, stuck, out):
    """Advance x and S by one explicit step, in place; stuck states stay."""
    call(function, STEP, t, h, x, S, u, u_end, p, s, stuck, out)


@njit(**INNER)
def evaluate(function, task, t, x, S, u, p, s, stuck, out):
    """Fill ``out`` with the rates, or with the outputs and their derivatives."""
    call(function, task, t, 0.0, x, S, u, u, p, s, stuck, out)


@njit(**INNER)
def _side(function, t, x, S, u, p, s, stuck, i, out):
    """Set the friction's sign for state i: moving forward, backward or stuck at zero."""
    stuck[i] = False
    if x[i] > 0.0:
        s[i] = 1.0
    elif x[i] < 0.0:
        s[i] = -1.0
    else:
        s[i] = 1.0
        evaluate(function, RATES, t, x, S, u, p, s, stuck, out)
        forward = out[i]
        s[i] = -1.0
        evaluate(function, RATES, t, x, S, u, p, s, stuck, out)
        backward = out[i]
        if forward > 0.0:
            s[i] = 1.0
        elif backward >= 0.0:
            stuck[i] = True
            jump = backward - forward
            s[i] = (backward + forward) / jump if jump > 0.0 else 0.0


@njit(**INNER)
def _first_crossing(x_old, x, stuck, dry):
    """Find the state that changes its sign first, and the share of the step until then."""
    first, share = -1, 1.0
    for i in range(x.size):
        if dry[i] and not stuck[i] and x_old[i] * x[i] < 0.0:
            at = x_old[i] / (x_old[i] - x[i])
            if at < share:
                first, share = i, at
    return first, share


@njit(**INNER)
def copy_values(values, into):
    """Fill an array from the beginning of another."""
    for i in range(into.size):
        into[i] = values[i]


@njit(**INNER)
def keep(x, S, x_old, S_old):
    """Copy a state and its sensitivities."""
    copy_values(x, x_old)
    copy_rows(S, S_old)


@njit(**INNER)
def copy_rows(values, into):
    """Fill a matrix from another."""
    for i in range(into.shape[0]):
        for j in range(into.shape[1]):
            into[i, j] = values[i, j]


@njit(**INNER)
def fill(pieces, value):
    """Fill every Gram matrix of a window's blocks with one value."""
    for i in range(pieces.shape[0]):
        for j in range(pieces.shape[1]):
            for m in range(pieces.shape[2]):
                pieces[i, j, m] = value


@njit(**INNER)
def _add_products(row, products):
    """Add the products of a row's numbers to an upper triangle, those of all lanes at once."""
    for a in range(products.shape[0]):
        for b in range(a // LANES * LANES, row.size, LANES):
            add_multiple(row, a, b, products, a)


@njit(**INNER)
def _empty(products, into):
    """Move the upper triangle into a symmetric matrix, and leave zeros."""
    for a in range(into.shape[0]):
        for b in range(a, into.shape[0]):
            into[a, b] = into[b, a] = products[a, b]
        for b in range(products.shape[1]):
            products[a, b] = 0.0


@njit(**INNER)
def is_any(bits):
    """Return whether one of few bits is set."""
    found = False
    for i in range(bits.size):
        found = found or bits[i]
    return found


@njit(**INNER)
def _jump(S, before, after, stuck, i):
    """Let the sensitivities jump where state i crosses zero."""
    if before[i] == 0.0:
        return
    for j in range(S.shape[1]):
        shift = -S[i, j] / before[i]
        for m in range(S.shape[0]):
            rate = 0.0 if stuck[m] else after[m]
            if m == i or before[m] != rate:
                S[m, j] += (before[m] - rate) * shift


@njit(**APART)
def _cut(function, t, h, x, S, u_start, u_end, p, s, stuck, dry, out, old, i, share):
    """Go through a step again in which state i crosses zero first, at a share of it."""
    x_old, S_old, u_now, u_mid, before = old
    done, left = 0.0, h
    copy_values(u_start, u_now)
    for _ in range(MAX_EVENTS):
        now = t + done * h
        keep(x_old, S_old, x, S)
        for k in range(u_mid.size):
            u_mid[k] = u_now[k] + share * (u_end[k] - u_now[k])
        _step(function, now, share * left, x, S, u_now, u_mid, p, s, stuck, out)
        done += share * (1.0 - done)
        copy_values(u_mid, u_now)
        x[i] = 0.0
        now, left = t + done * h, (1.0 - done) * h
        evaluate(function, RATES, now, x, S, u_now, p, s, stuck, out)
        copy_values(out, before)
        _side(function, now, x, S, u_now, p, s, stuck, i, out)
        evaluate(function, RATES, now, x, S, u_now, p, s, stuck, out)
        _jump(S, before, out, stuck, i)
        if not stuck[i]:
            x[i] = 1e-300 * s[i]
        keep(x, S, x_old, S_old)
        _step(function, now, left, x, S, u_now, u_end, p, s, stuck, out)
        i, share = _first_crossing(x_old, x, stuck, dry)
        if i < 0:
            return


@njit(**INNER)
def advance(function, t, h, x, S, u_start, u_end, p, s, stuck, dry, any_dry, out, old):
    """Advance x and S by h, in place, cutting the step where dry friction changes its side."""
    if not any_dry:
        _step(function, t, h, x, S, u_start, u_end, p, s, stuck, out)
        return
    for i in range(x.size):
        if dry[i]:
            _side(function, t, x, S, u_start, p, s, stuck, i, out)
            for j in range(S.shape[1] if stuck[i] else 0):
                S[i, j] = 0.0
    x_old, S_old = old[:2]
    keep(x, S, x_old, S_old)
    _step(function, t, h, x, S, u_start, u_end, p, s, stuck, out)
    i, share = _first_crossing(x_old, x, stuck, dry)
    if i >= 0:
        _cut(function, t, h, x, S, u_start, u_end, p, s, stuck, dry, out, old, i, share)


def usual_interval(t: np.ndarray) -> float:
    """Return the median sample interval, or infinity where none is much longer than others.

    numba would take seconds to compile a median.
    """
    widths = t[1:] - t[:-1]
    is_uneven = widths.size and widths.max() > LONG * widths.min()
    return float(np.median(widths)) if is_uneven else math.inf


def counts_between(t: np.ndarray, usual: float) -> np.ndarray:
    """Return for how many usual intervals every interval counts, as the time loop has it.

    Examples
    --------
    >>> counts_between(np.array([0.0, 1.0, 2.4, 5.0]), 1.0).tolist()
    [1.0, 1.0, 3.0]
    """
    shares = np.minimum(np.diff(t) / usual, MOST_SAMPLES)
    return np.where(shares > LONG, np.ceil(shares - 0.5), 1.0)


@njit(**OPTIONS)
def workspace(nx, nq, nu, size):
    """Allocate what a step needs, once per trajectory: ``out``, and what was before an event."""
    old = (np.zeros(nx), np.zeros((nx, nq)), np.zeros(nu), np.zeros(nu), np.zeros(nx))
    return np.zeros(size), old


@njit(**INNER)
def observe(function, t, x, S, u, p, s, stuck, out, y, Sy):
    """Evaluate the outputs and their sensitivities at one sample."""
    evaluate(function, OBSERVE, t, x, S, u, p, s, stuck, out)
    (nx, nq), ny = S.shape, y.size
    for i in range(ny):
        y[i] = out[nx + i]
        row = nx + ny + (nx + i) * nq
        for j in range(nq):
            Sy[i, j] = out[row + j]


@njit(**INNER)
def to_next_sample(
    function, t, u, linear_hold, k, x, S, p, s, stuck, dry, substeps, out, old,
    u_start, u_end, any_dry, usual,
):  # fmt: skip
    """Advance from sample k to sample k + 1 in equal steps, no longer than usual ones."""
    width, count = t[k + 1] - t[k], substeps
    if width > LONG * usual:
        count *= math.ceil(min(width / usual, MOST_SAMPLES) - 0.5)
    h = width / count
    if not (linear_hold or any_dry):
        for step in range(count):
            _step(function, t[k] + step * h, h, x, S, u[k], u[k], p, s, stuck, out)
        return
    copy_values(u[k], u_start)
    copy_values(u[k], u_end)
    for step in range(count):
        for i in range(u_start.size if linear_hold else 0):
            slope = u[k + 1, i] - u[k, i]
            u_start[i] = u[k, i] + slope * step / count
            u_end[i] = u[k, i] + slope * (step + 1) / count
        now = t[k] + step * h
        advance(function, now, h, x, S, u_start, u_end, p, s, stuck, dry, any_dry, out, old)


@njit(
    int64(FUNCTION, _F1, _F2, boolean, _F1, _F1, _F2, _B1, int64, int64, _F, _F2, _F2, _F3),
    **OPTIONS,
)
def run_trajectory(function, t, u, linear_hold, p, x, S, dry, substeps, size, usual, X, Y, SY):
    """Simulate one trajectory into X, Y and SY; return the first sample not finite, or -1.

    An interval longer than the ``usual`` one takes more steps.
    """
    nx, nq = S.shape
    out, old = workspace(nx, nq, u.shape[1], size)
    s, stuck = np.zeros(nx), np.zeros(nx, dtype=np.bool_)
    Sy = np.zeros((Y.shape[1], nq))
    u_start, u_end = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    any_dry = is_any(dry)
    for k in range(t.size):
        for i in range(nx):
            if not math.isfinite(x[i]):
                return k
            X[k, i] = x[i]
            if dry[i] and not stuck[i]:
                s[i] = 1.0 if x[i] > 0.0 else (-1.0 if x[i] < 0.0 else 0.0)
        observe(function, t[k], x, S, u[k], p, s, stuck, out, Y[k], Sy)
        if nq > 0:
            copy_rows(Sy, SY[k])
        if k + 1 < t.size:
            to_next_sample(
                function, t, u, linear_hold, k, x, S, p, s, stuck, dry, substeps,
                out, old, u_start, u_end, any_dry, usual,
            )  # fmt: skip
    return -1


@njit(
    types.void(
        FUNCTION, _F1, _F2, boolean, _F2, types.int64[::1], types.int64[::1], _F1, _F1, _F2, _F1,
        _B1, int64, int64, int64, _F4, _F2,
    ),
    **OPTIONS,
)  # fmt: skip
def run_windows(
    function, t, u, linear_hold, y, starts, lengths, usual, p, X0, scale, dry, substeps,
    size, n_p, G, R,
):  # fmt: skip
    """Simulate every window from its own initial state and sum up its squares.

    ``G[w, j]`` becomes the Gram matrix of the rows ``[dy/dp, dy/dx0, y - y_model] / scale`` of
    piece j of window w (infinite where the window diverged), ``R`` the residuals ``y - y_model``.
    ``usual[w]`` is the usual sample interval, see `usual_interval`.
    """
    nx, ny = X0.shape[1], y.shape[1]
    nq = n_p + nx
    out, old = workspace(nx, nq, u.shape[1], size)
    x, S = np.zeros(nx), np.zeros((nx, nq))
    s, stuck = np.zeros(nx), np.zeros(nx, dtype=np.bool_)
    Sy, y_model, row = np.zeros((ny, nq)), np.zeros(ny), np.zeros((nq // LANES + 1) * LANES)
    products = np.zeros((nq + 1, row.size))
    u_start, u_end = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    any_dry = is_any(dry)
    for w in range(starts.size):
        for i in range(nx):
            x[i], stuck[i] = X0[w, i], False
            for j in range(nq):
                S[i, j] = 1.0 if j == n_p + i else 0.0
        piece, finite = 0, True
        for k in range(starts[w], starts[w] + lengths[w]):
            for i in range(nx):
                finite = finite and math.isfinite(x[i])
                if dry[i] and not stuck[i]:
                    s[i] = 1.0 if x[i] > 0.0 else (-1.0 if x[i] < 0.0 else 0.0)
            if not finite:
                break
            before, piece = piece, (k - starts[w]) * G.shape[1] // lengths[w]
            if piece != before:
                _empty(products, G[w, before])
            observe(function, t[k], x, S, u[k], p, s, stuck, out, y_model, Sy)
            for i in range(ny):
                R[k, i] = y[k, i] - y_model[i]
                if math.isnan(y[k, i]):
                    continue
                for j in range(nq):
                    row[j] = Sy[i, j] / scale[i]
                row[nq] = R[k, i] / scale[i]
                _add_products(row, products)
            if k + 1 < starts[w] + lengths[w]:
                to_next_sample(
                    function, t, u, linear_hold, k, x, S, p, s, stuck, dry, substeps,
                    out, old, u_start, u_end, any_dry, usual[w],
                )  # fmt: skip
        _empty(products, G[w, piece])
        if not finite:
            fill(G[w], math.inf)
