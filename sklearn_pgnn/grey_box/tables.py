"""Records as one plain table: trajectory after trajectory, states in their first rows only."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class PlainTable:
    """X with ``trajectory``, ``t`` and inputs, y, and told states, (n_trajectories, n_states)."""

    X: pd.DataFrame
    y: np.ndarray
    told: np.ndarray

    def __sizeof__(self) -> int:
        """Return the size in bytes with its arrays, so that joblib sends it to a cluster once."""
        table = int(self.X.memory_usage().sum())
        return object.__sizeof__(self) + table + self.y.nbytes + self.told.nbytes

    @property
    def lengths(self) -> list[int]:
        """Samples of every trajectory."""
        return self.X.groupby("trajectory", sort=False).size().tolist()

    @property
    def place(self) -> np.ndarray:
        """Index of every sample in its trajectory."""
        return self.X.groupby("trajectory", sort=False).cumcount().to_numpy()

    def starting(self, model: PhysicsModel, starts: np.ndarray, rows=None) -> pd.DataFrame:
        """Return X, or the beginnings of some trajectories, with the states in every first row."""
        X = self.X.assign(**dict.fromkeys(model.states, np.nan))
        X.loc[self.place == 0, list(model.states)] = starts
        return X if rows is None else X[rows].reset_index(drop=True)


def plain_table(model: PhysicsModel, records) -> PlainTable:
    """Concatenate records, also those without outputs."""
    frames = [
        pd.DataFrame(record.u, columns=list(model.inputs)).assign(trajectory=i, t=record.t)
        for i, record in enumerate(records)
    ]
    unknown = [np.full((record.t.size, len(model.outputs)), np.nan) for record in records]
    y = [blank if r.y is None else r.y for r, blank in zip(records, unknown, strict=True)]
    told = np.array([record.x0 for record in records])
    return PlainTable(pd.concat(frames, ignore_index=True), np.concatenate(y), told)


def starts_for(model: PhysicsModel, table: PlainTable) -> np.ndarray:
    """Return the initial states of a model, or of an extension of it, as given; else NaN."""
    starts = np.full((len(table.told), len(model.states)), np.nan)
    starts[:, : table.told.shape[1]] = table.told  # an extension's own states come last
    return starts


def usual_starts(model: PhysicsModel, table: PlainTable) -> np.ndarray:
    """Return initial states as given, else as the model says; NaN for those that it settles."""
    return usual(model, starts_for(model, table))


def usual(model: PhysicsModel, starts: np.ndarray) -> np.ndarray:
    """Return initial states, NaN ones as the model says; those that it settles stay NaN."""
    said = [np.nan if k in model.settled else v for k, v in model.initial_state.items()]
    return np.where(np.isfinite(starts), starts, said)
