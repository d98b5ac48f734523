r"""The time loop: explicit Runge-Kutta steps of a model and of its sensitivities, compiled.

The sensitivities :math:`S = \partial x / \partial(p, x_0)` follow
:math:`\dot S = \frac{\partial f}{\partial x} S + \frac{\partial f}{\partial p}` and are carried
through the same steps.

Dry friction is not smoothed. Between two changes of sign the equations are smooth; where a flow
:math:`\varphi_i = c_i^T x` under dry friction crosses zero the step is cut there, and which of all
flows at rest stick is what `sklearn_pgnn.simulation.complementarity` finds. At such an event the
sensitivities jump, :math:`S^+ = S^- - (f^- - f^+)\, c_i^T S^- / c_i^T f^-`. The step is cut as well
where what holds a stuck flow, its sign :math:`s_i`, reaches its limit: the flow breaks away.
"""

import math

import numpy as np
from numba import boolean, int64, njit, types

from sklearn_pgnn.simulation.compiled import FUNCTION, call
from sklearn_pgnn.simulation.complementarity import (
    APART,
    OPTIONS,
    balance_workspace,
    solve_signs,
    solve_some,
)
from sklearn_pgnn.simulation.lanes import LANES, add_multiple
from sklearn_pgnn.simulation.model_function import OBSERVE, RATES, STEP

#: an interval of more than so many usual ones takes more steps than they do
LONG = 1.5
#: most usual intervals that one counts for: a gap of years must not stall a simulation
MOST_SAMPLES = 1e6
#: events handled exactly within one step; further ones are stepped over
MAX_EVENTS = 12
#: a difference that is so small a share of its parts is zero: of states, and of sensitivities
AT_REST, STILL = 1e-13, 1e-9

_F = types.float64
_F1, _F2 = types.float64[::1], types.float64[:, ::1]
_F3, _F4 = types.float64[:, :, ::1], types.float64[:, :, :, ::1]
#: for those that every step needs
INNER = {**APART, "forceinline": True}


@njit(**INNER)
def _step(function, t, h, x, S, u, u_end, p, s, stuck, out):
    """Advance x and S by one explicit step, in place; stuck flows stay."""
    call(function, STEP, t, h, x, S, u, u_end, p, s, stuck, out)


@njit(**INNER)
def evaluate(function, task, t, x, S, u, p, s, stuck, out):
    """Fill ``out`` with the rates, or with the outputs and their derivatives."""
    call(function, task, t, 0.0, x, S, u, u, p, s, stuck, out)


@njit(**INNER)
def flow_of(row, x):
    """Return a flow, and the size of its parts."""
    flow, size = 0.0, 0.0
    for m in range(row.size):
        if row[m] != 0.0:
            flow += row[m] * x[m]
            size += abs(row[m] * x[m])
    return flow, size


@njit(**INNER)
def _flow(i, x, dry, own):
    """Return a flow: a state, or a difference of states."""
    return x[own[i]] if own[i] >= 0 else flow_of(dry[i], x)[0]


@njit(**INNER)
def _is_at_rest(i, x, is_stuck, dry, own):
    """Return whether a flow is zero: a difference of states that stuck is, up to rounding."""
    if own[i] >= 0:
        return x[own[i]] == 0.0
    flow, size = flow_of(dry[i], x)
    return is_stuck or abs(flow) <= AT_REST * size


@njit(**INNER)
def _set_sides(x, s, stuck, dry, leaving, rest, own):
    """Set the signs of the flows that move, find those at rest, and return whether there are any.

    The flow ``leaving`` moves, to the side that its sign says already.
    """
    any_rest = False
    for i in range(s.size):
        rest[i] = i != leaving and _is_at_rest(i, x, stuck[i], dry, own)
        any_rest = any_rest or rest[i]
        if not rest[i]:
            stuck[i] = False
            if i != leaving:
                s[i] = 1.0 if _flow(i, x, dry, own) > 0.0 else -1.0
    return any_rest


@njit(**INNER)
def _fill_balance(dry, out, A, b):
    """Fill in the flows' rates and how they fall with every sign."""
    k, nx = dry.shape
    first = out.size - nx * k
    for i in range(k):
        b[i] = 0.0
        for m in range(nx):
            b[i] += dry[i, m] * out[m]
        for j in range(k):
            A[i, j] = 0.0
            for m in range(nx):
                A[i, j] -= dry[i, m] * out[first + m * k + j]


