"""Initial states that y contradicts: those that X gives, or those of the model where X has none."""

from collections.abc import Sequence

import numpy as np

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user

#: share of an output's deviation by which its first row may differ from the state it shows
SHARE = 0.1
#: the same in typical second differences of the output, which noise makes large
ROUGH = 5.0
#: how the warning of unknown initial states begins
UNKNOWN = "X: no initial state is given"


def warn_of_contradicted_states(model: PhysicsModel, records: Sequence[Record]) -> None:
    """Warn where outputs that show a state begin elsewhere than X says, in most trajectories."""
    contradictions = []
    for i, state, names in _shown_states(model):
        told = [record for record in records if np.isfinite(record.x0[state])]
        starts = [float(record.x0[state]) for record in told]
        found, counts = _elsewhere(records, i, told, starts)
        if found is not None:
            contradictions.append((found, counts, names))
    if contradictions:
        _warn_of_contradiction(*contradictions[0], [names for *_, names in contradictions[1:]])


def warn_of_unknown_starts(model: PhysicsModel, records: Sequence[Record]) -> None:
    """Warn where X gives no initial state and most trajectories begin elsewhere than the model."""
    for i, state, names in _shown_states(model):
        if names[1] in model.settled:
            continue  # starts at the first value of its input
        untold = [record for record in records if not np.isfinite(record.x0[state])]
        starts = [float(model.initial_state[names[1]])] * len(untold)
        found, counts = _elsewhere(records, i, untold, starts)
        if _warn_of_unknown_start(found, counts, names):
            return  # the remedy is the same for the other outputs


def warn_of_missing_starts(
    model: PhysicsModel, is_told: np.ndarray, records: Sequence[Record]
) -> None:
    """Warn where a table to be predicted lacks initial states that every trajectory of a fit had.

    Nothing was learnt of where such a state usually starts; the model's own value is taken.

    `is_told`, of shape (n_states,), is whether all trajectories of the fit had the initial value of
    a state.
    """
    expected = [i for i in np.flatnonzero(is_told) if list(model.states)[i] not in model.settled]
    lacking = [record for record in records if np.isnan(record.x0[expected]).any()]
    if not lacking:
        return
    first = lacking[0]
    names = [list(model.states)[i] for i in expected if np.isnan(first.x0[i])]
    said = ", ".join(f"{name!r} = {float(model.initial_state[name]):.4g}" for name in names)
    warn_user(
        f"{UNKNOWN} for {', '.join(map(repr, names))} in trajectory {first.name!r}, row "
        f"{first.rows[0]} ({len(lacking)} of {len(records)} trajectories), though every trajectory "
        f"of fit had it: the prediction starts where the model does, at {said}. Remedy: the states "
        f"in the first row of every trajectory of X; GreyBoxRegressor(initial_window=20)"
        f".predict_from(X, y) estimates them.",
        RecordWarning,
    )


def told_in_all(records: Sequence[Record]) -> np.ndarray:
    """Return for every state whether all trajectories have its initial value."""
    return np.isfinite(np.array([record.x0 for record in records])).all(axis=0)


def _shown_states(model: PhysicsModel) -> list[tuple[int, int, tuple[str, str]]]:
    """Return every output that is a state: both indices and names."""
    states = list(model.states)
    shown = ((i, name, str(what)) for i, (name, what) in enumerate(model.outputs.items()))
    return [(i, states.index(what), (name, what)) for i, name, what in shown if what in states]


def _elsewhere(
    records: Sequence[Record], i: int, asked: Sequence[Record], starts: Sequence[float]
) -> tuple[tuple[Record, float, float] | None, tuple[int, int]]:
    """Return the first record whose output begins elsewhere, if most do, and counts."""
    pairs = zip(asked, (np.asarray(r.y)[:, i] for r in asked), starts, strict=True)
    begun = [((r, float(y[0]), start), y) for r, y, start in pairs if np.isfinite(y[0])]
    if not begun:
        return None, (0, 0)
    spread = float(np.nanstd(np.concatenate([np.asarray(record.y)[:, i] for record in records])))
    others = [each for each, y in begun if abs(each[1] - each[2]) > _limit(y, spread)]
    return others[0] if 2 * len(others) > len(begun) else None, (len(others), len(begun))


def _warn_of_contradiction(
    found: tuple[Record, float, float],
    counts: tuple[int, int],
    names: tuple[str, str],
    others: Sequence[tuple[str, str]],
) -> None:
    """Warn of an output that contradicts X, and name the others, whose remedy is the same."""
    first, begins, told = found
    more = [f"output {output!r} (state {state!r})" for output, state in others]
    likewise = f" So does {', '.join(more)}." if more else ""
    warn_user(
        f"y: output {names[0]!r} is the state {names[1]!r}, but in {counts[0]} of {counts[1]} "
        f"trajectories it begins elsewhere than X says: in trajectory {first.name!r}, row "
        f"{first.rows[0]}, y is {begins:.4g}, and X gives {told:.4g}.{likewise} Remedy: "
        f"let y have the model's units (a TransformedTargetRegressor scales y, but not the states "
        f"in X); or leave the state out of X, or NaN, where it is not known.",
        RecordWarning,
    )


def _warn_of_unknown_start(
    found: tuple[Record, float, float] | None, counts: tuple[int, int], names: tuple[str, str]
) -> bool:
    """Warn of an output that begins elsewhere than the model; return whether there was one."""
    if found is None:
        return False
    first, begins, said = found
    warn_user(
        f"{UNKNOWN} for {names[1]!r}, so that predictions start where the model does, but in "
        f"{counts[0]} of {counts[1]} trajectories output {names[0]!r} begins elsewhere: in "
        f"trajectory {first.name!r}, row {first.rows[0]}, y is {begins:.4g}, and the model starts "
        f"at {said:.4g}. Remedy: columns of the states in X, of which the first row of a "
        f"trajectory is read; GreyBoxRegressor(initial_window=20).predict_from(X, y) estimates "
        f"them.",
        RecordWarning,
    )
    return True


def _limit(y: np.ndarray, spread: float) -> float:
    """Return the difference at the beginning that is not gross."""
    bends = np.abs(np.diff(y, 2))
    rough = float(np.median(bends[np.isfinite(bends)])) if np.isfinite(bends).any() else 0.0
    return max(SHARE * float(spread), ROUGH * rough)
