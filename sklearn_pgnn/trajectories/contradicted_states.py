"""Initial states that X gives and y contradicts, as where y alone was scaled."""

import warnings

import numpy as np

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel

#: share of an output's deviation by which its first row may differ from the state it shows
SHARE = 0.1
#: the same in typical second differences of the output, which noise makes large
ROUGH = 5.0


def warn_of_contradicted_states(model: PhysicsModel, records) -> None:
    """Warn where outputs that show a state begin elsewhere than X says, in most trajectories.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    records : sequence of Record
        Trajectories with outputs.

    Examples
    --------
    >>> from sklearn_pgnn.trajectories import read_records
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> X = np.column_stack([np.arange(9.0), np.ones(9), np.zeros(9)])
    >>> warn_of_contradicted_states(lag, read_records(lag, X, 1 - np.exp(-X[:, 0] / 2)))  # agree
    """
    states = list(model.states)
    for i, (output, shown) in enumerate(model.outputs.items()):
        if str(shown) in states:
            _warn_of_output(records, i, states.index(str(shown)), (output, str(shown)))


def _warn_of_output(records, i: int, state: int, names: tuple[str, str]) -> None:
    """Warn where one output contradicts the state that it shows."""
    told = [r for r in records if np.isfinite(r.x0[state]) and np.isfinite(r.y[0, i])]
    spread = np.nanstd(np.concatenate([record.y[:, i] for record in records]))
    others = [r for r in told if abs(r.y[0, i] - r.x0[state]) > _limit(r.y[:, i], spread)]
    if 2 * len(others) <= len(told):
        return
    first = others[0]
    warnings.warn(
        f"y: output {names[0]!r} is the state {names[1]!r}, but in {len(others)} of {len(told)} "
        f"trajectories it begins elsewhere than X says: in trajectory {first.name!r}, row "
        f"{first.rows[0]}, y is {first.y[0, i]:.4g}, and X gives {first.x0[state]:.4g}. Remedy: "
        f"let y have the model's units (a TransformedTargetRegressor scales y, but not the states "
        f"in X); or leave the state out of X, or NaN, where it is not known.",
        RecordWarning,
        stacklevel=4,
    )


def _limit(y: np.ndarray, spread: float) -> float:
    """Return the difference at the beginning that is not gross."""
    bends = np.abs(np.diff(y, 2))
    rough = float(np.median(bends[np.isfinite(bends)])) if np.isfinite(bends).any() else 0.0
    return max(SHARE * float(spread), ROUGH * rough)
