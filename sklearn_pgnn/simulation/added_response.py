r"""Linear response of the outputs to what is added to rates and outputs along trajectories.

With the transitions :math:`F_k` of the sample intervals :math:`h_k`, the derivatives :math:`H_k` of
the outputs, and additions :math:`b` to the rates and :math:`g` to the outputs,

.. math:: s_{k+1} = F_k \left(s_k + \tfrac{h_k}{2} b_k\right) + \tfrac{h_k}{2} b_{k+1}, \qquad
          e_k = H_k s_k + g_k.

All additions go through the windows together, so that hundreds cost little more than one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy
from numba import njit, types

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import add_at
from sklearn_pgnn.simulation.kalman import multiply
from sklearn_pgnn.simulation.linear_response import output_slopes, transitions
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.stepping import INNER, OPTIONS
from sklearn_pgnn.simulation.windows import ShootingWindows

_F1, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_I1 = types.int64[::1]

#: numbers of rows, rates before outputs, and by how much each changes at every sample
Gains = list[tuple[int, np.ndarray]]


@dataclass(frozen=True)
class Addition:
    """What one column adds: the index of a rate or, behind the rates, of an output, and values."""

    parts: tuple[tuple[int, np.ndarray], ...]


@njit(**INNER)
def _add(table, scale, places, columns, values, k, first, last):
    """Add the values of a sample to the places of a table that lie between two numbers."""
    for a in range(places.size):
        if first <= places[a] < last:
            table[places[a] - first, columns[a]] += scale * values[a, k]


@njit(types.void(_F3, _F3, _F1, _I1, _I1, _I1, _I1, _F2, _F2, _F3), **OPTIONS)
def _respond(F, H, t, starts, lengths, places, columns, values, begun, E):
    """Fill E with the responses, window by window; ``begun`` is where each column starts."""
    nx, m = begun.shape
    s, moved = np.zeros((nx, m)), np.zeros((nx, m))
    for w in range(starts.size):
        end = starts[w] + lengths[w]
        s[:] = begun
        for k in range(starts[w], end):
            for o in range(H.shape[1]):
                for i in range(nx):
                    if H[k, o, i] != 0.0:
                        for j in range(m):
                            E[k, o, j] += H[k, o, i] * s[i, j]
            _add(E[k], 1.0, places, columns, values, k, nx, nx + H.shape[1])
            if k + 1 == end:
                continue
            half = 0.5 * (t[k + 1] - t[k])
            _add(s, half, places, columns, values, k, 0, nx)
            multiply(F[k], s, moved)
            s[:] = moved
            _add(s, half, places, columns, values, k + 1, 0, nx)


class AddedResponse:
    """The responses of a model's outputs along the trajectories of some windows."""

    def __init__(self, model: PhysicsModel, windows: ShootingWindows, x0: np.ndarray):
        self.model, self.windows = model, windows
        self.F, self.x = transitions(model, windows, x0)
        self.H = output_slopes(model, windows, self.x)

    @property
    def is_finite(self) -> bool:
        """Whether the trajectories and their derivatives are finite."""
        return all(bool(np.isfinite(each).all()) for each in (self.F, self.x, self.H))

    def to(self, additions: list[Addition]) -> np.ndarray:
        """Return responses (n_rows, n_outputs, n_additions) per noise, less the initial states'."""
        parts = [(at, j, v) for j, each in enumerate(additions) for at, v in each.parts]
        places = np.array([at for at, _, _ in parts], dtype=np.int64)
        columns = np.array([j for _, j, _ in parts], dtype=np.int64)
        values = np.array([v for _, _, v in parts]).reshape(len(parts), self.windows.t.size)
        begun = np.zeros((len(self.model.states), len(additions)))
        return self.without_states(self._respond(places, columns, values, begun))

    def without_states(self, table: np.ndarray) -> np.ndarray:
        """Return rows of a table, by samples, per noise, less what initial states explain."""
        rows = self.windows.rows
        known = np.where(self._measured, table[rows] / self.windows.scale[:, None], 0.0)
        found = known.reshape(rows.size * table.shape[1], table.shape[2])
        for (a, b), basis in zip(self._spans, self._bases, strict=True):
            found[a:b] -= basis @ (basis.T @ found[a:b])
        return found.reshape(known.shape)

    def _respond(self, places, columns, values, begun) -> np.ndarray:
        windows = self.windows
        E = np.zeros((*windows.y.shape, begun.shape[1]))
        of_windows = windows.t, windows.starts, windows.lengths
        _respond(self.F, self.H, *of_windows, places, columns, values, begun, E)
        return E

    @cached_property
    def _measured(self) -> np.ndarray:
        return np.isfinite(self.windows.y[self.windows.rows])[..., None]

    @cached_property
    def _spans(self) -> list[tuple[int, int]]:
        """Where the values of every window stand, all outputs of a sample side by side."""
        ends = np.cumsum(self.windows.lengths) * self.windows.y.shape[1]
        return list(zip(np.append(0, ends[:-1]).tolist(), ends.tolist(), strict=True))

    @cached_property
    def _bases(self) -> list[np.ndarray]:
        """An orthonormal basis of what the initial state of every window can change."""
        n, none = len(self.model.states), np.zeros(0, dtype=np.int64)
        nothing = np.zeros((0, self.windows.t.size))
        by_state = self._respond(none, none, nothing, np.eye(n))[self.windows.rows]
        known = np.where(self._measured, by_state / self.windows.scale[:, None], 0.0)
        table = known.reshape(-1, n)
        return [np.linalg.qr(table[a:b])[0] for a, b in self._spans]


def gains_at(response: AddedResponse, place: str) -> Gains:
    """Return by how much a small hidden input at a place changes rates and outputs."""
    model, hidden = response.model, symbol("_hidden")
    rows = {**model.equations, **_shown(model.outputs)}
    changes = add_at(model, place, hidden)
    changed = {**changes.get("equations", {}), **_shown(changes.get("outputs", {}))}
    table = sample_table(model, response.windows, response.x)
    at_none = {name: changed[name].diff(hidden).subs(hidden, 0) for name in changed}
    slopes = [(i, at_none[name]) for i, name in enumerate(rows) if name in changed]
    size = response.windows.t.size
    return [(i, np.nan_to_num(evaluate_samples(s, table, size))) for i, s in slopes if s != 0]


def _shown(outputs: Mapping[str, sympy.Expr]) -> dict[str, sympy.Expr]:
    return {f"{name} shown": expression for name, expression in outputs.items()}
