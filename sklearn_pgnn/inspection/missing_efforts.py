"""What is missing at the ports of a mechanism, before any simulation."""

import numpy as np
import pandas as pd

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.physics.expressions import to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.record_quality.joint_torques import joint_torques, ports_of_mechanism
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.trajectories import read_records


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
    ports_of_mechanism(model)
    cut = window_records(model, read_records(model, X, y), window_length="trajectory", substeps=1)
    found = joint_torques(model, cut)
    laws = zip(found.ports, found.missing.T, strict=True)
    return pd.DataFrame(
        [_laws(model, port, F, found.x) for port, F in laws],
        index=pd.Index([port.name for port in found.ports], name="port"),
    )


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
