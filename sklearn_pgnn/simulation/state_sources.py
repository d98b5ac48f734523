r"""From which output a state is taken: in every record from the one that determines it best.

Several outputs may show a state, as their value or as their slope. How well one of them determines
it in a record is told by two halves of its measured samples, whose smoothing splines
:math:`g_1, g_2` differ by what noise and the time between two samples leave open,

.. math:: \sigma^2 = \frac{1}{4} \overline{(g_1 - g_2)^2}

over all samples of the record; a value at a measured sample has the noise of that at most. It holds
for `RESOLVED` samples a period or more. An output that is measured more rarely does not count
beside one that is measured more often: its samples look like noise, and are smoothed away. Where
none is clearly better, the last output that shows the state as its value counts, else the first one
that shows it as its slope.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.shown_states import shown_by
from sklearn_pgnn.simulation.smoothed_output import SmoothedOutput
from sklearn_pgnn.simulation.windows import ShootingWindows

#: the standard error of a clearly better source is at most this share of the other one's
CLEARLY = 1 / 2
#: least samples of the dominant period
RESOLVED = 8.0
#: a mean sample interval that is so many times longer is another one
LONGER = 1.5
#: spread of a smoothed state, in its standard errors
SAFETY = 3.0
#: least spread of a measured state, as a share of its range: the sensor may have an error
MEASURED_SPREAD = 0.3


@dataclass(frozen=True)
class Source:
    """An output that shows a state by its value, or by its slope where `derivative` is 1."""

    smoothed: SmoothedOutput
    derivative: int

    @property
    def values(self) -> np.ndarray:
        """The state, of shape (n_samples,)."""
        return self.smoothed.of(self.derivative)


@dataclass(frozen=True)
class TakenState:
    """A state as taken from the outputs that show it, the best of each record."""

    sources: tuple[Source, ...]
    bounds: np.ndarray

    @property
    def used(self) -> tuple[Source, ...]:
        """The sources, each once."""
        return tuple(dict.fromkeys(self.sources))

    def joined(self, values: Callable[[Source], np.ndarray]) -> np.ndarray:
        """Join what belongs to the source of every record."""
        if len(self.used) == 1:
            return values(self.used[0])
        rows = zip(pairwise(self.bounds), self.sources, strict=True)
        return np.concatenate([values(source)[a:b] for (a, b), source in rows])

    @cached_property
    def values(self) -> np.ndarray:
        """The state, of shape (n_samples,)."""
        return self.joined(lambda source: source.values)

    @property
    def is_measured(self) -> np.ndarray:
        """Whether the source has enough samples in a record, of shape (n_records,)."""
        return np.array([s.smoothed.is_measured[r] for r, s in enumerate(self.sources)])

    @property
    def measured_samples(self) -> np.ndarray:
        """Whether the source was measured at a sample, of shape (n_samples,).

        True also in records in which too few samples were.
        """
        blind = np.repeat(~self.is_measured, np.diff(self.bounds))
        return self.joined(lambda source: source.smoothed.samples) | blind

    @cached_property
    def spread(self) -> float:
        """The uncertainty of the state.

        It may be as large as a sensor's error: a window's own samples determine its start. Of
        records that are too short to show it, nothing is known; infinite where all are.
        """
        found = list(enumerate(self.sources))
        counts = np.array([source.smoothed.counts[r] for r, source in found])
        if not counts.any():
            return np.inf
        variances = [source.smoothed.variances[r, source.derivative] for r, source in found]
        error = SAFETY * np.sqrt(np.average(variances, weights=counts))
        return float(max(error, MEASURED_SPREAD * np.std(self.values)))


def take_states(model: PhysicsModel, windows: ShootingWindows) -> dict[str, TakenState]:
    """Choose from which outputs the states of a model are taken."""
    sources = _sources(model, windows)
    records = range(len(windows.bounds) - 1)
    return {
        state: TakenState(tuple(_best(each, r) for r in records), windows.bounds)
        for state, each in sources.items()
    }


def _sources(model: PhysicsModel, windows: ShootingWindows) -> dict[str, list[Source]]:
    """Return by state the outputs that show it, that first which is preferred."""
    values: dict[str, list[Source]] = {}
    slopes: dict[str, list[Source]] = {}
    for column, name in enumerate(model.outputs):
        state, *velocities = shown_by(model, name) or ("",)
        if not state:
            continue
        smoothed = SmoothedOutput(windows, column, name, state)
        values.setdefault(state, []).insert(0, Source(smoothed, 0))
        for velocity in velocities:
            slopes.setdefault(velocity, []).append(Source(smoothed, 1))
    return {s: [*values.get(s, ()), *slopes.get(s, ())] for s in dict.fromkeys([*values, *slopes])}


def _best(sources: list[Source], record: int) -> Source:
    """Return the source that determines a state best in a record, the first one if in doubt."""
    measured = [source for source in sources if source.smoothed.is_measured[record]]
    best, *others = _resolving(measured, record) or sources[:1]
    for other in others:
        if _variance(other, record) < CLEARLY**2 * _variance(best, record):
            best = other
    return best


def _resolving(sources: list[Source], record: int) -> list[Source]:
    """Return the sources that are sampled fast enough, or as fast as the fastest of them."""
    if len(sources) < 2:
        return sources
    intervals = [source.smoothed.interval(record) for source in sources]
    fastest = sources[int(np.argmin(intervals))].smoothed
    enough = max(fastest.period(record) / RESOLVED, LONGER * min(intervals))
    return [s for s, interval in zip(sources, intervals, strict=True) if interval <= enough]


def _variance(source: Source, record: int) -> float:
    return float(source.smoothed.variances_between[record, source.derivative])
