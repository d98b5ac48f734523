r"""Wiring first: signs, exchanged channels and units, tried by simulation before any physics.

Every wiring, and the model as given, is fitted over short windows of the records, its parameters
free within a factor. With the errors :math:`e_0` as given, :math:`e` as rewired and :math:`e_n`
without any model, a wiring makes the model follow the records where the given one does not if

.. math:: \min(e_0, e_n) > 3 e

for an output, and no output is told worse. A given wiring that leaves about noise is not doubted,
and neither are the channels of a joint whose torque agrees with inverse dynamics.
"""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.unusable import BREAKDOWNS
from sklearn_pgnn.estimation.without_model import free_values, squares_without_model
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.effects.wiring import WIRINGS, Factor, OutputFactor, Wiring
from sklearn_pgnn.physics.expressions import expanded
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.joint_torques import told_by_torques, touches
from sklearn_pgnn.simulation.freedom import freedom_of
from sklearn_pgnn.simulation.record_windows import noise_levels, window_records
from sklearn_pgnn.simulation.window_fit import EachStep, ParameterPrior, fit_windows
from sklearn_pgnn.trajectories.record import Record

#: how many times smaller the error must be for a wiring to be said; half of it, and a parameter or
#: a friction that is far off is now and then taken for a wire
CLEARLY = 3.0
#: an error of so many times the noise leaves nothing to a wiring
FOLLOWS = 2.0
#: wirings whose errors differ by less explain the records as well
ALIKE = 1.25
#: squared moves of parameters, in their spreads, that do not count, and that tell wirings apart
MOVED, FAR_MOVED = 0.01, 0.5
#: how many times worse another output may be told, and how far a parameter may be off
WORSE, FARTHEST = 1.25, 2.2
#: samples that are tried, of all records, and steps of a fit: errors are compared by threes
SAMPLES = 3000
STEPS, TOLERANCE = 12, 1e-3
#: factors that are tried lie so near to that between the spreads of records and simulation
NEAR = 5.0


@dataclass(frozen=True)
class Rewired:
    """The best wiring, its equals, and the output that tells it best, with errors per noise."""

    wirings: tuple[Wiring, ...]
    output: str
    before: float
    after: float

    def finding(self, model: PhysicsModel) -> Finding:
        """Return it as a sentence with its remedy."""
        best, *others = self.wirings
        also = " or ".join(each.title(each.target) for each in others[:3])
        return Finding(
            "wiring",
            best.target,
            f"the model follows the records with {best.title(best.target)}"
            f"{f' (as well with {also})' if also else ''}, and not as given: "
            f"the error of {self.output} falls from {self.before:.3g} to {self.after:.3g} times "
            f"the noise",
            self.before / self.after if self.after else math.inf,
            f"if that is so, write {best.lines(model)} in the model file; else check units and "
            f"signs",
        )


