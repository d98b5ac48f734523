"""The compiled loops behind `sklearn_pgnn.simulation.network_run`."""

import math

import numpy as np
from numba import boolean, int64, njit, types, void

from sklearn_pgnn.simulation.compiled import FUNCTION
from sklearn_pgnn.simulation.dissipation_loop import lose, lose_slopes, loss_workspace
from sklearn_pgnn.simulation.lanes import LANES, tanh_lanes, weigh
from sklearn_pgnn.simulation.model_function import OUTPUTS
from sklearn_pgnn.simulation.stepping import INNER, OPTIONS, advance, evaluate, signs_of, workspace

_F = types.float64
_F1, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_I1 = types.int64[::1]

# -- the network -----------------------------------------------------------------------------------


@njit(**INNER)
def _activate(code, v):
    """Return the activation at v; the hyperbolic tangent is `tanh_lanes`."""
    if code == 1:
        return max(v, 0.0)
    if code == 2:
        return v / (1.0 + math.exp(-v))
    if code == 3:
        return 1.0 / (1.0 + math.exp(-v))
    return v


@njit(**INNER)
def _slope(code, v, value):
    """Differentiate the activation at v, where its value is known."""
    if code == 0:
        return 1.0 - value * value
    if code == 1:
        return 1.0 if v > 0.0 else 0.0
    if code == 2:
        s = 1.0 / (1.0 + math.exp(-v))
        return s * (1.0 + v * (1.0 - s))
    if code == 3:
        return value * (1.0 - value)
    return 1.0


