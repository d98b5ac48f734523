r"""Detectability: how large an effect must be before these records would show it.

An effect of some size is added to the fitted model, which is simulated with the records' own inputs
and initial states. The fitted model is then re-tuned to the simulated outputs, without noise. The
remaining residuals, over windows and in free run, are all that any diagnosis could see. With noise
drawn on top, the criterion of the diagnosis gives how often it would have named a cause.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed

from sklearn_pgnn.estimation.budgets import DECADES
from sklearn_pgnn.estimation.record_differences import n_groups
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.experiment_design.power import PowerAnalysis
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.differences import IN, Difference, cleaned
from sklearn_pgnn.physics.effects.targets import pair
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.readings import reading
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.threads import in_turn, one_thread_each
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY


@dataclass(frozen=True)
class Detectable:
    """The detectability of one effect.

    Parameters
    ----------
    effect, target : str
        Id of the effect, and what it acts on.
    parameter, unit : str
        The parameter that measures its size, and its unit; its other parameters scale with it.
    smallest : float
        Smallest size that is detected with the requested power; NaN if none is.
    curve : tuple of (float, float)
        Sizes and the power at each, from a size without any effect to a large one.
    reason : str
        Why it is never detected; empty if it is.
    found : bool or None
        Whether the diagnosis itself found it at the smallest size; None if that was not tried.
    at_smallest : Effect or None
        The effect at its smallest size.
    is_least_tried : bool
        Whether the smallest size is the smallest that was tried, such as a delay of half a sample:
        of smaller ones nothing is known.

    Examples
    --------
    >>> curve = ((0.0, 0.0), (0.02, 0.1), (0.05, 0.9), (0.5, 1.0))
    >>> row = Detectable("coulomb_friction", "v", "level", "N", smallest=0.05, curve=curve)
    >>> row.smallest, row.unit
    (0.05, 'N')
    """

    effect: str
    target: str
    parameter: str
    unit: str
    smallest: float
    curve: tuple[tuple[float, float], ...]
    reason: str = ""
    found: bool | None = None
    at_smallest: Effect | None = field(default=None, repr=False)
    is_least_tried: bool = False


@dataclass(frozen=True)
class Detectability:
    """The detectability of effects on a rig with its excitation and noise.

    Parameters
    ----------
    rows : tuple of Detectable
        One per effect, in the order of the catalogue.
    power : float
        Probability with which the smallest size is detected.
    sizes : tuple of float
        Multiples of the smallest size at which `to_frame` gives the power.

    Examples
    --------
    >>> curve = ((0.0, 0.0), (0.02, 0.1), (0.05, 0.9), (0.5, 1.0))
    >>> seen = Detectable("coulomb_friction", "v", "level", "N", smallest=0.05, curve=curve)
    >>> found = Detectability((seen,), power=0.9, sizes=(1.0, 2.0))
    >>> found
    <Detectability: 1 of 1 effects, power 0.9>
    >>> found.to_frame()["power at 2x"].round(2).tolist()
    [0.93]
    """

    rows: tuple[Detectable, ...]
    power: float
    sizes: tuple[float, ...]

    def __repr__(self) -> str:
        seen = sum(not row.reason for row in self.rows)
        return f"<Detectability: {seen} of {len(self.rows)} effects, power {self.power:g}>"

    def _repr_html_(self) -> str:
        return reading("detectability_html")(self)

    def to_frame(self) -> pd.DataFrame:
        """Return the results as a table, one row per effect.

        Returns
        -------
        DataFrame
            Effect, target, the smallest size with its parameter and unit, whether it is the
            smallest that was tried, the power at multiples of it, why an effect is never detected,
            and whether the diagnosis itself found it.
        """
        table = []
        for row in self.rows:
            known = ("effect", "target", "parameter", "smallest", "unit", "is_least_tried")
            line = {name: getattr(row, name) for name in known}
            line |= {f"power at {m:g}x": power for m, power in self._powers(row)}
            table.append(line | {"reason": row.reason, "found": row.found})
        return pd.DataFrame(table)

    def _powers(self, row: Detectable) -> Iterator[tuple[float, float]]:
        """Interpolate the power at multiples of the smallest size, on a logarithmic scale."""
        (none, _), *seen = row.curve
        strengths = np.log([abs(size - none) for size, _ in seen if size != none])
        powers = [power for size, power in seen if size != none]
        smallest = abs(row.smallest - none)
        for multiple in self.sizes:
            power = np.nan
            if smallest > 0 and powers:
                power = np.interp(np.log(multiple * smallest), strengths, powers, left=np.nan)
            yield multiple, float(power)

    def plot(self, **options: Any) -> Any:
        """Plot the smallest sizes, and the power as a function of size.

        Parameters
        ----------
        **options
            See `sklearn_pgnn.inspection.DetectabilityDisplay.plot`.

        Returns
        -------
        DetectabilityDisplay
            The plotted display.
        """
        return reading("plot_detectability")(self, **options)


# -- one effect ------------------------------------------------------------------------------------


@one_thread_each()  # here, for it may be a task of a cluster's worker
def detect(
    analysis: PowerAnalysis, cause: Effect, power: float, multiples: Sequence[float] = ()
) -> Detectable:
    """Find the smallest size of an effect that the diagnosis would name."""
    sizes = _Sizes(analysis, cause)
    curve: dict[float, float] = {}
    for low in 10.0 ** -np.arange(DECADES + 1.0):  # a large size may be too much for the machine
        curve[low] = sizes.power(low)
        if curve[low] < power:
            break
    seen = [share for share in curve if curve[share] >= power]
    if seen and curve[low] < power:
        high = min(seen)
        for _ in range(DECADES):
            middle = float(np.sqrt(low * high))
            curve[middle] = sizes.power(middle)
            low, high = (low, middle) if curve[middle] >= power else (middle, high)
        near = (high * multiple for multiple in multiples)
        curve.update((share, sizes.power(share)) for share in near if 0.0 < share <= 1.0)
    return sizes.described({s: p for s, p in curve.items() if np.isfinite(p)}, power)


class _Sizes:
    """One effect at any size in the fitted model."""

    def __init__(self, analysis: PowerAnalysis, cause: Effect):
        scales = analysis.records.problem.scales
        self.analysis, self.kind, self.target = analysis, type(cause), cause.target
        self.of_size = cause.of_size(cause.target, analysis.model, scales)
        self.none = cause.nothing(cause.target, analysis.model, scales)
        self.field = cause.size_field()
        least = self.of_size(0.0)
        #: an effect with a memory is not neutral at zero size: play without width is a lag
        self.bare = least if self.size_of(least) == self.none else None

    def size_of(self, effect: Effect) -> float:
        return float(getattr(effect, self.field))

    def power(self, share: float) -> float:
        """Return the power to detect the effect; NaN where a simulation becomes non-finite."""
        return self.analysis.power(self.of_size(share), self.bare)

    def described(self, curve: dict[float, float], power: float) -> Detectable:
        found = [share for share in curve if curve[share] >= power]
        smallest = self.of_size(min(found)) if found else None
        points = [(self.size_of(self.of_size(share)), curve[share]) for share in sorted(curve)]
        return Detectable(
            effect=self.kind.id,
            target=self.target,
            parameter=self.field,
            unit=self._unit(self.of_size(1.0)),
            smallest=np.nan if smallest is None else self.size_of(smallest),
            curve=((self.none, 0.0), *points),
            reason="" if found else self._why_not(max(curve, default=0.0), power),
            at_smallest=smallest,
            is_least_tried=bool(found) and min(found) == min(curve),
        )

    def _unit(self, effect: Effect) -> str:
        return effect.apply(self.analysis.model).unit(effect.names()[self.field])

    def _why_not(self, share: float, power: float) -> str:
        """Return why even the largest size that can be simulated is not detected."""
        analysis, effect = self.analysis, self.of_size(share)
        windows = analysis.windows_with(effect, self.bare) if share else None
        if windows is None:
            return "however small, the simulation with it becomes non-finite"
        largest = f"even {self.size_of(effect):.3g} {self._unit(effect)}".rstrip()
        if not analysis.moves_outputs(windows):
            return f"{largest} hardly changes the outputs: these inputs do not excite it"
        if not analysis.power(effect, self.bare, retuned=False) >= power:
            return f"{largest} stays within the noise"
        if effect.target in analysis.model.parameters:
            return f"{largest} lies within the parameter's spread, so re-tuning absorbs it"
        return f"{largest} is imitated by re-tuning {_moved(analysis, windows)}"


def _moved(analysis: PowerAnalysis, windows: ShootingWindows) -> str:
    """Return the parameter that re-tuning to windows moves most, or else the initial states."""
    fit = analysis.retune(windows)
    shifts = {
        freedom.name: abs(fit.model.parameters[freedom.name].value - freedom.centre) / freedom.scale
        for freedom in fit.freedoms
    }
    return max(shifts, key=shifts.__getitem__) if any(shifts.values()) else "initial states"


# -- all of them -----------------------------------------------------------------------------------


def detect_all(
    analysis: PowerAnalysis,
    candidates: Sequence[Effect],
    power: float,
    multiples: Sequence[float] = (),
    n_jobs: int | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[Detectable, ...]:
    """Find the smallest size of every effect that has a size and is not yet in the model."""
    fitting = [cause for cause in candidates if _fits(analysis.model, cause)]
    report = progress or (lambda stage, done, total: None)
    found: list[Detectable] = []
    report("effects", 0, len(fitting))
    calls = [delayed(detect)(analysis, cause, power, multiples) for cause in fitting]
    for each in in_turn(calls, n_jobs, prefer="threads"):
        found.append(each)
        report("effects", len(found), len(fitting))
    return tuple(found)


def _fits(model: PhysicsModel, cause: Effect) -> bool:
    if not cause.size_field():
        return False
    try:
        cause.apply(model)
    except ModelError:
        return False
    return True


def in_last_record(
    analysis: PowerAnalysis, kinds: Sequence[type[Difference]], targets: Collection[str] | None
) -> tuple[PowerAnalysis, tuple[Effect, ...]]:
    """Return the analysis, and the candidates, of what may differ in the last of the records."""
    records, model = analysis.records, analysis.model
    windows, column = records.windows, IN + cleaned(records.names[-1])
    candidates = tuple(
        kind(pair(name, column))
        for kind in kinds
        for name in kind.quantities_of(model)
        if targets is None or name in targets
    )
    marks = np.arange(len(windows.t)) >= windows.bounds[-2]
    fit = records.fits["extended"]
    marked = replace(
        records,
        windows=replace(windows, u=np.column_stack([windows.u, marks])),
        fits={"extended": replace(fit, model=model.replace(inputs={**model.inputs, column: "1"}))},
    )
    n_compared = len(candidates) * n_groups(records.problem)
    n_candidates = analysis.criterion.n_candidates + n_compared
    criterion = replace(analysis.criterion, n_candidates=n_candidates)
    return replace(analysis, records=marked, criterion=criterion), candidates


# -- simulated records with one more effect, for testing the diagnosis itself ----------------------


def inject(
    analysis: PowerAnalysis, effect: Effect | None, random_state: int | np.random.Generator = 0
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Simulate the records of a diagnosis with an effect added to the machine.

    Return X with trajectory, time, inputs, and the initial states where they were known, and y with
    noise: like the residuals of the extended model, with random phases.

    .. [1] J. Theiler et al., "Testing for nonlinearity in time series: the method of surrogate
       data", Physica D 58, 1992, :doi:`10.1016/0167-2789(92)90102-S`.
    """
    rng, windows = np.random.default_rng(random_state), analysis.windows
    model = analysis.model if effect is None else effect.apply(analysis.model)
    x0, record = analysis.start(model), windows.record
    tables, outputs = [], []
    for r, (a, b) in enumerate(pairwise(windows.bounds)):
        start = x0[np.flatnonzero(record == r)[0]]
        y = free_run(model, windows, a, b, start).check().y
        rest = analysis.records.fits["extended"].residual[a:b]
        outputs.append(y + _alike(rest, analysis.white, rng))
        tables.append(_table(analysis, r, windows.t[a:b], windows.u[a:b], start))
    y = pd.DataFrame(np.concatenate(outputs), columns=list(model.outputs))
    return pd.concat(tables, ignore_index=True), y.where(np.isfinite(windows.y))


