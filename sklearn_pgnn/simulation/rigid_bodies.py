r"""Rigid-body dynamics of a tree of joints, compiled, with its derivatives.

A twist is a pair of vectors :math:`(\omega, v)`, a wrench one :math:`(\tau, f)`, both in the
world's axes about its origin; an inertia is mass, first moment :math:`mc` and tensor :math:`J`.
With the twist :math:`S_i` of joint :math:`i`, velocity :math:`v_i` and bias acceleration
:math:`a_i` of its link (gravity accelerates the base), the wrench
:math:`f_i = I_i a_i + v_i \times^* I_i v_i`, and a bar for the sum over a link and all behind it,

.. math:: M_{ij} = S_i \cdot \bar I_j S_j, \qquad h_i = S_i \cdot \bar f_i

for :math:`j` at or behind :math:`i` (Featherstone, *Rigid Body Dynamics Algorithms*, 2008, chapter
6). Joint :math:`k` moves all that is behind it as one body. With the link :math:`p` before it,
:math:`\psi_k = v_p \times S_k` and :math:`\alpha_k = a_p \times S_k - \psi_k \times v_p`,

.. math:: \frac{\partial h_i}{\partial q_k} = S_i \cdot
    \begin{cases} \bar I_i \alpha_k + \bar B_i \psi_k & i \text{ at or behind } k \\
    S_k \times^* \bar f_k + \bar I_k \alpha_k + \bar B_k \psi_k & k \text{ behind } i \end{cases}
    \qquad \frac{\partial h_i}{\partial w_k} = S_i \cdot (2 \bar I_m \psi_k + \bar B_m S_k)

with the outer one :math:`m` of both (Singh, Russell and Wensing, IEEE Robotics and Automation
Letters 7, 2022). A particle of a link has the force :math:`2 m\, \psi_\omega \times v`, so that
:math:`B\psi = 2 (\mathrm{tr}(N) \psi_\omega - N \psi_\omega,\; \psi_\omega \times p)` with
:math:`N = \int v\, x^T dm` and the momentum :math:`p`: both sums over links.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numba
import numpy as np
from numba import carray, types

from sklearn_pgnn.priors.rigid_tree import TreeDynamics, TreeSlopes
from sklearn_pgnn.simulation.disk_cache import numba_caches

_NUMBERS = types.CPointer(types.float64)
_jit = numba.njit(cache=numba_caches(), error_model="numpy")


# -- vectors, as tuples: they stay in registers ----------------------------------------------------


@_jit
def _get(array, i):
    return array[i, 0], array[i, 1], array[i, 2]


@_jit
def _put(array, i, a):
    array[i, 0], array[i, 1], array[i, 2] = a


@_jit
def _add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@_jit
def _scale(s, a):
    return s * a[0], s * a[1], s * a[2]


@_jit
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_jit
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_jit
def _turned(r, i, a):
    """Return a vector turned by the rotation of a link."""
    return _dot(_get(r[i], 0), a), _dot(_get(r[i], 1), a), _dot(_get(r[i], 2), a)


# -- pairs of vectors ------------------------------------------------------------------------------


@_jit
def _pair(array, i):
    row = array[i]
    return (row[0], row[1], row[2]), (row[3], row[4], row[5])


@_jit
def _put_pair(array, i, a):
    row = array[i]
    row[0], row[1], row[2] = a[0]
    row[3], row[4], row[5] = a[1]


@_jit
def _sum(a, b):
    return _add(a[0], b[0]), _add(a[1], b[1])


@_jit
def _times(s, a):
    return _scale(s, a[0]), _scale(s, a[1])


@_jit
def _power(a, b):
    return _dot(a[0], b[0]) + _dot(a[1], b[1])


@_jit
def _moving(v, s):
    r"""Return :math:`v \times s` of two twists."""
    return _cross(v[0], s[0]), _add(_cross(v[0], s[1]), _cross(v[1], s[0]))


@_jit
def _pushing(v, f):
    r"""Return :math:`v \times^* f` of a twist and a wrench."""
    return _add(_cross(v[0], f[0]), _cross(v[1], f[1])), _cross(v[0], f[1])


@_jit
def _momentum(inertias, i, v):
    r"""Return :math:`I v`; an inertia's numbers are mass, first moment, and the tensor's rows."""
    row = inertias[i]
    first = row[1], row[2], row[3]
    turning = (
        row[4] * v[0][0] + row[5] * v[0][1] + row[6] * v[0][2],
        row[5] * v[0][0] + row[7] * v[0][1] + row[8] * v[0][2],
        row[6] * v[0][0] + row[8] * v[0][1] + row[9] * v[0][2],
    )
    return _add(turning, _cross(first, v[1])), _add(_scale(row[0], v[1]), _cross(v[0], first))


@_jit
def _coriolis(spins, i, turn):
    r"""Return :math:`B\psi` of :math:`\psi_\omega`; a spin's numbers are N, row by row, and p."""
    row = spins[i]
    trace = row[0] + row[4] + row[8]
    part = (
        trace * turn[0] - row[0] * turn[0] - row[1] * turn[1] - row[2] * turn[2],
        trace * turn[1] - row[3] * turn[0] - row[4] * turn[1] - row[5] * turn[2],
        trace * turn[2] - row[6] * turn[0] - row[7] * turn[1] - row[8] * turn[2],
    )
    return _scale(2.0, part), _scale(2.0, _cross(turn, (row[9], row[10], row[11])))


