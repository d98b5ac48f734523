r"""Gaps of single columns: what lies in one is interpolated, and tells nothing of the rates.

Between two samples of a column that are :math:`h` apart a state of angular frequency :math:`\omega`
is interpolated with an error of the order of :math:`(\omega h)^2/8` of its size. Over a span, a
thirtieth of the dominant period, that is half a percent; a longer stretch without samples is a gap,
unless the column is sampled that slowly throughout.
"""

from itertools import pairwise

import numpy as np

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.user_line import warn_user

#: a stretch so many times longer than a column's usual interval is a gap
GAP = 1.5
#: share of the time in gaps from which on there is a warning
MUCH = 0.2
REMEDY = "Remedy: records with fewer gaps, a library without these states, or another span"


def steps_in_gap(t: np.ndarray, measured: np.ndarray, longest: float) -> np.ndarray:
    """Return which steps from sample to sample lie in a gap of a column.

    A time of `longest` seconds without a sample is none.

    Examples
    --------
    >>> measured = np.array([1, 1, 0, 0, 0, 1, 0, 1], dtype=bool)
    >>> steps_in_gap(np.arange(8.0), measured, 2.0).astype(int).tolist()
    [0, 1, 1, 1, 1, 0, 0]
    """
    found, seen = np.zeros(t.size - 1, dtype=bool), np.flatnonzero(measured)
    if seen.size == t.size or seen.size < 2:
        return found
    limit = max(longest, GAP * float(np.median(np.diff(t[seen])))) * (1 + 1e-9)
    for a, b in pairwise(np.unique([0, *seen, t.size - 1])):
        found[a:b] = t[b] - t[a] > limit
    return found


def warn_of_gaps(gaps: np.ndarray, durations: np.ndarray, names: list[str]) -> None:
    """Warn where much of the records' time lies in gaps."""
    lost = durations[gaps.any(axis=1)].sum() / durations.sum()
    if lost > MUCH:
        warn_user(f"y: {100 * lost:.0f} % of the time lies in gaps {_of(gaps, names)}, and no rate "
                  f"is taken from there. {REMEDY}.", RecordWarning)  # fmt: skip


def refuse_no_rows(rows: np.ndarray, gaps: np.ndarray, names: list[str]) -> None:
    """Raise `RecordError` where no span is left between the gaps."""
    if not len(rows):
        raise RecordError(
            f"y: expected stretches without gaps, at least as long as the spans over which rates "
            f"are averaged, got none between the gaps {_of(gaps, names)}. {REMEDY}."
        )


def _of(gaps: np.ndarray, names: list[str]) -> str:
    return "of " + ", ".join(np.array(names)[gaps.any(axis=0)].tolist()) if gaps.any() else ""