@njit(**INNER)
def settle(function, t, x, S, u, p, s, stuck, dry, leaving, out, old):
    """Set every dry friction's sign, and whether it sticks: a balance of all that are at rest."""
    balance = old[5]
    if _set_sides(x, s, stuck, dry, leaving, balance[2], balance[3]):
        _weigh_up(function, t, x, S, u, p, s, stuck, dry, out, balance)


@njit(**APART)
def _weigh_up(function, t, x, S, u, p, s, stuck, dry, out, balance):
    """Set the signs of what is at rest, and whether it sticks."""
    (A, b, table, right), order, rest, _ = balance
    for i in range(s.size):
        s[i] = 0.0 if rest[i] else s[i]
    evaluate(function, RATES, t, x, S, u, p, s, stuck, out)
    _fill_balance(dry, out, A, b)
    solve_signs(A, b, rest, s, stuck, table, right, order)


@njit(**APART)
def _react(function, t, x, S, u, p, s, stuck, dry, out, balance):
    """Fill ``out`` with the rates as the stuck flows hold them, and set those flows' signs."""
    (A, b, table, right), order, _, own = balance
    evaluate(function, RATES, t, x, S, u, p, s, stuck, out)
    if not is_any(stuck):
        return
    _fill_balance(dry, out, A, b)
    k, nx = dry.shape
    solve_some(A, b, stuck, table, order, right)
    for i in range(k):
        if stuck[i]:
            s[i] += right[i]
            for m in range(nx):
                out[m] += out[out.size - (nx - m) * k + i] * right[i]
    _clear_stuck(own, stuck, out)


@njit(**INNER)
def _clear_stuck(own, stuck, rates):
    """Set the rates to zero of the states that are stuck flows: they are up to rounding."""
    for i in range(stuck.size):
        if stuck[i] and own[i] >= 0:
            rates[own[i]] = 0.0


@njit(**APART)
def _hold_slopes(function, t, x, S, u, p, s, stuck, dry, out, balance):
    """Let the sensitivities of flows that begin at rest stick: a small motion ends at once."""
    (A, b, table, right), order, _, own = balance
    nx, k, is_new = x.size, s.size, False
    for i in range(k):
        for j in range(S.shape[1] if stuck[i] else 0):
            slope, size = flow_of(dry[i], S[:, j])
            is_new = is_new or abs(slope) > STILL * size
    if not is_new:
        return
    evaluate(function, RATES, t, x, S, u, p, s, stuck, out)
    _fill_balance(dry, out, A, b)
    for j in range(S.shape[1]):
        for i in range(k):
            b[i] = flow_of(dry[i], S[:, j])[0]
        solve_some(A, b, stuck, table, order, right)
        for i in range(k):
            for m in range(nx if stuck[i] else 0):
                S[m, j] += out[out.size - (nx - m) * k + i] * right[i]
        _clear_stuck(own, stuck, S[:, j])


@njit(**INNER)
def _first_crossing(x_old, x, s, stuck, dry, own):
    """Find the flow that changes its sign first, and the share of the step until then."""
    first, share = -1, 1.0
    for i in range(s.size):
        if stuck[i]:
            continue
        before, after = s[i] * _flow(i, x_old, dry, own), s[i] * _flow(i, x, dry, own)
        if before > 0.0 and after < 0.0 and before < share * (before - after):
            first, share = i, before / (before - after)
    return first, share


@njit(**APART)
def _first_release(function, t, x, S, u, p, s, stuck, dry, out, balance, first, share, s_end):
    """Find the stuck flow that breaks away first, if one does so before any flow crosses zero."""
    copy_values(s, s_end)
    _react(function, t, x, S, u, p, s_end, stuck, dry, out, balance)
    for i in range(s.size):
        if stuck[i] and abs(s_end[i]) > 1.0:
            limit = 1.0 if s_end[i] > 0.0 else -1.0
            at = (limit - s[i]) / (s_end[i] - s[i])
            if at < share:
                first, share = i, at
    return first, share


