r"""What is missing at the ports of a mechanism, before any simulation.

With positions measured, velocities and accelerations are the slopes of smoothing splines, and the
resisting efforts that the equations :math:`\dot w = f(x, u)` lack are

.. math:: F = B^{-1} (f(x, u) - \dot w)

with the ports' coefficients :math:`B`, the inverse mass matrix: torque minus inverse dynamics.
"""

from itertools import pairwise

import numpy as np
import pandas as pd
import sympy

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.state_estimate import hidden_states
from sklearn_pgnn.trajectories import read_records

#: share of a record at either end, and least samples, where splines bend too little
ENDS, FEWEST = 0.02, 5


def missing_efforts(model: PhysicsModel, X: ArrayLike, y: ArrayLike) -> pd.DataFrame:
    r"""Return what is missing at every port of a mechanism, and what it depends on there.

    .. math:: F = B^{-1} (f(x, u) - \dot w)

    is the effort against the flow that the model lacks, from smoothed positions and their slopes:
    torque minus inverse dynamics. For each of some laws a line is fitted, and the share of
    :math:`\sum F^2` that it explains is told. It takes a second, and is a hint, not a diagnosis:
    parameters stay as they are, and actuators and sensors are trusted.

    Parameters
    ----------
    model : PhysicsModel
        A mechanism: every velocity is the flow of one port, and every position is measured.
    X : DataFrame or array-like of shape (n_samples, n_columns)
        Time [s] and inputs, as for `ModelDiagnosis`.
    y : DataFrame or array-like of shape (n_samples, n_outputs)
        Measured outputs.

    Returns
    -------
    DataFrame
        By port: ``missing``, the root mean square of F [``unit``]; and between 0 and 1 the shares
        of ``sign(flow)``, ``flow``, ``constant``, ``displacement``, ``cos and sin`` of it, and
        ``all`` of them together.

    Raises
    ------
    ModelError
        If the model is no such mechanism.
    RecordError
        If X or y cannot be read as records of the model.

    Examples
    --------
    >>> from sklearn_pgnn import effects, systems
    >>> cart = systems.cart_on_spring()
    >>> t = np.arange(0, 10, 0.02)
    >>> u = 30 * np.sin(2 * t) + 20 * np.sin(5 * t)
    >>> run = (cart + effects.CoulombFriction("v", level=4.0)).simulate(t, u)
    >>> found = missing_efforts(cart, np.column_stack([t, u]), run.y)
    >>> bool(found.loc["v", "sign(flow)"] > 0.9), round(found.loc["v", "missing"])
    (True, 4)
    """
    ports = _ports(model)
    records = read_records(model, X, y)
    windowed = window_records(model, records, window_length="trajectory", substeps=1)
    windows, x = windowed.windows, windowed.states.values(model)
    u, rows = windows.u.copy(), []
    rates = np.empty((len(x), len(ports)))
    flows = [list(model.states).index(str(port.flow)) for port in ports]
    for a, b in pairwise(windows.bounds):
        rates[a:b] = np.gradient(x[a:b, flows], windows.t[a:b], axis=0)
        if hold_of(model) == "zoh":  # at a sample an acceleration is between two of them
            u[a + 1 : b] = (windows.u[a + 1 : b] + windows.u[a : b - 1]) / 2
        cut = max(FEWEST, int(ENDS * (b - a)))
        rows += range(a + cut, b - cut)
    f, B = _evaluated(model, ports, x[rows], u[rows])
    F = _solved(model, B, f - rates[rows])
    return pd.DataFrame(
        [_laws(model, p, F[:, j], x[rows]) for j, p in enumerate(ports)],
        index=pd.Index([port.name for port in ports], name="port"),
    )


def _solved(model: PhysicsModel, B: np.ndarray, rest: np.ndarray) -> np.ndarray:
    r"""Return :math:`B^{-1} r` at every sample."""
    try:
        return np.linalg.solve(B, rest[..., np.newaxis])[..., 0]
    except np.linalg.LinAlgError as error:
        raise ModelError(
            f"missing_efforts: expected ports of {model.name!r} that move every velocity, got "
            f"coefficients that have no inverse at a sample. Remedy: check the ports' 'rates'."
        ) from error


def has_several_joints(model: PhysicsModel) -> bool:
    """Return whether `missing_efforts` can tell joints of a model from each other."""
    try:
        return len(_ports(model)) > 1
    except ModelError:
        return False


def _ports(model: PhysicsModel) -> list[Port]:
    """Return a port for every velocity; their coefficients are a square matrix."""
    pairs = model.slope_pairs
    found = {str(port.flow): port for port in model.ports.values() if str(port.flow) in pairs}
    moved = {state for port in found.values() for state in port.rates}
    hidden = set(hidden_states(model)) & {*found, *(pairs[w] for w in found)}
    if not found or moved != set(found) or hidden or model.delays:
        why = (
            "no port whose flow is the slope of a state"
            if not found
            else f"no measured position of {', '.join(sorted(hidden))}"
            if hidden
            else f"delays of {', '.join(model.delays)}"
            if model.delays
            else f"no port for {', '.join(sorted(moved ^ set(found)))}"
        )
        raise ModelError(
            f"missing_efforts: expected a mechanism with a port for every velocity and every "
            f"position measured, got {why}. Remedy: declare 'ports', and outputs that show the "
            f"positions."
        )
    return list(found.values())


def _evaluated(model: PhysicsModel, ports: list[Port], x, u) -> tuple[np.ndarray, np.ndarray]:
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


def _laws(model: PhysicsModel, port: Port, F: np.ndarray, x: np.ndarray) -> dict:
    """Return the size of an effort, and the shares that laws of flow and displacement explain."""
    names = list(model.states)
    w, q = x[:, names.index(str(port.flow))], x[:, names.index(to_text(port.displacement))]
    one = np.ones_like(w)
    laws = {
        "sign(flow)": [np.sign(w)],
        "flow": [w],
        "constant": [one],
        "displacement": [q - q.mean()],
        "cos and sin": [np.cos(q), np.sin(q)],
    }
    laws["all"] = [column for columns in laws.values() for column in columns]
    shares = {name: _explained(F, np.column_stack(columns)) for name, columns in laws.items()}
    return {"unit": port.unit, "missing": float(np.sqrt(np.mean(F**2))), **shares}


def _explained(F: np.ndarray, columns: np.ndarray) -> float:
    """Return the share of the squares that a linear combination of columns explains."""
    rest = F - columns @ np.linalg.lstsq(columns, F, rcond=None)[0]
    total = float(F @ F)
    return 1.0 - float(rest @ rest) / total if total else 0.0