# -- where the links are ---------------------------------------------------------------------------


@_jit
def _turn(r, i, p, axis, angle):
    r"""Set :math:`R_i = R_p (1 + \sin\varphi\, K + (1 - \cos\varphi) K^2)` of joint and angle."""
    s, c = np.sin(angle), np.cos(angle)
    x, y, z = axis
    u = 1.0 - c
    columns = (
        (c + u * x * x, u * x * y + s * z, u * x * z - s * y),
        (u * x * y - s * z, c + u * y * y, u * y * z + s * x),
        (u * x * z + s * y, u * y * z - s * x, c + u * z * z),
    )
    for k in range(3):
        r[i, 0, k], r[i, 1, k], r[i, 2, k] = _turned(r, p, columns[k])


@_jit
def _add_mass(inertias, i, mass, at):
    """Add a point mass to an inertia."""
    row, square = inertias[i], _dot(at, at)
    row[0] += mass
    for k in range(3):
        row[1 + k] += mass * at[k]
    row[4] += mass * (square - at[0] * at[0])
    row[5] -= mass * at[0] * at[1]
    row[6] -= mass * at[0] * at[2]
    row[7] += mass * (square - at[1] * at[1])
    row[8] -= mass * at[1] * at[2]
    row[9] += mass * (square - at[2] * at[2])


@_jit
def _set_inertia(inertias, i, turn, tensor):
    r"""Set an inertia to :math:`R J R^T`, with nothing of its mass."""
    inertias[i, :4] = 0.0
    place = 4
    for k in range(3):
        part = _get(turn, k)
        along = (
            _dot(part, (tensor[0, 0], tensor[1, 0], tensor[2, 0])),
            _dot(part, (tensor[0, 1], tensor[1, 1], tensor[2, 1])),
            _dot(part, (tensor[0, 2], tensor[1, 2], tensor[2, 2])),
        )
        for j in range(k, 3):
            inertias[i, place] = _dot(along, _get(turn, j))
            place += 1


@_jit
def _unit_inertias(tree, r, at):
    r"""Return what may be added to links, about the origin.

    With the way :math:`p` to the link's point, mass :math:`m`, first moment :math:`h`, the tensor
    gains :math:`2 (p \cdot h) 1 - p h^T - h p^T + m (p^2 1 - p p^T)`.
    """
    links, masses, firsts, tensors = tree[8:]
    units = np.empty((len(links), 10))
    for k in range(len(links)):
        link, place = links[k], 4
        p, h = _get(at, link), _turned(r, link, _get(firsts, k))
        _set_inertia(units, k, r[link], tensors[k])
        _add_mass(units, k, masses[k], p)
        for i in range(3):
            units[k, 1 + i] += h[i]
            units[k, place] += 2.0 * _dot(p, h)
            for j in range(i, 3):
                units[k, place] -= p[i] * h[j] + h[i] * p[j]
                place += 1
    return units