@njit(**INNER)
def _are_equal(a, b):
    equal = True
    for i in range(a.size):
        equal = equal and a[i] == b[i]
    return equal


@njit(**INNER)
def _first_event(function, t, x, S, u_start, u, p, s, stuck, dry, out, old):
    """Find the flow that crosses zero or breaks away first, and the step's share until then.

    Where nothing moves, what is stuck is weighed up again at the next step only.
    """
    first, share = _first_crossing(old[0], x, s, stuck, dry, old[5][3])
    if is_any(stuck) and not (_are_equal(x, old[0]) and _are_equal(u, u_start)):
        return _first_release(
            function, t, x, S, u, p, s, stuck, dry, out, old[5], first, share, old[6]
        )
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
def _jump(S, before, after, row):
    """Let the sensitivities jump where a flow crosses zero."""
    rate = flow_of(row, before)[0]
    if rate == 0.0:
        return
    for j in range(S.shape[1]):
        shift = -flow_of(row, S[:, j])[0] / rate
        for m in range(S.shape[0]):
            if before[m] != after[m]:
                S[m, j] += (before[m] - after[m]) * shift


@njit(**INNER)
def _to_zero(x, rates, h, i, dry, own):
    """Move x along its rates to where a flow is zero; return its share of a step."""
    flow, rate = _flow(i, x, dry, own), _flow(i, rates, dry, own)
    time = -flow / rate if rate != 0.0 else 0.0
    if not abs(time) < h:
        time = 0.0
    for m in range(x.size):
        x[m] += time * rates[m]
    if own[i] >= 0:
        x[own[i]] = 0.0
    return time / h


@njit(**INNER)
def _let_go(s, stuck, i):
    """Let a stuck flow break away, to the side at whose limit it is."""
    stuck[i] = False
    s[i] = 1.0 if s[i] > 0.0 else -1.0


@njit(**APART)
def _cut(function, t, h, x, S, u_start, u_end, p, s, stuck, dry, out, old, i, share):
    """Go through a step again in which flow i crosses zero or breaks away, at a share of it."""
    x_old, S_old, u_now, u_mid, before, balance, _ = old
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
        now, left = t + done * h, (1.0 - done) * h
        _react(function, now, x, S, u_now, p, s, stuck, dry, out, balance)
        if stuck[i]:
            _let_go(s, stuck, i)
            settle(function, now, x, S, u_now, p, s, stuck, dry, i, out, old)
        else:
            copy_values(out, before)
            done = min(1.0, done + _to_zero(x, before, h, i, dry, balance[3]))
            now, left, stuck[i] = t + done * h, (1.0 - done) * h, True
            settle(function, now, x, S, u_now, p, s, stuck, dry, -1, out, old)
            _react(function, now, x, S, u_now, p, s, stuck, dry, out, balance)
            _jump(S, before, out, dry[i])
        keep(x, S, x_old, S_old)
        _step(function, now, left, x, S, u_now, u_end, p, s, stuck, out)
        i, share = _first_event(function, t + h, x, S, u_now, u_end, p, s, stuck, dry, out, old)
        if i < 0:
            return


@njit(**INNER)
def advance(function, t, h, x, S, u_start, u_end, p, s, stuck, dry, settled, out, old):
    """Advance x and S by h, in place, cutting the step where dry friction changes its side."""
    if not dry.shape[0]:
        _step(function, t, h, x, S, u_start, u_end, p, s, stuck, out)
        return
    if not settled:
        settle(function, t, x, S, u_start, p, s, stuck, dry, -1, out, old)
    if S.shape[1] and is_any(stuck):
        _hold_slopes(function, t, x, S, u_start, p, s, stuck, dry, out, old[5])
    keep(x, S, old[0], old[1])
    _step(function, t, h, x, S, u_start, u_end, p, s, stuck, out)
    i, share = _first_event(function, t + h, x, S, u_start, u_end, p, s, stuck, dry, out, old)
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
    """Return for how many usual intervals every interval counts, as the time loop has it."""
    shares = np.minimum(np.diff(t) / usual, MOST_SAMPLES)
    return np.where(shares > LONG, np.ceil(shares - 0.5), 1.0)


