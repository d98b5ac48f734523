"""Records on the clock of a training: one step of a network spans the interval it was trained at.

A step longer than that is divided: samples are put in between, of which nothing was measured and
nothing is reported. What cannot be divided so is told, unless the network's output is a rate that
the step integrates: then a step of any length says about the same.
"""

from dataclasses import dataclass, replace

import numpy as np

from sklearn_pgnn.estimators.network.structure import ON_THE_MODEL
from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.trajectories.clock import check_sample_interval
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user

#: a step this many times as long as that of the training is divided
LONG = 1.5
#: a step that differs by more than this share of the training's counts as another one
TOLERANCE = 0.1
#: most samples that are put in between in one trajectory
MOST = 1_000_000


@dataclass(frozen=True)
class FilledRecord:
    """A trajectory with samples in between, without outputs, where its own are far apart.

    Its own are in `rows` of the table, and `kept` among all; of these `before` is the own one at or
    before each, and `share` how far each is from there to the next own one.
    """

    record: Record
    rows: np.ndarray
    kept: np.ndarray
    before: np.ndarray
    share: np.ndarray

    @property
    def is_whole(self) -> bool:
        """Whether no sample was put in between."""
        return self.kept.size == self.before.size

    def along(self, values: np.ndarray, hold: str) -> np.ndarray:
        """Return values of the own samples at all samples."""
        found = values[self.before]
        if hold == "foh":
            after = np.minimum(self.before + 1, self.kept.size - 1)
            found = found + self.share[:, None] * (values[after] - found)
        return found


def fill(record: Record, interval: float, hold: str) -> FilledRecord:
    """Divide the long steps of a record."""
    counts = _parts(np.diff(record.t), interval)
    if counts.sum() - counts.size > MOST:
        k = int(np.argmax(counts))
        raise RecordError(
            f"X: the network steps by {interval:g} s, the sample interval of its training; "
            f"expected at most {MOST} such steps between the rows of trajectory {record.name!r}, "
            f"got {counts.max():.3g} after row {record.rows[k]}, a gap of "
            f"{record.t[k + 1] - record.t[k]:g} s. Remedy: give what follows the gap a name of its "
            f"own in a column 'trajectory', or resample the records."
        )
    n, counts = record.t.size, counts.astype(int)
    kept = np.concatenate([[0], np.cumsum(counts)])
    before = np.append(np.repeat(np.arange(n - 1), counts), n - 1)
    share = (np.arange(before.size) - kept[before]) / np.append(counts, 1)[before]
    filled = FilledRecord(record, record.rows, kept, before, share)
    if filled.is_whole:
        return filled
    y = record.y
    if y is not None:
        y = np.full((before.size, y.shape[1]), np.nan)
        y[kept] = record.y
    t = filled.along(record.t[:, None], "foh")[:, 0]
    u = filled.along(record.u, hold)
    return replace(filled, record=replace(record, t=t, u=u, y=y, rows=record.rows[before]))


def is_other_interval(wanted: float, interval: float) -> bool:
    """Return whether a sample interval is not that of the training, within the tolerance."""
    return abs(wanted / interval - 1) > TOLERANCE


def _parts(steps, interval: float) -> np.ndarray:
    """Return into how many parts each step is divided."""
    ratios = np.asarray(steps) / interval
    return np.where(ratios >= LONG, np.rint(ratios), 1.0)


def holds_at_one_interval(structure: str, module) -> bool:
    """Return whether a network is a map from sample to sample, not of rates."""
    return structure not in ON_THE_MODEL or hasattr(module, "at_rest")


def warn_of_other_intervals(filled: list[FilledRecord], interval: float, structure: str) -> None:
    """Warn of trajectories whose steps are no multiples of the training's."""
    steps = [np.diff(each.record.t) / interval for each in filled]  # divided or not
    far = [each.size and np.median(np.abs(each - 1)) > TOLERANCE for each in steps]
    others = [each for each, is_far in zip(filled, far, strict=True) if is_far]
    if not others:
        return
    first = others[0]
    usual = float(np.median(np.diff(first.record.t[first.kept])))
    more = f" and {len(others) - 1} more are" if len(others) > 1 else " is"
    warn_user(
        f"X: expected steps of {interval:g} s, the sample interval of the training, or multiples "
        f"of it, for the network (structure={structure!r}) is a map from one such sample to the "
        f"next; trajectory {first.record.name!r} from row {first.rows[0]} on{more} sampled "
        f"otherwise, there every {usual:g} s in the median. The prediction is wrong by as much. "
        f"{_remedy(interval)}",
        RecordWarning,
    )


def _remedy(interval: float) -> str:
    return (
        f"Remedy: resample the records to {interval:g} s, or train with structure='correction' "
        f"and a FeedForward core, which corrects rates and holds at other intervals, too."
    )


def parts_of_a_step(wanted, interval: float, is_map: bool, structure: str) -> int:
    """Return how many steps of a network make a sample interval; warn where no number fits."""
    check_sample_interval(wanted)
    parts = int(_parts(wanted, interval))
    if is_map and is_other_interval(wanted / parts, interval):
        warn_user(
            f"interval: expected {interval:g} s, the sample interval of the training, or a "
            f"multiple of it, for the network (structure={structure!r}) is a map from one such "
            f"sample to the next; got {wanted:g} s. Its outputs are wrong by as much. "
            f"{_remedy(wanted)}",
            RecordWarning,
        )
    return parts