@_jit
def _places(tree, q):
    """Return the joints' twists, the links' inertias, and those that may be added."""
    parent, slides, axis, offset, mass, centre, tensor = tree[:7]
    n = len(parent)
    r, at = np.zeros((n + 1, 3, 3)), np.zeros((n + 1, 3))
    r[n, 0, 0] = r[n, 1, 1] = r[n, 2, 2] = 1.0  # behind the links stands the base
    twists, inertias = np.zeros((n, 6)), np.empty((n, 10))
    for i in range(n):
        p = parent[i]
        along = _turned(r, p, _get(axis, i))
        here = _add(_get(at, p), _turned(r, p, _get(offset, i)))
        if slides[i]:
            here = _add(here, _scale(q[i], along))
            r[i] = r[p]
            _put_pair(twists, i, ((0.0, 0.0, 0.0), along))
        else:
            _turn(r, i, p, _get(axis, i), q[i])
            _put_pair(twists, i, (along, _cross(here, along)))
        _put(at, i, here)
        _set_inertia(inertias, i, r[i], tensor[i])
        _add_mass(inertias, i, mass[i], _add(here, _turned(r, i, _get(centre, i))))
    return twists, inertias, _unit_inertias(tree, r, at)


@_jit
def _motion(tree, twists, w):
    """Return the velocities and the bias accelerations of the links."""
    parent, gravity = tree[0], tree[7]
    n = len(parent)
    v, a = np.zeros((n + 1, 6)), np.zeros((n + 1, 6))
    a[n, 3:] = -gravity
    for i in range(n):
        p, twist = parent[i], _pair(twists, i)
        _put_pair(v, i, _sum(_pair(v, p), _times(w[i], twist)))
        _put_pair(a, i, _sum(_pair(a, p), _times(w[i], _moving(_pair(v, i), twist))))
    return v, a


@_jit
def _wrenches(inertias, v, a):
    n = len(inertias)
    f = np.empty((n, 6))
    for i in range(n):
        speed = _pair(v, i)
        inertial = _momentum(inertias, i, _pair(a, i))
        _put_pair(f, i, _sum(inertial, _pushing(speed, _momentum(inertias, i, speed))))
    return f


@_jit
def _sum_behind(parent, parts):
    """Add to every link's part those of all links behind it."""
    n = len(parent)
    for i in range(n - 1, -1, -1):
        p = parent[i]
        if p < n:
            for k in range(parts.shape[1]):
                parts[p, k] += parts[i, k]


# -- mass matrix and torques -----------------------------------------------------------------------


@_jit
def _mass_matrix(parent, twists, behind):
    n = len(parent)
    m = np.zeros((n, n))
    for j in range(n):
        momentum, i = _momentum(behind, j, _pair(twists, j)), j
        while i < n:
            m[i, j] = m[j, i] = _power(_pair(twists, i), momentum)
            i = parent[i]
    return m


@_jit
def _torques(twists, f):
    h = np.empty(len(twists))
    for i in range(len(h)):
        h[i] = _power(_pair(twists, i), _pair(f, i))
    return h


@_jit
def _given(tree, point):
    """Return positions, velocities, armatures and amounts; what is not given does not matter."""
    n = len(tree[0])
    known = np.where(np.isnan(point), 0.0, point)
    return known[:n], known[n : 2 * n], known[2 * n : 3 * n], known[3 * n :]


@_jit
def _add_inertias(tree, units, amounts, inertias):
    """Add amounts of what may be added to the inertias of links."""
    for k in range(len(amounts)):
        inertias[tree[8][k]] += amounts[k] * units[k]


