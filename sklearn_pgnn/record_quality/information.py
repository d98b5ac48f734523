"""How much records tell of a model's parameters: a quick fit, and the information of windows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from time import process_time

import numpy as np

from sklearn_pgnn.estimators.parameter_search import ParameterFit, fit_locally
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.excitation import information_of, rich_windows
from sklearn_pgnn.record_quality.limits import HURRY, LOOSE, MOST_FINE, MOST_SAMPLES, SEVERAL
from sklearn_pgnn.simulation.freedom import freedom_of
from sklearn_pgnn.simulation.record_windows import (
    MIN_WINDOWS,
    WindowedRecords,
    window_records,
    without_gaps,
)
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, invert, standard_errors, trusted_spread
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.trajectories.record import Record

#: tolerance of the fit, and the share of its curvature that orders directions without information
TOLERANCE, ORDERED = 1e-5, 1e-8


@dataclass(frozen=True)
class Told:
    """What records tell of the parameters of a fit to one of `every` windows, relative to `size`.

    Standard `errors` are infinite where nothing is told; `begun` has the steps of given values.
    """

    found: ParameterFit
    begun: WindowedRecords
    every: int
    size: np.ndarray
    spread: np.ndarray
    errors: np.ndarray

    @property
    def times_noise(self) -> float:
        """What the fit leaves, in units of the noise; infinite where it diverges."""
        return self.found.fit.times_noise

    @cached_property
    def information(self) -> np.ndarray:
        """That of the records."""
        return self.under(self.found.windowed.windows, self.found.fit.x0)

    def under(self, windows: ShootingWindows, x0: np.ndarray) -> np.ndarray:
        """Return the information that other windows would give at the same values."""
        fit = self.found.fit
        names = [each.name for each in fit.freedoms]
        plain = information_of(fit.model, windows, x0, self.spread, names)
        return self.every * plain * np.outer(self.size, self.size)

    @cached_property
    def rich(self) -> np.ndarray:
        """Half-widths under inputs of the same range with many frequencies."""
        windows, x0 = rich_windows(self.found.fit, self.found.windowed.windows)
        return self.half_widths(self.under(windows, x0))

    @cached_property
    def _raised(self) -> np.ndarray:
        """By how much residuals raise variances; most where nothing is told."""
        inverse, flat = invert(self.information)
        seen = ~flat & np.isfinite(self.errors) & (np.diag(inverse) > 0)
        raised = np.divide(self.errors**2, np.diag(inverse), out=np.ones(seen.size), where=seen)
        return np.where(seen, raised, max(1.0, self.times_noise**2, *raised))

    def half_widths(
        self, information: np.ndarray, which: Sequence[int] | None = None
    ) -> np.ndarray:
        """Return the half-widths of 95 % intervals of some parameters, the others known."""
        kept = list(range(self.size.size)) if which is None else list(which)
        inverse, flat = invert(information[np.ix_(kept, kept)])
        half = NORMAL_95 * np.sqrt(self._raised[kept] * np.diag(inverse))
        return np.where(flat, np.inf, half)

    def partners(self, place: int, enough: float) -> list[int]:
        r"""Return the other parameters that have to be known for a small interval of one.

        The one that lowers its variance most, by :math:`C_{ij}^2 / C_{jj}`, is taken first, and
        `SEVERAL` at most; none if even all of them are not enough.
        """
        if not self.half_widths(self.information, [place])[0] < enough:
            return []
        size = np.sqrt(np.diag(self.information))
        scale = np.where(size > 0, size, 1.0)
        ordered = self.information / np.outer(scale, scale) + np.diag(ORDERED + (size == 0))
        covariance = np.linalg.inv(ordered)
        known: list[int] = []
        while len(known) < SEVERAL:
            kept = [place, *(i for i in range(size.size) if i != place and i not in known)]
            if self.half_widths(self.information, kept)[0] < enough:
                break
            variance = np.maximum(np.diag(covariance), np.finfo(float).tiny)
            gain = covariance[place] ** 2 / variance
            gain[[place, *known]] = -1.0
            best = int(np.argmax(gain))
            column = covariance[best]
            covariance = covariance - np.outer(column, column) / variance[best]
            known.append(best)
        return sorted(known)


def tell(model: PhysicsModel, records: tuple[Record, ...]) -> Told:
    """Fit a model's free parameters to records in seconds, and return what these tell of them.

    A weak prior, as wide as `LOOSE` times each value, holds directions that the records do not
    determine near the given values. It does not count as information.
    """
    windowed = window_records(model, without_gaps(records))
    windows = windowed.windows
    every = max(1, int(min(windows.lengths.sum() // MOST_SAMPLES, len(windows) // MIN_WINDOWS)))
    some = replace(windowed, windows=windows.select(np.arange(0, len(windows), every)))
    free = [freedom_of(model, name, within_spread=False) for name in model.free_parameters]
    held = tuple(replace(f, spread=LOOSE * abs(f.centre) if f.centre else np.inf) for f in free)
    found = fit_locally(model, some, held, TOLERANCE, hurry())
    alone = replace(found.fit, freedoms=tuple(free))
    spread = trusted_spread(alone, found.expected, found.spread)
    given = np.array([abs(each.centre) or 1.0 for each in free])
    size = np.where(alone.values != 0.0, np.abs(alone.values), given)
    errors = np.array(list(standard_errors(alone, found.expected, spread).values()))
    return Told(found, some, every, size, spread, errors / size / np.sqrt(every))


def hurry() -> Callable[[], bool]:
    """Return what says, from now on, whether the time for a fit is over."""
    end = process_time() + HURRY
    return lambda: process_time() > end


def can_be_finer(windows: ShootingWindows, times: int) -> bool:
    """Return whether so many times as many samples take no more than seconds."""
    return int(windows.lengths.sum()) * max(times, windows.substeps) <= MOST_FINE


def finer(windows: ShootingWindows, times: int) -> ShootingWindows:
    """Return windows with more samples in the same time, under the same course of the inputs.

    Only what is simulated matters: outputs are zero where they are measured.
    """
    spans = [a + np.arange((b - a - 1) * times + 1) / times for a, b in pairwise(windows.bounds)]
    place, index = np.concatenate(spans), np.arange(windows.t.size)
    before = np.floor(place + 1e-9).astype(int)
    bounds, record = np.cumsum([0, *map(len, spans)]), windows.record
    starts = bounds[record] + times * (windows.starts - windows.bounds[record])
    u = windows.u[before]
    if windows.hold == "foh" and u.size:
        u = np.column_stack([np.interp(place, index, column) for column in windows.u.T])
    return replace(
        windows,
        t=np.interp(place, index, windows.t),
        u=u,
        y=np.where(np.isfinite(windows.y[before]), 0.0, np.nan),
        bounds=bounds,
        starts=starts,
        lengths=np.minimum(times * windows.lengths, bounds[record + 1] - starts),
        substeps=-(-windows.substeps // times),
    )
