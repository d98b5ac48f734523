"""Records as a network trains on them: states estimated, the model simulated, windows cut."""

from dataclasses import dataclass, replace
from threading import Lock

import numpy as np
from joblib import hash as hash_of
from skorch.dataset import Dataset
from skorch.utils import multi_indexing

from sklearn_pgnn.estimators.network.physics_loss import Motion
from sklearn_pgnn.estimators.simulated_predictions import one_simulation_warning
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import simulate_record, what_is_wrong
from sklearn_pgnn.simulation.network_run import (
    NetworkRecord,
    NetworkStep,
    network_record,
    prior_steps,
    samples_of,
    term_values,
)
from sklearn_pgnn.simulation.record_windows import (
    MIN_SAMPLES,
    WINDOW_SHARE,
    dominant_period,
    window_records,
)
from sklearn_pgnn.simulation.simulate import start_of
from sklearn_pgnn.trajectories.measured import where_measured
from sklearn_pgnn.user_line import warn_user

#: number of state estimates that are cached
KEPT = 8
_ESTIMATES: dict[tuple, np.ndarray] = {}
#: guards the cache against calls from several threads
_KEEPING = Lock()


@dataclass(frozen=True)
class TrainingRecord:
    """One trajectory with estimated states and with what was measured, from `scored_from` on.

    `told` is whether measurements determine the states of a sample; by default they do.
    """

    record: NetworkRecord
    x: np.ndarray
    y: np.ndarray
    scored_from: int = 0
    told: np.ndarray | None = None

    @property
    def is_told(self) -> np.ndarray:
        """Whether measurements determine the states, sample by sample."""
        return np.ones(len(self.x), dtype=bool) if self.told is None else self.told

    def first(self, n_samples: int) -> "TrainingRecord":
        """Return the trajectory's first samples."""
        return TrainingRecord(
            self.record.piece(0, n_samples),
            self.x[:n_samples],
            self.y[:n_samples],
            told=self.is_told[:n_samples],
        )


@one_simulation_warning()
def prepare(model: PhysicsModel, records, features, simulated, *, hold: str, substeps: int):
    """Prepare records for the network's loop; by default the model is simulated in open loop."""
    if simulated is None:
        simulated = [open_loop(model, record, hold, substeps) for record in records]
    return [
        network_record(
            model, record.t, record.u, start_of(model, record),
            hold=hold, simulated=guide, features=further,
        )
        for record, further, guide in zip(records, features, simulated, strict=True)
    ]  # fmt: skip


def open_loop(model: PhysicsModel, record, hold: str, substeps: int) -> np.ndarray:
    """Simulate a record in open loop; if the model diverges its first state is repeated."""
    run = simulate_record(model, record, substeps=substeps, hold=hold)
    what = what_is_wrong(run, run.x, list(model.states))
    if not what:
        return run.x
    warn_user(
        f"trajectory {record.name!r}: {what} The network is guided by its first state.",
        SimulationWarning,
    )
    return np.repeat(run.x[:1], len(run.x), axis=0)


def estimate_states(model: PhysicsModel, records, *, hold: str, substeps: int) -> list[np.ndarray]:
    """Estimate the states of every record from its outputs, cached for a search."""
    key = (model, hash_of([(r.t, r.u, r.y, r.x0) for r in records]), hold, substeps)
    with _KEEPING:
        x = _ESTIMATES.get(key)
    if x is None:
        windowed = window_records(model, records, hold=hold, substeps=substeps)
        x = windowed.states.estimate(model).x
        with _KEEPING:
            _ESTIMATES[key] = x
            while len(_ESTIMATES) > KEPT:
                del _ESTIMATES[next(iter(_ESTIMATES))]
    edges = np.cumsum([record.t.size for record in records])[:-1]
    return [part.copy() for part in np.split(x, edges)]


def told_samples(records) -> list[np.ndarray]:
    """Find samples whose states the outputs determine, also across gaps within a window."""
    window = WINDOW_SHARE * dominant_period(records)
    return [_told(record.t, where_measured(record.y), window) for record in records]


def _told(t: np.ndarray, measured: np.ndarray, window: float) -> np.ndarray:
    seen = np.flatnonzero(measured)
    if len(seen) < 2:
        return measured
    bridged = max(window, MIN_SAMPLES * float(np.median(np.diff(t[seen]))))
    place = np.arange(len(t))
    before = seen[np.clip(np.searchsorted(seen, place, side="right") - 1, 0, None)]
    after = seen[np.clip(np.searchsorted(seen, place), None, len(seen) - 1)]
    return measured | ((before < place) & (place < after) & (t[after] - t[before] <= bridged))


def split_for_validation(records: list[TrainingRecord], share: float, random):
    """Return trajectories to train on and, whole or their ends, to choose the weights by."""
    if not share:
        return records, []
    if len(records) >= 3:
        n = min(max(1, round(share * len(records))), len(records) - 1)
        held = set(random.permutation(len(records))[:n].tolist())
        training = [record for i, record in enumerate(records) if i not in held]
        return training, [records[i] for i in sorted(held)]
    cuts = [_cut_of(record, share) for record in records]
    training = [record.first(cut) for record, cut in zip(records, cuts, strict=True)]
    validation = [
        replace(record, scored_from=cut) for record, cut in zip(records, cuts, strict=True)
    ]
    return training, [r for r in validation if np.isfinite(r.y[r.scored_from :]).any()]


def _cut_of(record: TrainingRecord, share: float) -> int:
    """Return the sample after which a given share of the measured ones lies."""
    measured = np.flatnonzero(where_measured(record.y))
    return max(2, int(measured[max(0, round((1 - share) * len(measured)) - 1)]) + 1)