@_jit
def dynamics(tree, point):
    r"""Return :math:`M` and :math:`h`, the torques of gravity, Coriolis and centrifugal forces."""
    q, w, armature, amounts = _given(tree, point)
    twists, inertias, units = _places(tree, q)
    _add_inertias(tree, units, amounts, inertias)
    f = _wrenches(inertias, *_motion(tree, twists, w))
    _sum_behind(tree[0], f)
    _sum_behind(tree[0], inertias)
    m = _mass_matrix(tree[0], twists, inertias)
    for i in range(len(q)):
        m[i, i] += armature[i]
    return m, _torques(twists, f)


@_jit
def inverse(m):
    """Return the inverse of a positive matrix, by Gauss and Jordan; NaN where it is none."""
    n = len(m)
    a, out = m.copy(), np.eye(n)
    for k in range(n):
        scale = 1.0 / a[k, k] if a[k, k] > 0.0 else np.nan
        for j in range(n):
            a[k, j] *= scale
            out[k, j] *= scale
        for i in range(n):
            share = a[i, k]
            if i != k and share != 0.0:
                for j in range(n):
                    a[i, j] -= share * a[k, j]
                    out[i, j] -= share * out[k, j]
    return out


# -- their derivatives -----------------------------------------------------------------------------


@_jit
def _spins(inertias, v):
    r"""Return :math:`N = v\,(mc)^T + [\omega\times]\int x x^T dm` and the momentum of the links."""
    n = len(inertias)
    out = np.empty((n, 12))
    for i in range(n):
        row, (turn, speed) = inertias[i], _pair(v, i)
        half = 0.5 * (row[4] + row[7] + row[9])
        first = row[1], row[2], row[3]
        seconds = (
            (half - row[4], -row[5], -row[6]),
            (-row[5], half - row[7], -row[8]),
            (-row[6], -row[8], half - row[9]),
        )
        for k in range(3):
            column = _add(_scale(first[k], speed), _cross(turn, seconds[k]))
            out[i, k], out[i, 3 + k], out[i, 6 + k] = column
        momentum = _add(_scale(row[0], speed), _cross(turn, first))
        out[i, 9], out[i, 10], out[i, 11] = momentum
    return out


@_jit
def _is_behind(parent, link, other):
    """Return whether a link is the other one, or behind it."""
    while link > other and link < len(parent):
        link = parent[link]
    return link == other


@_jit
def _mass_slopes(parent, twists, behind, out):
    r"""Set :math:`\partial M_{ij}/\partial q_k` at ``[k, i, j]``."""
    n = len(parent)
    for k in range(n):
        twist, i = _pair(twists, k), parent[k]
        while i < n:
            for j in range(i, n):
                if not _is_behind(parent, j, i):
                    continue
                own = _pair(twists, j)
                if _is_behind(parent, j, k):
                    moved = _pushing(twist, _momentum(behind, j, own))
                elif _is_behind(parent, k, j):
                    change = _momentum(behind, k, _moving(own, twist))
                    moved = _sum(_pushing(twist, _momentum(behind, k, own)), change)
                else:
                    continue
                out[k, i, j] = out[k, j, i] = _power(_pair(twists, i), moved)
            i = parent[i]


@_jit
def _torque_slopes(parent, twists, behind, spins, f, v, a, out):
    r"""Set :math:`\partial h_i/\partial q_k` at ``[k, i]``, and behind them those by velocities."""
    n = len(parent)
    for k in range(n):
        p, twist = parent[k], _pair(twists, k)
        psi = _moving(_pair(v, p), twist)
        alpha = _sum(_moving(_pair(a, p), twist), _moving(_pair(v, p), psi))
        pushed = _pushing(twist, _pair(f, k))
        for i in range(n):
            at = i if _is_behind(parent, i, k) else k
            if at == k and not _is_behind(parent, k, i):
                continue
            own = _pair(twists, i)
            force = _sum(_momentum(behind, at, alpha), _coriolis(spins, at, psi[0]))
            turned = _times(2.0, _momentum(behind, at, psi))
            out[k, i] = _power(own, force) + (_power(own, pushed) if at != i else 0.0)
            out[n + k, i] = _power(own, _sum(turned, _coriolis(spins, at, twist[0])))