def _table(
    analysis: PowerAnalysis, r: int, t: np.ndarray, u: np.ndarray, start: np.ndarray
) -> pd.DataFrame:
    model = analysis.records.problem.prior
    table = pd.DataFrame(u[:, : len(model.inputs)], columns=list(model.inputs))  # without marks
    table.insert(0, TIME, t)
    table.insert(0, TRAJECTORY, analysis.records.names[r])
    told = analysis.records.problem.states.told[r]
    for i, name in enumerate(model.states):
        table[name] = np.nan
        if name in told:
            table.loc[0, name] = start[i]
    return table


def _alike(rest: np.ndarray, white: bool, rng: np.random.Generator) -> np.ndarray:
    """Draw noise with the power of a residual and, unless white, its spectrum."""
    rest = np.nan_to_num(rest)
    noise = rng.standard_normal(rest.shape)
    if white:
        return noise * np.sqrt(np.mean(rest**2, axis=0))
    phases = np.exp(1j * np.angle(np.fft.rfft(noise, axis=0)))
    return np.fft.irfft(np.abs(np.fft.rfft(rest, axis=0)) * phases, n=len(rest), axis=0)


def with_verdict(
    analysis: PowerAnalysis,
    row: Detectable,
    diagnose: Callable[[pd.DataFrame, pd.DataFrame], Iterable[Collection[tuple[str, str]]]],
) -> Detectable:
    """Run the diagnosis itself on records with an effect at its smallest size."""
    if row.at_smallest is None:
        return row
    groups = diagnose(*inject(analysis, row.at_smallest, analysis.seed))
    return replace(row, found=any((row.effect, row.target) in group for group in groups))
