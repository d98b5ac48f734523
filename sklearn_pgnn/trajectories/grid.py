"""The step of which all values of a quantity are multiples."""

from collections.abc import Sequence

import numpy as np

#: how far differences may be off the multiples of a step that they are written in, in steps
OFF_GRID = 0.02
#: steps up to which a gap between values tells the step; share of gaps that must be multiples of
#: it, and least number of gaps
FEW, MULTIPLES, GAPS = 10, 0.95, 8
#: a ramp has equal gaps, a counter at rest equal values: so many samples a value, or gaps of
#: several steps among all, tell a counter
REPEATED, SEVERAL = 0.6, 0.2


def grid_step(values: np.ndarray) -> float:
    """Return the step of which all differences of values are multiples.

    Only the larger half of the values counts: numbers written with so many digits are coarsest
    there.
    """
    known = values[np.isfinite(values)]
    large = known[np.abs(known) >= np.median(np.abs(known))] if known.size else known
    distinct = _distinct(large)
    return _common_measure(np.diff(distinct)) if distinct.size > 2 else 0.0


def counted_step(values: np.ndarray) -> float:
    r"""Return the step of a counter whose values were written in decimals; 0 where it is none.

    Values return, and the gaps :math:`d` between those next to each other are multiples of a step
    :math:`q` but for the decimals :math:`g`, :math:`|d - q\,\mathrm{round}(d/q)| \le g`.

    >>> turn = np.round(2 * np.pi / 400 * np.rint(60 * np.sin(np.arange(900) / 40)), 5)
    >>> round(counted_step(turn), 5)
    0.01571
    >>> counted_step(np.round(np.sin(np.arange(900) / 40), 5))
    0.0
    """
    known = values[np.isfinite(values)]
    held = known[1:][np.diff(known) == 0]  # between two clocks a counter is interpolated
    return _step_of(known) or _step_of(held)


def _step_of(known: np.ndarray) -> float:
    distinct = _distinct(known)
    if distinct.size <= GAPS:
        return 0.0
    gaps, decimals = np.diff(distinct), _decimals(distinct)
    step = float(np.median(gaps[gaps < 1.5 * gaps.min() + decimals]))
    for most in (2, FEW // 2, FEW):  # of many steps the error of one is too large
        few = gaps < (most + 0.5) * step
        counts = np.maximum(np.rint(gaps[few] / step), 1)
        step = float(gaps[few].sum() / counts.sum())
    counted = distinct.size < REPEATED * known.size or np.mean(counts > 1) > SEVERAL
    off = np.abs(gaps[few] - counts * step) > decimals + OFF_GRID * step
    if not counted or step < FEW * decimals or np.mean(off) > 1 - MULTIPLES:
        return 0.0
    return step


def _decimals(values: np.ndarray) -> float:
    """Return the last decimal that values were written with; 0 where they have no last one."""
    least = 1e-12 * np.abs(values).max()
    units = 10.0 ** -np.arange(-9, 10)
    exact = (u for u in units if np.abs(values - np.rint(values / u) * u).max() <= least)
    return float(next(exact, 0.0))


def step_of(pieces: Sequence[np.ndarray]) -> float:
    """Return the step of a quantity over records; 0 where it has none."""
    whole = grid_step(np.concatenate(pieces))
    return max(whole, *map(counted_step, pieces))


def steps_at(values: np.ndarray) -> np.ndarray:
    """Return for every value the distance to the nearest other: no step is longer.

    >>> steps_at(np.array([0.0, 0.0, 2.0, 3.0])).tolist()
    [2.0, 2.0, 1.0, 1.0]
    """
    steps, known = np.full(values.shape, np.nan), np.isfinite(values)
    distinct = _distinct(values[known])
    gaps = np.diff(distinct, prepend=-np.inf, append=np.inf)
    nearest = np.minimum(gaps[:-1], gaps[1:])
    steps[known] = nearest[np.searchsorted(distinct, values[known], side="right") - 1]
    return steps


def _distinct(known: np.ndarray) -> np.ndarray:
    """Return the distinct values; what differs by rounding of the computer only is the same."""
    distinct = np.unique(known)
    return distinct[np.diff(distinct, prepend=-np.inf) > 1e-9 * np.abs(distinct).max(initial=0)]


def _common_measure(gaps: np.ndarray) -> float:
    """Return the largest step that goes into all gaps, by Euclid's algorithm; else 0."""
    least, step = 1e-8 * gaps.sum(), gaps.min()
    while step > least:
        rest = np.abs(gaps - step * np.rint(gaps / step))
        if rest.max() < OFF_GRID * step:
            return float(gaps.sum() / np.rint(gaps / step).sum())
        rest = rest[rest >= OFF_GRID * step]
        # many gaps leave the same rest; that of a long gap alone is as rough as the gap is long
        step = float(np.median(rest[rest < (1 + OFF_GRID) * rest.min()]))
    return 0.0