@_jit
def _added_slopes(tree, twists, units, v, a, by_mass, by_torque):
    """Set the derivatives by every amount: mass matrix and torques of its unit alone."""
    for k in range(len(units)):
        unit = np.zeros((len(twists), 10))
        unit[tree[8][k]] = units[k]
        f = _wrenches(unit, v, a)
        _sum_behind(tree[0], f)
        _sum_behind(tree[0], unit)
        by_mass[k] = _mass_matrix(tree[0], twists, unit)
        by_torque[k] = _torques(twists, f)


@_jit
def slopes(tree, point):
    r"""Return the derivatives of :math:`M` and :math:`h` by everything in a point, and :math:`M`.

    They stand at ``[a, i, j]`` and ``[a, i]`` for the argument of number ``a``.
    """
    q, w, armature, amounts = _given(tree, point)
    parent, n = tree[0], len(q)
    twists, inertias, units = _places(tree, q)
    _add_inertias(tree, units, amounts, inertias)
    v, a = _motion(tree, twists, w)
    f, spins = _wrenches(inertias, v, a), _spins(inertias, v)
    for parts in (f, spins, inertias):
        _sum_behind(parent, parts)
    by_mass, by_torque = np.zeros((len(point), n, n)), np.zeros((len(point), n))
    _mass_slopes(parent, twists, inertias, by_mass)
    _torque_slopes(parent, twists, inertias, spins, f, v, a, by_torque)
    _added_slopes(tree, twists, units, v, a, by_mass[3 * n :], by_torque[3 * n :])
    m = _mass_matrix(parent, twists, inertias)
    for i in range(n):
        by_mass[2 * n + i, i, i] = 1.0
        m[i, i] += armature[i]
    return by_mass, by_torque, m


@_jit
def _inverse_slope(known, change):
    r"""Return :math:`-M^{-1} M' M^{-1}`."""
    n = len(known)
    part, out = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for k in range(n):
            share = change[i, k]
            if share != 0.0:
                for j in range(n):
                    part[i, j] -= share * known[k, j]
    for i in range(n):
        for k in range(n):
            share = known[i, k]
            for j in range(n):
                out[i, j] += share * part[k, j]
    return out


# -- as functions of one point ---------------------------------------------------------------------


@_jit
def _fill(tree, point, out):
    """Write the upper half of the inverse mass matrix, row by row, and the torques."""
    m, h = dynamics(tree, point)
    known, n, place = inverse(m), len(h), 0
    for i in range(n):
        for j in range(i, n):
            out[place] = known[i, j]
            place += 1
    out[place : place + n] = h


@_jit
def _fill_slopes(tree, point, which, out):
    """Write some of the derivatives: by the argument, of an entry of the matrix or of a torque."""
    by_mass, by_torque, m = slopes(tree, point)
    n, last = by_torque.shape[1], -1
    known = inverse(m)
    slope = known
    for place in range(len(which)):
        argument, i, j = which[place]
        if j == n:
            out[place] = by_torque[argument, i]
            continue
        if argument != last:
            slope, last = _inverse_slope(known, by_mass[argument]), argument
        out[place] = slope[i, j]


@cache
def compiled(function: TreeDynamics | TreeSlopes) -> Any:
    """Return a C function of the addresses of a point and of the results."""
    tree, n, count = function.tree.arrays, function.tree.arguments, function.size
    which = np.array(getattr(function, "which", ()), np.int64)
    if isinstance(function, TreeDynamics):

        @numba.cfunc(types.void(_NUMBERS, _NUMBERS))
        def entry(point, out):
            _fill(tree, carray(point, n), carray(out, count))

        return entry

    @numba.cfunc(types.void(_NUMBERS, _NUMBERS))
    def slope_entry(point, out):
        _fill_slopes(tree, carray(point, n), which, carray(out, count))

    return slope_entry


def at_points(function: TreeDynamics | TreeSlopes) -> Callable[[Sequence[float]], list[float]]:
    """Return a function of the dynamics as one of a point in Python."""
    entry, n, count = compiled(function).ctypes, function.tree.arguments, function.size

    def at(point):
        out = (ctypes.c_double * count)()
        entry((ctypes.c_double * n)(*point), out)
        return list(out)

    return at