@njit(**OPTIONS)
def workspace(dry, nq, nu, size):
    """Allocate what steps need, once per trajectory: ``out``, and what was before an event."""
    k, nx = dry.shape
    u_old = np.zeros(nu), np.zeros(nu)
    own = np.full(k, -1)
    for i in range(k):
        if np.sum(dry[i] != 0.0) == 1:
            own[i] = np.argmax(np.abs(dry[i]))
    balance = *balance_workspace(k), own
    old = np.zeros(nx), np.zeros((nx, nq)), *u_old, np.zeros(nx), balance, np.zeros(k)
    return np.zeros(size), old


@njit(**OPTIONS)
def signs_of(dry):
    """Allocate the signs of the flows under dry friction, and whether they stick."""
    return np.zeros(dry.shape[0]), np.zeros(dry.shape[0], dtype=np.bool_)


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
    function, t, u, linear_hold, k, x, S, p, s, stuck, dry, settled, substeps, out, old,
    u_start, u_end, usual,
):  # fmt: skip
    """Advance from sample k to sample k + 1 in equal steps, no longer than usual ones."""
    width, count = t[k + 1] - t[k], substeps
    if width > LONG * usual:
        count *= math.ceil(min(width / usual, MOST_SAMPLES) - 0.5)
    h = width / count
    if not (linear_hold or dry.shape[0]):
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
        settled = settled and step == 0
        advance(function, now, h, x, S, u_start, u_end, p, s, stuck, dry, settled, out, old)


@njit(
    int64(FUNCTION, _F1, _F2, boolean, _F1, _F1, _F2, _F2, int64, int64, _F, _F2, _F2, _F3),
    **OPTIONS,
)
def run_trajectory(function, t, u, linear_hold, p, x, S, dry, substeps, size, usual, X, Y, SY):
    """Simulate one trajectory into X, Y and SY; return the first sample not finite, or -1.

    An interval longer than the ``usual`` one takes more steps.
    """
    nx, nq = S.shape
    out, old = workspace(dry, nq, u.shape[1], size)
    s, stuck = signs_of(dry)
    Sy = np.zeros((Y.shape[1], nq))
    u_start, u_end = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    for k in range(t.size):
        for i in range(nx):
            if not math.isfinite(x[i]):
                return k
            X[k, i] = x[i]
        if s.size:
            settle(function, t[k], x, S, u[k], p, s, stuck, dry, -1, out, old)
        observe(function, t[k], x, S, u[k], p, s, stuck, out, Y[k], Sy)
        if nq > 0:
            copy_rows(Sy, SY[k])
        if k + 1 < t.size:
            to_next_sample(
                function, t, u, linear_hold, k, x, S, p, s, stuck, dry, True, substeps,
                out, old, u_start, u_end, usual,
            )  # fmt: skip
    return -1


@njit(
    types.void(
        FUNCTION, _F1, _F2, boolean, _F2, types.int64[::1], types.int64[::1], _F1, _F1, _F2, _F1,
        _F2, int64, int64, int64, _F4, _F2,
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
    out, old = workspace(dry, nq, u.shape[1], size)
    x, S = np.zeros(nx), np.zeros((nx, nq))
    s, stuck = signs_of(dry)
    Sy, y_model, row = np.zeros((ny, nq)), np.zeros(ny), np.zeros((nq // LANES + 1) * LANES)
    products = np.zeros((nq + 1, row.size))
    u_start, u_end = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    for w in range(starts.size):
        stuck[:] = False
        for i in range(nx):
            x[i] = X0[w, i]
            for j in range(nq):
                S[i, j] = 1.0 if j == n_p + i else 0.0
        piece, finite = 0, True
        for k in range(starts[w], starts[w] + lengths[w]):
            for i in range(nx):
                finite = finite and math.isfinite(x[i])
            if not finite:
                break
            if s.size:
                settle(function, t[k], x, S, u[k], p, s, stuck, dry, -1, out, old)
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
                    function, t, u, linear_hold, k, x, S, p, s, stuck, dry, True, substeps,
                    out, old, u_start, u_end, usual[w],
                )  # fmt: skip
        _empty(products, G[w, piece])
        if not finite:
            fill(G[w], math.inf)