def find_wiring(
    model: PhysicsModel,
    records: Sequence[Record],
    levels: np.ndarray | None = None,
    each_step: EachStep = None,
) -> Rewired | None:
    """Find a wiring with which a model follows records that it does not follow as given."""
    levels = noise_levels(records) if levels is None else levels
    some = tuple(_part(record, SAMPLES // len(records)) for record in records)
    trials = _Trials(model, some, levels, each_step)
    if not (trials.before > CLEARLY * FOLLOWS).any():
        return None
    right = told_by_torques(model, some, levels)
    open_ = (wiring for wiring in _wirings(trials) if not touches(wiring, right))
    tried = {wiring: trials.fitted(wiring) for wiring in open_}
    told = {wiring: fit for wiring, fit in tried.items() if trials.tells(fit)}
    if not told:
        return None
    best, *others = _different(model, _alike(model, told))
    tiny = np.finfo(float).tiny
    place = int(np.argmax(trials.before / np.maximum(told[best].errors, tiny)))
    errors = float(trials.before[place]), float(told[best].errors[place])
    return Rewired((best, *others), list(model.outputs)[place], *errors)


def _alike(model: PhysicsModel, told: "dict[Wiring, _Fit]") -> list[Wiring]:
    """Return the wirings that explain the records alike, those first that move parameters least."""
    least = min(fit.size for fit in told.values())
    alike = {wiring: fit for wiring, fit in told.items() if fit.size < least + np.log(ALIKE)}
    nearest = min(fit.moved for fit in alike.values())

    def order(wiring: Wiring) -> tuple[float, bool]:
        named = not isinstance(wiring, Factor) or bool(wiring.unit(model))
        return max(alike[wiring].moved - nearest, MOVED), not named

    kept = [wiring for wiring in alike if alike[wiring].moved < nearest + FAR_MOVED]
    return sorted(kept, key=order)


def _wirings(trials: "_Trials") -> Iterator[Wiring]:
    """Yield the wirings that are tried: of the factors only those that may be.

    What shows in an output that the model as given follows is wired right.
    """
    for kind in WIRINGS:
        for target in kind.targets(trials.model):
            wiring = kind(target)
            if trials.follows(wiring):
                continue
            if not isinstance(wiring, Factor) or trials.may_be(wiring):
                yield wiring


def _different(model: PhysicsModel, wirings: Sequence[Wiring]) -> Iterator[Wiring]:
    """Yield the wirings that are not the same as one before them in the equations."""
    seen: set[tuple] = set()
    for wiring in wirings:
        made = wiring.apply(model)
        rates = tuple(expanded(each) for each in made.equations.values())
        if (rates, tuple(made.outputs.values())) not in seen:
            seen.add((rates, tuple(made.outputs.values())))
            yield wiring


class _Fit(NamedTuple):
    """Errors by output in units of the noise, and how far parameters moved, in their spreads."""

    errors: np.ndarray
    moved: float

    @property
    def size(self) -> float:
        """The mean logarithm of the errors."""
        return float(np.mean(np.log(np.maximum(self.errors, 1.0))))


class _Trials:
    """The errors of a model on records, as given and as rewired, in units of the noise."""

    def __init__(
        self,
        model: PhysicsModel,
        records: tuple[Record, ...],
        levels: np.ndarray,
        each_step: EachStep,
    ):
        self.model, self.records, self.levels = model, records, levels
        self.each_step = each_step

    @cached_property
    def given(self) -> np.ndarray:
        """The errors as given."""
        return self._fitted(self.model).errors

    @cached_property
    def before(self) -> np.ndarray:
        """The errors as given, at most those without any model."""
        return np.minimum(self.given, self._without)

    def follows(self, wiring: Wiring) -> bool:
        """Return whether the model as given follows an output that a wiring would spoil."""
        followed = self.given < FOLLOWS
        told = {name for name, is_told in zip(self.model.outputs, followed, strict=True) if is_told}
        return not told.isdisjoint(wiring.seen_at(self.model))

    def fitted(self, wiring: Wiring) -> _Fit:
        """Return the model as rewired."""
        near = isinstance(wiring, Factor)  # a parameter that is far off is a factor, too
        return self._fitted(wiring.apply(self.model), self._most, near)

    @cached_property
    def _most(self) -> float:
        """The squares above which a wiring can tell clearly more of no output."""
        others = np.maximum(np.maximum(WORSE * self.given, FOLLOWS) ** 2 * self._counts, 1e-300)
        own = (self.before / CLEARLY) ** 2 * self._counts
        return float(np.max([own[i] + np.delete(others, i).sum() for i in range(own.size)]))

    def tells(self, fit: _Fit) -> bool:
        """Return whether a wiring clearly tells more of an output, and less of none."""
        errors = np.maximum(fit.errors, 1.0)
        clearly = (self.before > CLEARLY * errors).any()
        return bool(clearly and (errors < np.maximum(WORSE * self.given, FOLLOWS)).all())

    def may_be(self, factor: Factor) -> bool:
        """Return whether the spreads of records and simulation may differ by a factor."""
        known = self._scales[np.isfinite(self._scales)]
        if isinstance(factor, OutputFactor):
            known = self._scales[[list(self.model.outputs).index(factor.quantity)]]
        off = np.abs(np.log(np.maximum(known, 1e-300) / factor.of_output))
        return not known.size or bool((~(off > np.log(NEAR))).any())

    @cached_property
    def _scales(self) -> np.ndarray:
        """The spread of every output over that of its simulation from the starts of records."""
        whole = window_records(
            self.model, self.records, levels=self.levels, window_length="trajectory"
        )
        start = whole.states.expected_starts(self.model, whole.windows)
        run = fit_windows(self.model, whole.windows, (), *start, max_steps=0)
        y, left = whole.windows.y, run.evaluation.residual
        with np.errstate(all="ignore"):
            return np.array(
                [_spread(own) / _spread(own - rest) for own, rest in zip(y.T, left.T, strict=True)]
            )

    def _fitted(self, model: PhysicsModel, most: float = np.inf, near: bool = False) -> _Fit:
        """Fit a model; its errors are infinite where it cannot be simulated."""
        lost = _Fit(np.full(len(model.outputs), np.inf), np.inf)
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                cut = window_records(model, self.records, levels=self.levels)
                start = cut.states.expected_starts(model, cut.windows)
                fit = fit_windows(
                    model,
                    cut.windows,
                    _freedoms(model, near),
                    *start,
                    max_steps=STEPS,
                    tolerance=TOLERANCE,
                    prune_above=most,
                    each_step=self.each_step,
                )
        except (*BREAKDOWNS, RecordError):
            return lost
        if not fit.usable:
            return lost
        with np.errstate(all="ignore"):
            rest = fit.evaluation.residual / cut.windows.scale
            whole = np.isfinite(rest).sum(axis=0) == np.isfinite(cut.windows.y).sum(axis=0)
            return _Fit(np.where(whole, _rms(rest), np.inf), float(fit.parts[-1]))

    @cached_property
    def _without(self) -> np.ndarray:
        """The errors without any model."""
        windows = window_records(self.model, self.records, levels=self.levels).windows
        return np.sqrt(squares_without_model(windows, free_values(self.model)) / self._counts)

    @cached_property
    def _counts(self) -> np.ndarray:
        """Measured values of every output."""
        measured = [np.isfinite(each.y).sum(axis=0) for each in self.records if each.y is not None]
        return np.maximum(np.sum(measured, axis=0), 1)


def _freedoms(model: PhysicsModel, near: bool) -> tuple[ParameterPrior, ...]:
    """Let what is free and acts vary within its spread, or by a factor, though rather little."""
    idle = {*model.unused_parameters}
    return tuple(_freedom(model, n, near) for n in model.free_parameters if n not in idle)


def _freedom(model: PhysicsModel, name: str, near: bool) -> ParameterPrior:
    known, value = freedom_of(model, name, within_spread=near), model.parameters[name].value
    if value == 0:
        return known
    least, most = sorted((value / FARTHEST, value * FARTHEST))
    low, high = max(known.low, least), min(known.high, most)
    return replace(known, low=low, high=high, spread=abs(value) / 2, scale=abs(value))


def _part(record: Record, size: int) -> Record:
    """Return the stretch of a record in which the outputs vary most, of so many samples."""
    size, y = max(size, 200), record.y
    if y is None or record.t.size <= size:
        return record
    edges = np.linspace(0, record.t.size, record.t.size // size + 1).astype(int)
    spread = np.nanstd(y, axis=0)
    share = [
        np.nansum(np.nanvar(y[a:b], axis=0) / np.where(spread > 0, spread, 1.0) ** 2)
        for a, b in pairwise(edges)
    ]
    a, b = list(pairwise(edges))[int(np.argmax(share))]
    cut = {key: getattr(record, key)[a:b] for key in ("t", "u", "y", "rows")}
    return replace(record, **cut, x0=record.x0 if a == 0 else np.full_like(record.x0, np.nan))


def _rms(values: np.ndarray) -> np.ndarray:
    counts = np.maximum(np.isfinite(values).sum(axis=0), 1)
    return np.sqrt(np.nansum(values**2, axis=0) / counts)


def _spread(values: np.ndarray) -> np.float64:  # a float of Python could not divide by 0
    return np.nanstd(values) if np.isfinite(values).any() else np.float64(np.nan)
