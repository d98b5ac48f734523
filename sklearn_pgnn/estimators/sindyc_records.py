r"""From records to the rows of a regression: rates of the states, and terms, averaged over spans.

The rate of a smoothed state is mostly noise from one sample to the next. Over a span of :math:`m`
samples (of length :math:`h`) it is not, and the equations hold for the averages just as well:

.. math::
    \frac{x_{k+m} - x_k}{h} = \Xi\,\frac{1}{h}\int_{t_k}^{t_{k+m}} \Psi(x, u)\, dt, \qquad
    \frac{x_{k+m} - x_k}{m} = (\Xi - S)\,\frac{1}{m}\sum_{j=k}^{k+m-1} \Psi(x_j, u_j)

for :math:`\dot x = \Xi\Psi(x, u)` and for :math:`x_{k+1} = \Xi\Psi(x_k, u_k)`, where :math:`S`
picks the states out of the terms. No row reaches over the end of a trajectory.

Between two measured samples a state is interpolated, and its rate there is that of the
interpolation. A span therefore begins and ends where its state was measured: behind a sensor that
is read at every :math:`n`-th sample only, it is at least :math:`n` samples long. No span reaches
into a gap of a state that is used: what lies in one tells nothing of the rates. Between two samples
of a column that are :math:`h` apart a state of angular frequency :math:`\omega` is interpolated
with an error of the order of :math:`(\omega h)^2/8` of its size. Over a span, a thirtieth of the
dominant period, that is half a percent; a longer stretch without samples is a gap, unless the
column is sampled that slowly throughout.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.simulation.state_estimate import hidden_states
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user

#: span of a rate as a share of the outputs' dominant period
SPAN_SHARE = 1 / 30
#: a sample interval that differs by more than this share counts as a different one
UNEVEN = 0.01
#: least share of a map's spans that must contain no different interval
EVEN_SHARE = 0.5
#: a stretch so many times longer than a column's usual interval is a gap
GAP = 1.5
#: share of the time in gaps from which on there is a warning
MUCH = 0.2
REMEDY = "Remedy: records with fewer gaps, a library without these states, or another span"


@dataclass(frozen=True)
class MeasuredStates:
    """The states of a machine at every sample of its records.

    `u` are inputs as they act, `period` is the dominant one of the outputs [s]. `is_shown`, of
    shape (n_records,), is whether the outputs that show the states were measured in a record;
    `is_measured`, (n_samples, n_states), is whether the output that a state is taken from was
    measured at a sample, and True where no output shows it.
    """

    windows: ShootingWindows
    x: np.ndarray
    u: np.ndarray
    period: float
    is_shown: np.ndarray
    is_measured: np.ndarray

    def alike(self, chosen: list[int]) -> list[list[int]]:
        """Group states that were measured at the same samples."""
        groups: dict[bytes, list[int]] = {}
        for i in chosen:
            groups.setdefault(self.is_measured[:, i].tobytes(), []).append(i)
        return list(groups.values())

    def in_gaps(self, span: float | None) -> np.ndarray:
        """Return whether the step after a sample lies in a gap of a state, for every state."""
        found = np.zeros(self.is_measured.shape, dtype=bool)
        for rows in self.pieces:
            t = self.windows.t[rows]
            longest = self.samples_of(span, t) * float(np.median(np.diff(t)))
            for column, measured in zip(found.T, self.is_measured.T, strict=True):
                column[rows][:-1] = steps_in_gap(t, measured[rows], longest)
        return found

    def samples_of(self, span: float | None, t: np.ndarray) -> int:
        """Return the number of steps of a span in a record."""
        wanted = SPAN_SHARE * self.period if span is None else span
        return int(np.clip(round(wanted / np.median(np.diff(t))), 1, t.size - 1))

    def durations(self) -> np.ndarray:
        """Return the time to the next sample of the same record; 0 where it does not count."""
        found = np.zeros(self.windows.t.size)
        for rows in self.pieces:
            found[rows][:-1] = np.diff(self.windows.t[rows])
        return found

    @property
    def pieces(self) -> list[slice]:
        """The rows of every record whose states are shown; of all where they are in none."""
        spans = [slice(a, b) for a, b in pairwise(self.windows.bounds)]
        if not self.is_shown.any():
            return spans
        return [span for span, shown in zip(spans, self.is_shown, strict=True) if shown]

    @property
    def interval(self) -> float:
        """The median sample interval [s]."""
        t = self.windows.t
        return float(np.median(np.concatenate([np.diff(t[rows]) for rows in self.pieces])))


def measure_states(model: PhysicsModel, records, **options) -> MeasuredStates:
    """Estimate the states of a model from the outputs of records; options of `window_records`."""
    if not hidden_states(model):  # nothing is simulated: steps are irrelevant
        options |= {"substeps": 1}
    windowed = window_records(model, records, **options)
    u = windowed.windows.acting_inputs(model)[:, : len(model.inputs)]
    states = windowed.states
    measured = np.column_stack([states.measured_samples(state) for state in model.states])
    return MeasuredStates(
        windowed.windows, states.values(model), u, windowed.period, states.is_shown, measured
    )


def rate_rows(states: MeasuredStates, library, span: float | None, ends=None, gaps=None):
    """Return terms and rates of a continuous model, averaged over spans, row by row.

    Spans, by default `SPAN_SHARE` of the dominant period, begin and end at samples that `ends`
    allows, and contain none of `gaps`. Terms are averaged by the trapezoidal rule with the inputs
    held as they are.
    """
    terms, rates = [], []
    for rows in states.pieces:
        t, x, u = states.windows.t[rows], states.x[rows], states.u[rows]
        dt, spans = np.diff(t), _spans(states, span, rows, ends)
        h = spans.change(t)
        whole = (h < GAP * spans.counts * np.median(dt)) & _is_clear(spans, gaps, rows)
        before, after = _at_both_ends(library, x, u, t, states.windows.hold)
        half, means = dt / 2, np.empty((before.shape[1], h.size))
        for mean, start, end in zip(means, before.T, after.T, strict=True):
            np.divide(spans.sums((start + end) * half), h, out=mean)
        terms.append(_chosen(means, whole))
        rates.append(_chosen(spans.change(x).T / h, whole))
    return _rows(terms), _rows(rates)


def _at_both_ends(library, x, u, t, hold: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the terms at the beginning and at the end of every sample interval."""
    if hold == "foh":
        values = library(x, u, t)
        return values[:-1], values[1:]
    return library(x[:-1], u[:-1], t[:-1]), library(x[1:], u[:-1], t[1:])