@njit(**INNER)
def _in_lanes(size):
    """Return a number of neurons, rounded up to whole lanes."""
    return -(-size // LANES) * LANES


@njit(**OPTIONS)
def _by_input(theta, sizes):
    """Return the weights by the input they stand at, each layer's last of all, in whole lanes."""
    count = 0
    for layer in range(sizes.size - 1):
        count += (sizes[layer] + 1) * _in_lanes(sizes[layer + 1])
    turned = np.zeros(count)
    place = row = 0
    for layer in range(sizes.size - 1):
        n_in, n_out = sizes[layer], sizes[layer + 1]
        for j in range(n_in + 1):
            for i in range(n_out):
                turned[row + i] = theta[place + (i * n_in + j if j < n_in else n_in * n_out + i)]
            row += _in_lanes(n_out)
        place += n_out * (n_in + 1)
    return turned


@njit(**INNER)
def _forward(turned, sizes, activation, before, after):
    """Evaluate a feed-forward network; row l of ``after`` holds layer l, row 0 the features."""
    place = 0
    last = sizes.size - 2
    for layer in range(last + 1):
        n_in, n_out = sizes[layer], sizes[layer + 1]
        wide = _in_lanes(n_out)
        bias = place + n_in * wide
        for lane in range(0, wide, LANES):
            weigh(turned, bias + lane, place + lane, wide, n_in, after, layer, before, lane)
            if layer < last and activation == 0:
                tanh_lanes(before, after, layer + 1, lane)
        if layer == last or activation != 0:
            for i in range(n_out):
                v = before[layer + 1, i]
                after[layer + 1, i] = v if layer == last else _activate(activation, v)
        place = bias + wide


@njit(**INNER)
def _backward(theta, sizes, activation, before, after, output, by_theta, delta, lower):
    """Differentiate one output by the weights and, in ``delta``, by the features."""
    n_layers = sizes.size - 1
    place = theta.size
    for i in range(sizes[n_layers]):
        delta[i] = 1.0 if i == output else 0.0
    for layer in range(n_layers - 1, -1, -1):
        n_in, n_out = sizes[layer], sizes[layer + 1]
        place -= n_out * (n_in + 1)
        bias = place + n_in * n_out
        for j in range(n_in):
            lower[j] = 0.0
        for i in range(n_out):
            by_theta[bias + i] = delta[i]
            for j in range(n_in):
                by_theta[place + i * n_in + j] = delta[i] * after[layer, j]
                lower[j] += theta[place + i * n_in + j] * delta[i]
        for j in range(n_in):
            slope = 1.0
            if layer > 0:
                slope = _slope(activation, before[layer, j], after[layer, j])
            delta[j] = lower[j] * slope


@njit(**INNER)
def _recur(theta, sizes, z, hidden, gates, out):
    """Advance a gated recurrent unit (torch's GRUCell) and read its linear output."""
    n_in, n, n_out = sizes[0], sizes[1], sizes[2]
    by_hidden = 3 * n * n_in
    bias_in = by_hidden + 3 * n * n
    bias_hidden = bias_in + 3 * n
    for g in range(3 * n):
        v = theta[bias_in + g]
        for j in range(n_in):
            v += theta[g * n_in + j] * z[j]
        w = theta[bias_hidden + g]
        for j in range(n):
            w += theta[by_hidden + g * n + j] * hidden[j]
        if g < 2 * n:
            gates[g] = 1.0 / (1.0 + math.exp(-(v + w)))
        else:
            gates[g] = math.tanh(v + gates[g - 2 * n] * w)
    for i in range(n):
        hidden[i] = (1.0 - gates[n + i]) * gates[2 * n + i] + gates[n + i] * hidden[i]
    read = bias_hidden + 3 * n
    for i in range(n_out):
        v = theta[read + n_out * n + i]
        for j in range(n):
            v += theta[read + i * n + j] * hidden[j]
        out[i] = v


# -- the loop --------------------------------------------------------------------------------------


@njit(**INNER)
def _features(k, x, at, prior, dt, u, simulated, features, guide, terms, mean, scale, z):
    """Fill the standardised features of sample k, where the network sees the state ``at``."""
    nx, nu, nf = x.size, u.shape[1], features.shape[1]
    for i in range(nx):
        z[i] = at[i]
    for i in range(nu):
        z[nx + i] = u[k, i]
    place = nx + nu
    if guide == 1:
        for i in range(nx):
            z[place + i] = simulated[k + 1, i]
        place += nx
    elif guide == 2:
        for i in range(nx):
            z[place + i] = (prior[i] - x[i]) / dt
        place += nx
    elif guide == 3:
        n_terms = mean.size - place - nf
        for i in range(n_terms):
            z[place + i] = terms[nx + i]
        place += n_terms
    for i in range(nf):
        z[place + i] = features[k + 1, i]
    for i in range(place + nf):
        z[i] = (z[i] - mean[i]) / scale[i]


@njit(**INNER)
def _out_of_reach(x, reach):
    for i in range(x.size):
        if not (reach[0, i] <= x[i] <= reach[1, i]):
            return True
    return False


@njit(**INNER)
def _prior_step(
    function, t, dt, x, S, u_start, u_end, p, s, stuck, dry, substeps, step_out,
    old, u_from, u_to,
):  # fmt: skip
    """Advance x and S in place by the model, from one sample to the next."""
    h = dt / substeps
    for i in range(stuck.size):
        stuck[i] = False
    for step in range(substeps):
        for i in range(u_start.size):
            slope = u_end[i] - u_start[i]
            u_from[i] = u_start[i] + slope * step / substeps
            u_to[i] = u_start[i] + slope * (step + 1) / substeps
        advance(
            function, t + step * h, h, x, S, u_from, u_to, p, s, stuck, dry, False,
            step_out, old,
        )  # fmt: skip


@njit(**INNER)
def _along_the_step(seen_at, by_z, by_at, step_S, by_free):
    """Turn derivatives by the state along the model's step into those by its start, in place."""
    nx, n_free = by_z.size, by_free.size
    for j in range(nx):
        by_at[j] = by_z[j]
    for i in range(nx):
        for q in range(n_free):
            by_free[q] += seen_at * by_at[i] * step_S[i, q]
    for j in range(nx):
        by_z[j] = (1.0 - seen_at) * by_at[j]
        for i in range(nx):
            by_z[j] += seen_at * by_at[i] * step_S[i, n_free + j]


@njit(**INNER)
def _carry(M, S, S_old, gain, by_theta):
    """Carry the sensitivities on by one step, in place."""
    nx, n_weights = S.shape
    for i in range(nx):
        for w in range(n_weights):
            S_old[i, w] = S[i, w]
    for i in range(nx):
        for w in range(n_weights):
            S[i, w] = M[i, i] * S_old[i, w]
        for j in range(nx):
            factor = M[i, j]
            if j != i and factor != 0.0:
                for w in range(n_weights):
                    S[i, w] += factor * S_old[j, w]
        for o in range(gain.shape[1]):
            factor = gain[i, o]
            if factor != 0.0:
                for w in range(n_weights):
                    S[i, w] += factor * by_theta[o, w]


@njit(**INNER)
def _by_features(
    delta, scale, guide, n_inputs, n_seen, seen, step_S, dt, by_z, by_free,
):  # fmt: skip
    """Turn derivatives by the features into those by the state seen and by the model's numbers."""
    nx, n_free = by_z.size, by_free.size
    first = nx + n_inputs
    for j in range(nx):
        by_z[j] = delta[j] / scale[j]
    for q in range(n_free):
        by_free[q] = 0.0
    if guide == 2:
        for i in range(nx):
            by_step = delta[first + i] / scale[first + i] / dt
            for j in range(nx):
                by_z[j] += by_step * (step_S[i, n_free + j] - (1.0 if i == j else 0.0))
            for q in range(n_free):
                by_free[q] += by_step * step_S[i, q]
    elif guide == 3:
        slopes = nx + n_seen + nx * (nx + n_free)
        for i in range(n_seen):
            for j in range(nx):
                by_z[j] += delta[first + i] / scale[first + i] * seen[slopes + i * nx + j]


@njit(**INNER)
def _gain_of(gain, dt, found):
    """Fill in what the network's outputs count over a step."""
    for i in range(found.shape[0]):
        for o in range(found.shape[1]):
            found[i, o] = gain[0, i, o] + dt * (gain[1, i, o] + dt * gain[2, i, o])


@njit(**INNER)
def _advance_state(base, offset, prior, gain, out, n_out, x):
    """Advance x in place by the model's step, or from what else it is counted, and the network."""
    for i in range(x.size):
        if base == 0:
            x[i] = offset[i]
        elif base == 2:
            x[i] = prior[i]
        for o in range(n_out):
            x[i] += gain[i, o] * out[o]


@njit(**INNER)
def _transition(base, gain, by_z, step_S, M):
    """Fill in how the next state follows the state."""
    nx = M.shape[0]
    n_free = step_S.shape[1] - nx
    for i in range(nx):
        for j in range(nx):
            M[i, j] = 0.0
            if base == 2:
                M[i, j] = step_S[i, n_free + j]
            elif base == 1 and i == j:
                M[i, j] = 1.0
            for o in range(gain.shape[1]):
                M[i, j] += gain[i, o] * by_z[o, j]


@njit(**INNER)
def _follow(base, lossy, by_prior, gain, by_z, by_theta, step_S, M, S, S_old):
    """Carry the sensitivities on by one step, in place."""
    nx = M.shape[0]
    n_free = step_S.shape[1] - nx
    n_weights = S.shape[1] - n_free
    _transition(base, gain, by_z, step_S, M)
    for i in range(lossy.size):
        for q in range(nx):
            for j in range(nx):
                M[lossy[i], q] += by_prior[i, j] * step_S[j, n_free + q]
    _carry(M, S, S_old, gain, by_theta)
    if base == 2:  # what the model's numbers change of its step
        for i in range(nx):
            for q in range(n_free):
                S[i, n_weights + q] += step_S[i, q]
    for i in range(lossy.size):
        for j in range(nx):
            for q in range(n_free):
                S[lossy[i], n_weights + q] += by_prior[i, j] * step_S[j, q]


@njit(
    int64(
        FUNCTION, FUNCTION, FUNCTION, _F1, _F2, boolean, _F2, _F2, _F2, _F1, _F2, int64, int64,
        int64, int64, int64, int64, _F, _F1, _F3, _I1, _F1, _F1, _F1, _F2, _I1, int64, _F1, int64,
        _F1, _F1, _F2, int64, _I1, _F2, _F3,
    ),
    **OPTIONS,
)  # fmt: skip
def run(
    function, terms, energy, t, acting, linear_hold, u, simulated, features, p, dry, substeps,
    size, n_terms, n_parts, base, guide, seen_at, offset, gain, lossy, root, mean, scale, reach,
    sizes, activation, theta, core, x, hidden, S, begin, wanted, X, SX,
):  # fmt: skip
    """Run on from sample ``begin``, x, hidden and S in place; those wanted go into X and SX.

    The last columns of S, which the weights leave over, are for parameters of the model; without a
    column nothing is differentiated. Return the first sample out of reach, or -1.
    """
    nx, n_out, n_weights, differs = x.size, gain.shape[2], theta.size, S.shape[1] > 0
    n_free = S.shape[1] - n_weights if differs else 0
    n_slopes = n_free + nx if differs else 0
    n_seen = mean.size - nx - u.shape[1] - features.shape[1]
    widest, last = _in_lanes(sizes.max()), sizes.size - 1
    before, after = np.zeros((sizes.size, widest)), np.zeros((sizes.size, widest))
    z, delta, lower = np.zeros(widest), np.zeros(widest), np.zeros(widest)
    gates, out = np.zeros(3 * widest), np.zeros(n_out)
    by_theta, by_z = np.zeros((n_out, S.shape[1])), np.zeros((n_out, nx))
    prior, at, by_at = np.zeros(nx), np.zeros(nx), np.zeros(nx)
    step_S = np.zeros((nx, n_slopes))
    step_out, old = workspace(dry, n_slopes, acting.shape[1], size)
    seen, turned = np.zeros(n_terms), _by_input(theta, sizes) if core == 0 else theta
    parts, (matrices, vectors) = np.zeros(n_parts), loss_workspace(lossy.size)
    by_out, by_prior = np.zeros((lossy.size, n_out)), np.zeros((lossy.size, nx))
    s, stuck = signs_of(dry)
    u_from, u_to = np.zeros(acting.shape[1]), np.zeros(acting.shape[1])
    gain_k, M, S_old = np.zeros((nx, n_out)), np.zeros((nx, nx)), np.zeros(S.shape)
    row = 0
    if wanted[0] == begin:
        X[0], SX[0] = x, S
        row = 1
    for k in range(begin, wanted[-1]):
        dt = t[k + 1] - t[k]
        prior[:] = x
        if differs:
            step_S[:, :] = 0.0
            for i in range(nx):
                step_S[i, n_free + i] = 1.0
        if base == 2 or guide == 2:
            u_end = acting[k + 1] if linear_hold else acting[k]
            _prior_step(
                function, t[k], dt, prior, step_S, acting[k], u_end, p, s, stuck, dry, substeps,
                step_out, old, u_from, u_to,
            )  # fmt: skip
        for i in range(nx):
            at[i] = x[i] if seen_at == 0.0 else x[i] + seen_at * (prior[i] - x[i])
        if guide == 3:
            evaluate(terms, OUTPUTS, t[k], at, step_S, acting[k], p, s, stuck, seen)
        _features(k, x, at, prior, dt, u, simulated, features, guide, seen, mean, scale, z)
        if core == 0:
            after[0] = z
            _forward(turned, sizes, activation, before, after)
            for o in range(n_out):
                out[o] = after[last, o]
        else:
            _recur(theta, sizes, z, hidden, gates, out)
        for o in range(n_out if differs else 0):
            _backward(theta, sizes, activation, before, after, o, by_theta[o], delta, lower)
            _by_features(
                delta, scale, guide, u.shape[1], n_seen, seen, step_S, dt, by_z[o],
                by_theta[o, n_weights:],
            )  # fmt: skip
            if seen_at > 0.0:
                _along_the_step(seen_at, by_z[o], by_at, step_S, by_theta[o, n_weights:])
        _gain_of(gain, dt, gain_k)
        _advance_state(base, offset, prior, gain_k, out, n_out if lossy.size == 0 else 0, x)
        if lossy.size:
            evaluate(energy, OUTPUTS, t[k], prior, step_S, acting[k], p, s, stuck, parts)
            lose(out, parts[nx:], root, dt, matrices, vectors)
            for i in range(lossy.size):
                x[lossy[i]] += vectors[3, i]
            if differs:
                slopes = nx + lossy.size * (1 + lossy.size) + nx * (nx + n_free)
                lose_slopes(
                    parts[nx:], parts[slopes:], root, dt, matrices, vectors, by_out, by_prior,
                )  # fmt: skip
                for i in range(lossy.size):
                    gain_k[lossy[i]] = by_out[i]
        if differs:
            _follow(base, lossy, by_prior, gain_k, by_z, by_theta, step_S, M, S, S_old)
        if _out_of_reach(x, reach):
            X[row:] = np.inf
            SX[row:] = 0.0
            x[:] = np.inf
            return k + 1
        if k + 1 == wanted[row]:
            X[row], SX[row] = x, S
            row += 1
    return -1


@njit(
    void(
        FUNCTION, _F1, _F1, _F2, _F2, _F1, _F2, int64, int64, _F2, _F3,
    ),
    **OPTIONS,
)  # fmt: skip
def run_prior_steps(function, t, dt, u, u_next, p, dry, substeps, size, X, J):
    """Advance every row of X by its own step, in place; J gets the slopes by parameters and X."""
    nx, n_free = X.shape[1], J.shape[2] - X.shape[1]
    step_out, old = workspace(dry, n_free + nx, u.shape[1], size)
    s, stuck = signs_of(dry)
    u_from, u_to = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    S = np.zeros((nx, n_free + nx))
    for k in range(t.size):
        S[:, :] = 0.0
        for i in range(nx):
            S[i, n_free + i] = 1.0
        _prior_step(
            function, t[k], dt[k], X[k], S, u[k], u_next[k], p, s, stuck, dry, substeps,
            step_out, old, u_from, u_to,
        )  # fmt: skip
        J[k] = S


@njit(void(FUNCTION, _F1, _F2, _F2, _F1, int64, _F2, _F3), **OPTIONS)
def run_terms(function, t, x, u, p, size, V, J):
    """Evaluate a model's terms at every sample into V, their derivatives by the state into J."""
    nx, n_terms = x.shape[1], V.shape[1]
    s, out = np.zeros(size), np.zeros(size)
    stuck, unused = np.zeros(size, dtype=np.bool_), np.zeros((nx, 0))
    slopes = nx + n_terms + nx * nx
    for k in range(t.size):
        evaluate(function, OUTPUTS, t[k], x[k], unused, u[k], p, s, stuck, out)
        for i in range(n_terms):
            V[k, i] = out[nx + i]
            for j in range(nx):
                J[k, i, j] = out[slopes + i * nx + j]