def spread_of(values: np.ndarray) -> np.ndarray:
    """Return the standard deviation of every column, 1 for a constant one."""
    spread = values.std(axis=0)
    return np.where(spread > 0, spread, 1.0)


class TrainingWindows:
    """Windows of the training data, cut inside trajectories only.

    `seen_at` is where along the model's steps the network sees the states, and the terms: 0 at
    their starts, 1 at their ends. `pairs` are first samples of the steps between samples whose
    states measurements determine.
    """

    def __init__(
        self, records: list[TrainingRecord], model, *, hold, substeps, needs_prior, needs_terms,
        terms_from=None, seen_at=0.0,
    ):  # fmt: skip
        parts = [each.record for each in records]
        self.lengths = [len(part.t) for part in parts]
        self.x = np.concatenate([each.x for each in records])
        self.y = np.concatenate([each.y for each in records])
        self.u = np.concatenate([part.u for part in parts])
        self.t = np.concatenate([part.t for part in parts])
        self.simulated = np.concatenate([part.simulated for part in parts])
        self.features = np.concatenate([part.features for part in parts])
        acting = np.concatenate([part.acting for part in parts])
        self.samples = samples_of(self.t, acting)
        told = np.concatenate([each.is_told for each in records])
        k = self.starts(1, 1)
        self.pairs = k[told[k] & told[k + 1]]
        self._told = np.zeros(len(self.t), dtype=bool)
        self._told[self.pairs + 1] = True
        self.prior = np.full_like(self.x, np.nan)
        if needs_prior:
            self.prior[k] = prior_steps(
                model, substeps, hold, self.t[k], self.samples["dt"][k], self.x[k], acting[k],
                self.samples["acting_next"][k],
            )[0]  # fmt: skip
        self.seen = self.x.copy()
        if seen_at:
            self.seen[k] += seen_at * (self.prior[k] - self.x[k])
        self.terms = np.zeros((len(self.t), 0))
        if needs_terms:
            spread = spread_of(self.seen[self.pairs])
            self.terms = term_values(terms_from or model, self.t, self.seen, acting, spread)[0]

    def starts(self, length: int, stride: int) -> np.ndarray:
        """Return the first samples of windows of `length` steps, `stride` samples apart."""
        begin = np.concatenate([[0], np.cumsum(self.lengths)[:-1]])
        return np.concatenate(
            [np.arange(a, a + n - length, stride) for a, n in zip(begin, self.lengths, strict=True)]
        ).astype(int)

    def features_of(self, guide: str | None, rows: np.ndarray) -> np.ndarray:
        """Return what a network with a guide sees at the first samples of some steps."""
        seen, after = [self.seen[rows], self.u[rows]], rows + 1
        if guide == "simulation":
            seen.append(self.simulated[after])
        elif guide == "step":
            seen.append((self.prior[rows] - self.x[rows]) / self.samples["dt"][rows, None])
        elif guide == "terms":
            seen.append(self.terms[rows])
        return np.hstack([*seen, self.features[after]])

    def motion(self) -> Motion:
        """Return the measured motion from each sample to the next."""
        k = self.pairs
        ends = k[:, None] + [0, 1]
        return Motion(self.x[ends], self.u[k][:, None], self.t[ends])

    @property
    def told_x(self) -> np.ndarray:
        """The states at the ends of steps that measurements determine; NaN at other samples."""
        return np.where(self._told[:, None], self.x, np.nan)

    def cut(self, length: int, step: NetworkStep, *, teacher: bool) -> dict[str, np.ndarray]:
        """Cut windows as the module takes them."""
        start = self.starts(length, max(1, length // 2))[:, None]
        now, after = start + np.arange(length), start + 1 + np.arange(length)
        ends = start + np.arange(length + 1)
        found = {
            "x": self.x[ends],
            "u": self.u[now],
            "t": self.t[ends],
            "index": now,
        }
        if step.needs_prior and teacher:
            found["prior"] = self.prior[now]
        if step.guide == "terms" and teacher:
            found["terms"] = self.terms[now]
        if step.guide == "simulation":
            found["simulated"] = self.simulated[after]
        if self.features.shape[1]:
            found["features"] = self.features[after]
        return found

    def at_ends(self, values: np.ndarray, length: int) -> np.ndarray:
        """Cut the same windows from values, the samples after the first."""
        start = self.starts(length, max(1, length // 2))[:, None]
        return values[start + 1 + np.arange(length)]


@dataclass(frozen=True)
class TrainingData:
    """What a network is trained on: trajectories, and the windows cut from them.

    Weights are chosen by `validation`; `unmeasured` ones count in the physical loss only. `spread`
    are the deviations of the outputs, and whole trajectories are compared at every `stride`-th
    sample. Callbacks see `rows` of the table.
    """

    records: list[TrainingRecord]
    validation: list[TrainingRecord]
    unmeasured: list[TrainingRecord]
    windows: TrainingWindows
    spread: np.ndarray
    stride: int
    rows: dict[str, Dataset | None]


def rows_of(X, y, records, held) -> dict[str, Dataset | None]:
    """Return the rows of the training and the held-out trajectories, for callbacks."""
    found: dict[str, Dataset | None] = {}
    for name, out in (("dataset_train", False), ("dataset_valid", True)):
        pieces = [
            record.rows for record, is_out in zip(records, held, strict=True) if is_out == out
        ]
        found[name] = None
        if pieces:
            rows = np.sort(np.concatenate(pieces))
            found[name] = Dataset(multi_indexing(X, rows), multi_indexing(y, rows))
    return found
