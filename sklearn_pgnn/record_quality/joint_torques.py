r"""Torques at the joints of a mechanism, by inverse dynamics of its records: nothing is simulated.

With positions measured, velocities and accelerations are the slopes of smoothing splines, and the
resisting efforts that the equations :math:`\dot w = f(x, u)` lack are

.. math:: F = B^{-1} (f(x, u) - \dot w)

with the ports' coefficients :math:`B`, the inverse mass matrix: torque minus inverse dynamics.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effects.wiring import OtherClock, ReversedTerm, Wiring
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.simulation.record_windows import WindowedRecords, window_records
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.state_estimate import hidden_states
from sklearn_pgnn.trajectories.record import Record

#: share of a record at either end, and least samples, where splines bend too little
ENDS, FEWEST = 0.02, 5
#: what is missing, as a share of what is applied, where sensors and drive of a joint are right
RIGHT = 0.4


@dataclass(frozen=True)
class JointTorques:
    """Efforts at the ports of a mechanism, at samples away from the ends of records.

    `missing` resist the flows, `applied` are those of the inputs, of shape (n_samples, n_ports);
    `driven` tells whether an input (row) acts on a port (column).
    """

    model: PhysicsModel
    ports: tuple[Port, ...]
    x: np.ndarray
    missing: np.ndarray
    applied: np.ndarray
    driven: np.ndarray

    def right(self) -> Iterator[str]:
        """Yield the inputs and outputs of the ports at which little is missing.

        A wrong sign, unit or channel makes what is missing as large as what is applied.
        """
        left, applied = (np.sqrt(np.mean(e**2, axis=0)) for e in (self.missing, self.applied))
        for j in np.flatnonzero(left < RIGHT * applied):
            position = self.ports[j].displacement
            yield from (name for name, g in self.model.outputs.items() if g == position)
            yield from np.array(list(self.model.inputs))[self.driven[:, j]].tolist()


def told_by_torques(
    model: PhysicsModel, records: tuple[Record, ...], levels: np.ndarray
) -> frozenset[str]:
    """Return the channels that inverse dynamics of several joints shows to be wired right."""
    if not has_several_joints(model):
        return frozenset()
    cut = window_records(model, records, levels=levels, window_length="trajectory", substeps=1)
    return frozenset(joint_torques(model, cut).right())


def touches(wiring: Wiring, channels: frozenset[str]) -> bool:
    """Return whether a wiring changes one of some channels, or time, which all of them share."""
    if isinstance(wiring, OtherClock | ReversedTerm):
        return isinstance(wiring, OtherClock) and bool(channels)
    return not channels.isdisjoint(re.findall(r"\w+", wiring.target))


def has_several_joints(model: PhysicsModel) -> bool:
    """Return whether joints of a model can be told from each other by their torques."""
    try:
        return len(ports_of_mechanism(model)) > 1
    except ModelError:
        return False


def joint_torques(model: PhysicsModel, windowed: WindowedRecords) -> JointTorques:
    """Return the torques at the joints of records that are smoothed."""
    ports = ports_of_mechanism(model)
    windows, x = windowed.windows, windowed.states.values(model)
    u, rows = windows.u.copy(), list[int]()
    rates = np.empty((len(x), len(ports)))
    flows = [list(model.states).index(str(port.flow)) for port in ports]
    for a, b in pairwise(windows.bounds):
        rates[a:b] = np.gradient(x[a:b, flows], windows.t[a:b], axis=0)
        if hold_of(model) == "zoh":  # at a sample an acceleration is between two of them
            u[a + 1 : b] = (windows.u[a + 1 : b] + windows.u[a : b - 1]) / 2
        cut = max(FEWEST, int(ENDS * (b - a)))
        rows += range(a + cut, b - cut)
    x, u = x[rows], u[rows]
    f, B = _evaluated(model, ports, x, u)
    still, _ = _evaluated(model, ports, x, np.zeros_like(u))
    missing, applied = _solved(model, B, f - rates[rows]), _solved(model, B, f - still)
    return JointTorques(model, tuple(ports), x, missing, applied, _driven(model, ports, x))


def _driven(model: PhysicsModel, ports: list[Port], x: np.ndarray) -> np.ndarray:
    """Return whether an input acts on a port, tried at a sample."""
    n = len(model.inputs)
    points = np.repeat(x[:1], n + 1, axis=0)
    f, B = _evaluated(model, ports, points, np.eye(n + 1)[:, :n])
    efforts = np.abs(_solved(model, B[:n], f[:n] - f[n]))
    return efforts > 1e-9 * efforts.max(initial=0.0)


def _solved(model: PhysicsModel, B: np.ndarray, rest: np.ndarray) -> np.ndarray:
    r"""Return :math:`B^{-1} r` at every sample."""
    try:
        return np.linalg.solve(B, rest[..., np.newaxis])[..., 0]
    except np.linalg.LinAlgError as error:
        raise ModelError(
            f"expected ports of {model.name!r} that move every velocity, got "
            f"coefficients that have no inverse at a sample. Remedy: check the ports' 'rates'."
        ) from error


def ports_of_mechanism(model: PhysicsModel) -> list[Port]:
    """Return a port for every velocity; their coefficients are a square matrix."""
    pairs = model.slope_pairs
    found = {str(port.flow): port for port in model.ports.values() if str(port.flow) in pairs}
    moved = {state for port in found.values() for state in port.rates}
    hidden = set(hidden_states(model)) & {*found, *(pairs[w] for w in found)}
    if not found or moved != set(found) or hidden or model.delays:
        why = (
            f"no measured position of {', '.join(sorted(hidden))}"
            if hidden
            else f"delays of {', '.join(model.delays)}"
            if model.delays
            else f"no port for {', '.join(sorted(moved ^ set(found)))}"
        )
        why = why if found else "no port whose flow is the slope of a state"
        raise ModelError(
            f"expected a mechanism with a port for every velocity and every position measured, got "
            f"{why}. Remedy: declare 'ports', and outputs that show the positions."
        )
    return list(found.values())


def _evaluated(
    model: PhysicsModel, ports: list[Port], x: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return rates and coefficients at samples: outputs of a model that stands still, compiled."""
    velocities = [str(port.flow) for port in ports]
    wanted = [model.equations[w] for w in velocities]
    wanted += [port.rates.get(w, sympy.Integer(0)) for w in velocities for port in ports]
    still = "still"
    while still in (*model.states, *model.inputs, *model.parameters):
        still += "_"
    held = PhysicsModel(
        {still: ""},
        {still: sympy.Integer(0)},
        model.parameters,
        {**model.states, **model.inputs},
        {f"{still}{i}": expression for i, expression in enumerate(wanted)},
    )
    values = held.simulate(np.arange(len(x), dtype=float), np.hstack([x, u]), hold="zoh").y
    n = len(ports)
    return values[:, :n], values[:, n:].reshape(-1, n, n)
