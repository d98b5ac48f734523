"""How much records tell of a model's parameters: a quick fit, and the information of windows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from time import process_time

import numpy as np

from sklearn_pgnn.estimators.parameter_search import ParameterFit, fit_locally
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.excitation import information_of, rich_windows
from sklearn_pgnn.record_quality.limits import HURRY, LOOSE, MOST_FINE, MOST_SAMPLES
from sklearn_pgnn.simulation.freedom import freedom_of
from sklearn_pgnn.simulation.normal_equations import normal_equations
from sklearn_pgnn.simulation.record_windows import MIN_WINDOWS, window_records, without_gaps
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, invert, standard_errors, trusted_spread
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.trajectories.record import Record

#: tolerance of the fit
TOLERANCE = 1e-5
#: share of its curvature that keeps a direction without information in order
ORDERED = 1e-8
#: most parameters that are named as collinear with one
SEVERAL = 4


@dataclass(frozen=True)
class Told:
    """What records tell of the parameters of a fit, relative to the `size` of each.

    `errors` are standard errors, infinite where nothing is told; `raised` is by how much residuals
    that are not white raise a variance, and the fit has one of `every` windows; `is_late` is
    whether the time for all is over.
    """

    found: ParameterFit
    every: int
    is_late: Callable[[], bool]
    size: np.ndarray
    errors: np.ndarray
    information: np.ndarray
    raised: np.ndarray
    spread: np.ndarray

    @property
    def names(self) -> list[str]:
        """The parameters."""
        return [each.name for each in self.found.fit.freedoms]

    def half_widths(
        self, information: np.ndarray, which: Sequence[int] | None = None
    ) -> np.ndarray:
        """Return the half-widths of 95 % intervals of some parameters, the others known."""
        kept = list(range(len(self.size))) if which is None else list(which)
        inverse, flat = invert(information[np.ix_(kept, kept)])
        half = NORMAL_95 * np.sqrt(self.raised[kept] * np.diag(inverse))
        return np.where(flat, np.inf, half)

    def along(self, windows: ShootingWindows, x0: np.ndarray) -> np.ndarray:
        """Return the information that other windows would give at the same values."""
        model = self.found.fit.model
        plain = information_of(model, windows, x0, self.spread, self.names)
        return self.every * plain * np.outer(self.size, self.size)

    def with_rich_inputs(self) -> np.ndarray:
        """Return the information under inputs of the same range with many frequencies."""
        return self.along(*rich_windows(self.found.fit, self.found.windowed.windows))

    def sampled(self, times: int) -> np.ndarray:
        """Return the information of so many times as many samples in the same time."""
        return self.along(finer(self.found.windowed.windows, times), self.found.fit.x0)


def tell(model: PhysicsModel, records: tuple[Record, ...]) -> Told:
    r"""Fit a model's free parameters to records in seconds, and return what these tell of them.

    A weak prior, as wide as `LOOSE` times each value, holds directions that the records do not
    determine near the given values. It does not count as information.
    """
    windowed = window_records(model, without_gaps(records))
    windows, end = windowed.windows, process_time() + HURRY

    def is_late() -> bool:
        return process_time() > end

    every = int(min(windows.lengths.sum() // MOST_SAMPLES, len(windows) // MIN_WINDOWS))
    some = windows.select(np.arange(0, len(windows), every)) if every > 1 else windows
    free = [freedom_of(model, name, within_spread=False) for name in model.free_parameters]
    held = tuple(replace(f, spread=LOOSE * abs(f.centre) if f.centre else np.inf) for f in free)
    found = fit_locally(model, replace(windowed, windows=some), held, TOLERANCE, is_late)
    return _told(found, max(every, 1), is_late)


def _told(found: ParameterFit, every: int, is_late: Callable[[], bool]) -> Told:
    loose = tuple(replace(each, spread=np.inf) for each in found.fit.freedoms)
    fit = replace(found.fit, freedoms=loose)
    spread = trusted_spread(fit, found.expected, found.spread)
    size = np.maximum(np.abs(fit.values), [abs(each.centre) for each in fit.freedoms])
    size = np.where(size > 0, size, 1.0)
    errors = np.array(list(standard_errors(fit, found.expected, spread).values()))
    errors = errors / size / np.sqrt(every)
    n = len(size)
    hessian = normal_equations(fit, found.expected, spread).hessian.sum(axis=0)
    information = every * hessian * np.outer(size, size) if fit.usable else np.zeros((n, n))
    inverse, flat = invert(information) if n else (information, np.zeros(0, dtype=bool))
    seen = ~flat & np.isfinite(errors) & (np.diag(inverse) > 0)
    raised = np.divide(errors**2, np.diag(inverse), out=np.ones(n), where=seen)
    count = max(int(np.isfinite(fit.evaluation.residual).sum()), 1)
    usual = max(1.0, fit.squares / count) if fit.usable else 1.0
    raised = np.where(seen, raised, max(usual, float(raised.max(initial=1.0))))
    return Told(found, every, is_late, size, errors, information, raised, spread)


def partners(told: Told, place: int, enough: float) -> list[int]:
    r"""Return the other parameters that have to be known for a small interval of one.

    They are taken one by one: the one that lowers its variance most, by
    :math:`C_{ij}^2 / C_{jj}`. Those that turn out idle are left out, and `SEVERAL` are the most.
    Empty if even all others are not enough.
    """
    if not told.half_widths(told.information, [place])[0] < enough:
        return []
    size = np.sqrt(np.diag(told.information))
    seen = np.where(size > 0, size, 1.0)
    related = told.information / np.outer(seen, seen)
    covariance = np.linalg.inv(related + ORDERED * np.eye(size.size) + np.diag(size == 0))
    known: list[int] = []
    while len(known) < SEVERAL and not _width(told, place, known) < enough:
        gain = covariance[place] ** 2 / np.maximum(np.diag(covariance), np.finfo(float).tiny)
        gain[[place, *known]] = -1.0
        best = int(np.argmax(gain))
        column = covariance[best]
        covariance = covariance - np.outer(column, column) / column[best]
        known.append(best)
    for each in known[:-1]:
        fewer = [i for i in known if i != each]
        if _width(told, place, fewer) < enough:
            known = fewer
    return sorted(known)


def _width(told: Told, place: int, known: list[int]) -> float:
    """Return the half-width of one parameter where some others are known."""
    kept = [place, *(i for i in range(told.size.size) if i != place and i not in known)]
    return float(told.half_widths(told.information, kept)[0])


def sample_steps(windows: ShootingWindows) -> np.ndarray:
    """Return the sample intervals of all records [s]."""
    return np.concatenate([np.diff(windows.t[a:b]) for a, b in pairwise(windows.bounds)])


def can_be_finer(windows: ShootingWindows, times: int) -> bool:
    """Return whether so many times as many samples take no more than seconds."""
    return int(windows.lengths.sum()) * max(times, windows.substeps) <= MOST_FINE


def finer(windows: ShootingWindows, times: int) -> ShootingWindows:
    """Return windows with more samples in the same time, under the same course of the inputs.

    Only what is simulated matters: outputs are zero where they are measured.
    """
    counts = np.diff(windows.bounds)
    firsts = np.concatenate([[0], np.cumsum((counts - 1) * times + 1)])
    places = [
        a + np.arange((n - 1) * times + 1) / times
        for a, n in zip(windows.bounds[:-1], counts, strict=True)
    ]
    place = np.concatenate(places)
    before = np.floor(place + 1e-9).astype(int)
    index = np.arange(windows.t.size)
    held = windows.hold == "zoh"
    u = [np.interp(place, index, column) for column in windows.u.T]
    begun = firsts[windows.record] + (windows.starts - windows.bounds[windows.record]) * times
    ends = np.minimum(begun + windows.lengths * times, firsts[windows.record + 1])
    return replace(
        windows,
        t=np.interp(place, index, windows.t),
        u=windows.u[before] if held else np.reshape(u, (-1, place.size)).T.copy(),
        y=np.where(np.isfinite(windows.y[before]), 0.0, np.nan),
        bounds=firsts,
        starts=begun,
        lengths=ends - begun,
        substeps=-(-windows.substeps // times),
    )