def step_rows(states: MeasuredStates, library, span: float | None, ends=None, gaps=None):
    """Return terms and steps of a map from sample to sample, as `rate_rows` does those of rates.

    `RecordError` if most samples are not at equal intervals.
    """
    terms, steps, wanted, T = [], [], 0, states.interval
    for rows in states.pieces:
        t, x, u = states.windows.t[rows], states.x[rows], states.u[rows]
        spans = _spans(states, span, rows, ends)
        even = spans.sums(_is_other(np.diff(t), T)) == 0
        values = library(x[:-1], u[:-1], t[:-1])
        means = np.array([spans.sums(term) / spans.counts for term in values.T])
        clear = _is_clear(spans, gaps, rows)
        terms.append(_chosen(means, even & clear))
        steps.append(_chosen(spans.change(x).T / spans.counts, even & clear))
        wanted += int(np.count_nonzero(clear))
    if sum(part.shape[1] for part in terms) < EVEN_SHARE * wanted:
        raise RecordError(
            f"X: a discrete model needs samples at equal intervals; too many differ from their "
            f"median of {T:g} s. Remedy: take discrete=False, or resample the records."
        )
    return _rows(terms), _rows(steps)


def on_even_clock(records, T: float) -> tuple[Record, ...]:
    """Return records on multiples of an interval [s], or raise `RecordError` if far from it."""
    for record in records:
        uneven = np.flatnonzero(_is_other(np.diff(record.t), T))
        if uneven.size:
            k = int(uneven[0])
            raise RecordError(
                f"X: a discrete model steps by {T:g} s, the sample interval of its fit; in "
                f"trajectory {record.name!r} the step from row {record.rows[k]} is "
                f"{record.t[k + 1] - record.t[k]:g} s. Remedy: resample the record, or take "
                f"discrete=False."
            )
    return tuple(replace(r, t=r.t[0] + T * np.arange(r.t.size)) for r in records)


@dataclass(frozen=True)
class _Spans:
    """Where spans begin and end in one record, and their numbers of samples."""

    begin: slice | np.ndarray
    end: slice | np.ndarray
    counts: int | np.ndarray

    def change(self, values) -> np.ndarray:
        """Return how values change over the spans."""
        return values[self.end] - values[self.begin]

    def sums(self, values) -> np.ndarray:
        """Sum values over the spans, their last samples left out."""
        so_far = np.zeros(values.size + 1)
        np.cumsum(values, out=so_far[1:])
        return self.change(so_far)


def _spans(states: MeasuredStates, span: float | None, rows: slice, ends) -> _Spans:
    """Return the spans of one record, each the shortest of the wanted length at least."""
    t = states.windows.t[rows]
    m = states.samples_of(span, t)
    if ends is None or ends[rows].all():
        return _Spans(slice(None, -m), slice(m, None), m)
    allowed = np.flatnonzero(ends[rows])
    place = np.searchsorted(allowed, allowed + m)
    reached = place < allowed.size
    begin, end = allowed[reached], allowed[place[reached]]
    return _Spans(begin, end, end - begin)


def _is_clear(spans: _Spans, gaps, rows: slice):
    """Return which spans contain no gap."""
    return True if gaps is None else spans.sums(gaps[rows][:-1]) == 0


def _is_other(intervals, T: float) -> np.ndarray:
    """Return which intervals differ from the map's sample interval."""
    return np.abs(intervals / T - 1) > UNEVEN


def _chosen(columns, chosen) -> np.ndarray:
    """Return the chosen columns; all of them are not copied."""
    return columns if chosen.all() else columns[:, chosen]


def _rows(parts) -> np.ndarray:
    """Lay the columns of parts end to end as rows; those of a single part are not copied."""
    return (parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)).T


def steps_in_gap(t: np.ndarray, measured: np.ndarray, longest: float) -> np.ndarray:
    """Return which steps lie in a gap of a column, longer than `longest` seconds."""
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
