r"""Fit a model's parameters to windows: a local fit, and a global search for poor starts.

The local fit follows the gradient from the model's own values and finds the nearest minimum. The
global search takes, on some of the windows, the error that the best initial states leave,
:math:`\sum_w \min_{x_w} |r_w(p, x_w)|^2` to first order in :math:`x_w`, minimises it between the
parameters' bounds by differential evolution, and fits locally from the best members.

A fit moves the eigenvalues of the model. At the limit of stability of explicit steps its error
rises like a wall, and the curvature of the wall would pass for information. With steps that are too
long the optimum is off. So at the optimum the integration steps are looked at again:

.. math:: |\lambda| h \le 2 \qquad\text{and}\qquad
          |H_{1/2}^{-1} (g_{1/2} - g_1)|_i \le \tfrac{1}{10} \sigma_i,

with the gradients :math:`g` in these steps and in half ones, their Hessian :math:`H_{1/2}`, and the
standard errors :math:`\sigma`.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution
from sklearn.utils import check_random_state

from sklearn_pgnn.estimators.progress import PrintLine, silence
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.freedom import freedom_of
from sklearn_pgnn.simulation.normal_equations import normal_equations, project
from sklearn_pgnn.simulation.record_windows import (
    WindowedRecords,
    enough_substeps,
    speed_in_windows,
)
from sklearn_pgnn.simulation.substeps import IMPLICIT, MAX_SUBSTEPS, Steps
from sklearn_pgnn.simulation.uncertainty import invert, standard_errors
from sklearn_pgnn.simulation.window_fit import (
    EachStep,
    ParameterPrior,
    WindowFit,
    fit_windows,
    prior_precision,
)
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate

#: kinds of search; "auto" searches globally if the local fit leaves this many times the noise
SEARCHES, POOR = ("local", "global", "auto"), 3.0
#: a fit that leaves this many times the noise may be stuck at simulated starts of hidden states
ABOVE = 1.2
#: how far from its value a parameter without a bound is searched, in multiples of the value
REACH = 10.0
#: a global search uses every k-th window, so that about this many samples or windows remain
SOME_SAMPLES, SOME_WINDOWS = 2000, 12
#: members per parameter, generations, and members that are refined to their minimum
POPULATION, GENERATIONS, FOLLOWED = 15, 40, 4
#: logarithm of the error of a diverging simulation
WORST = 700.0
#: spread of a known initial state, as a share of an unknown one's
HELD = 1e-10
#: most refits with the hidden states simulated anew, and in other steps
ROUNDS, REFINED = 20, 8
#: relative change of the parameters from which on there is another one
SETTLED = 1e-3
#: share of a standard error that is small
SMALL_SHARE = 0.1
#: a model may become so many times faster in a further fit before its steps are too long again
ROOM = 4.0


@dataclass(frozen=True)
class Search:
    """Which parameters of a model are fitted, and how they are searched."""

    model: PhysicsModel
    names: tuple[str, ...]
    kind: str = "auto"
    random_state: Any = None
    progress: PrintLine = silence
    within_spread: bool = False

    @property
    def free(self) -> tuple[ParameterPrior, ...]:
        """The parameters with their ranges."""
        return tuple(freedom_of(self.model, name, self.within_spread) for name in self.names)


@dataclass(frozen=True)
class ParameterFit:
    """A model fitted to records, its windows in the steps of the fit, and expected starts."""

    fit: WindowFit
    expected: np.ndarray
    spread: np.ndarray
    windowed: WindowedRecords


def find_parameters(search: Search, windowed: WindowedRecords) -> ParameterFit:
    """Fit parameters to windows."""
    free, kind = search.free, search.kind
    local = fit_locally(search.model, windowed, free)
    search.progress(f"fit from the model's values: {_left(local, windowed)}")
    if kind == "local" or not free or (kind == "auto" and not _exceeds(local, windowed, POOR)):
        return local
    start = search_globally(local.fit.model, windowed, free, search)
    found = fit_locally(start, windowed, free)
    search.progress(f"fit from the best values between the bounds: {_left(found, windowed)}")
    return _best([local, found])


def find_beside_free_run(
    search: Search, windowed: WindowedRecords, whole: Callable[[], WindowedRecords]
) -> ParameterFit:
    """Fit parameters to windows, also from the values of the free run where a fit may be stuck.

    Windows begin where hidden states are simulated with the values so far, which may hold those.
    """
    found, free = find_parameters(search, windowed), search.free
    is_hidden = not set(search.model.states) <= set(windowed.states.known)
    if not (free and is_hidden and search.kind != "local" and _exceeds(found, windowed, ABOVE)):
        return found
    starts, records = dict.fromkeys((search.model, found.fit.model)), whole()
    run = _best([fit_locally(start, records, free) for start in starts])
    again = fit_locally(run.fit.model, windowed, free)
    search.progress(f"fit from the values of the free run: {_left(again, windowed)}")
    return _best([found, again])


def find_in_free_run(
    search: Search, short: WindowedRecords, whole: WindowedRecords
) -> ParameterFit:
    """Fit parameters to whole records, from the model's values and from a fit to short windows."""
    starts = {search.model: None}
    if search.names:
        starts[find_parameters(search, short).fit.model] = None
    best = _best([fit_locally(start, whole, search.free) for start in starts])
    search.progress(f"fit to whole trajectories: {_left(best, whole)}")
    return best


def _best(fits: list[ParameterFit]) -> ParameterFit:
    return min(fits, key=lambda each: each.fit.objective)


def fit_locally(
    model: PhysicsModel,
    windowed: WindowedRecords,
    free,
    tolerance=1e-9,
    each_step: EachStep = None,
) -> ParameterFit:
    """Follow the gradient to the nearest minimum on all windows, in steps that do not matter."""
    found = _fit_in_steps(model, windowed, free, tolerance, each_step)
    for _ in range(REFINED if each_step is None or not each_step() else 0):
        steps = steps_for_fit(found.windowed, found.fit, found.expected, found.spread)
        if steps == found.windowed.windows.steps:
            break
        states = copy(found.windowed.states)
        states.windows = replace(states.windows, **steps._asdict())
        windows = replace(found.windowed.windows, **steps._asdict())
        finer = replace(found.windowed, windows=windows, states=states)
        found = _fit_in_steps(found.fit.model, finer, free, tolerance, each_step)
    return found


def _fit_in_steps(
    model: PhysicsModel, windowed: WindowedRecords, free, tolerance, each_step: EachStep
) -> ParameterFit:
    x0_start, starts = None, windowed.windows.starts
    for _ in range(ROUNDS):
        estimate = windowed.states.estimate(model)
        expected, spread = _where_told(windowed, estimate.x[starts], estimate.spread)
        fit = fit_windows(
            model, windowed.windows, free, expected, spread, x0_start=x0_start,
            max_steps=60, tolerance=tolerance, each_step=each_step,
        )  # fmt: skip
        is_known = set(model.states) <= set(windowed.states.known)
        before = [model.parameters[each.name].value for each in fit.freedoms]
        settled = np.allclose(fit.values, np.array(before), rtol=SETTLED, atol=0.0)
        is_told_to_end = each_step is not None and each_step()
        if is_known or not np.isfinite(fit.objective) or settled or is_told_to_end:
            break  # hidden states move no more
        model, x0_start = fit.model, fit.x0
    return ParameterFit(fit, expected, spread, windowed)


def _where_told(windowed: WindowedRecords, expected, spread):
    """Hold the initial states that are known in all records."""
    if windowed.told is None:
        return expected, spread
    known = np.isfinite(windowed.told).all(axis=0)
    return np.where(known, windowed.told, expected), np.where(known, HELD * spread, spread)


def steps_for_fit(
    windowed: WindowedRecords, fit: WindowFit, expected: np.ndarray, spread: np.ndarray
) -> Steps:
    """Return the steps in which to fit again, the present ones if the fit depends on none."""
    windows, now = windowed.windows, windowed.windows.steps
    if not fit.usable:
        return now
    fast = speed_in_windows(fit.model, windows, fit.evaluation)
    if not now.are_stable(fast):
        if windowed.steps_are_told:
            return Steps(IMPLICIT, now.substeps)
        return enough_substeps(fit.model, replace(windows, substeps=1), fit.x0, ROOM * fast)
    if windowed.steps_are_told or now.substeps >= MAX_SUBSTEPS or not fit.freedoms:
        return now
    double = Steps(now.method, 2 * now.substeps)
    finer = evaluate(
        fit.model,
        replace(windows, **double._asdict()),
        fit.x0,
        tuple(freedom.name for freedom in fit.freedoms),
    )
    return double if _moves(fit, replace(fit, evaluation=finer), expected, spread) else now


def _moves(fit: WindowFit, finer: WindowFit, expected, spread) -> bool:
    """Return whether finer steps move a parameter by a notable part of its standard error."""
    if not np.isfinite(finer.evaluation.squares).all():
        return False
    before, after = (normal_equations(each, expected, spread) for each in (fit, finer))
    inverse, _ = invert(after.hessian.sum(axis=0) + prior_precision(fit.freedoms))
    moved = inverse @ (after.gradient - before.gradient).sum(axis=0)
    errors = np.array(list(standard_errors(fit, expected, spread).values()))
    known = np.isfinite(errors) & (errors > 0)
    return bool((np.abs(moved[known]) > SMALL_SHARE * errors[known]).any())


def search_globally(
    model: PhysicsModel, windowed: WindowedRecords, free, search: Search
) -> PhysicsModel:
    """Search between the bounds for the values from which a local fit ends lowest."""
    scales = [_Scale.of(freedom) for freedom in free]
    windows = windowed.windows  # of which some are enough, whatever the length of the records
    every = min(windows.lengths.sum() // SOME_SAMPLES, len(windows) // SOME_WINDOWS)
    windows = windows.select(np.arange(0, len(windows), max(1, every)))
    estimate = windowed.states.estimate(model)
    expected = estimate.x[windows.starts]

    def at(point) -> PhysicsModel:
        values = {f.name: s.value(z) for f, s, z in zip(free, scales, point, strict=True)}
        return model.with_parameters(**values)

    def error(point) -> float:
        squares = _least_squares(at(point), windows, expected, estimate.spread)
        return float(np.log(squares)) if 0 < squares < np.inf else WORST

    def told(intermediate_result) -> None:
        samples = windows.lengths.sum() * windows.y.shape[1]
        size = np.sqrt(np.exp(intermediate_result.fun) / samples)
        search.progress(
            f"search between the bounds, generation {intermediate_result.nit} of at most "
            f"{GENERATIONS}: error {size:.4g} times the noise"
        )

    start = [s.place(model.parameters[f.name].value) for f, s in zip(free, scales, strict=True)]
    result = differential_evolution(
        error,
        [(0.0, 1.0)] * len(free),
        popsize=POPULATION,
        maxiter=GENERATIONS,
        tol=0.0,
        atol=1e-2,
        polish=False,
        init="sobol",
        x0=start,
        rng=np.random.default_rng(check_random_state(search.random_state).randint(2**31 - 1)),
        callback=told,
    )
    order = np.argsort(result.population_energies)[:FOLLOWED]
    found = [at(result.population[k]) for k in order]
    stable = replace(windows, method=IMPLICIT)
    fits = [fit_windows(each, windows, free, expected, estimate.spread) for each in found]
    if not any(fit.usable for fit in fits):
        fits = [fit_windows(each, stable, free, expected, estimate.spread) for each in found]
    return min(fits, key=lambda each: each.objective).model


def _least_squares(model: PhysicsModel, windows: ShootingWindows, expected, spread) -> float:
    """Return the squared error at the best initial states, to first order about the expected."""
    gram = evaluate(model, windows, expected, ()).gram
    if not np.isfinite(gram).all() and windows.method != IMPLICIT:  # the model may be a fast one
        gram = evaluate(model, replace(windows, method=IMPLICIT), expected, ()).gram
    if not np.isfinite(gram).all():
        return np.inf
    step = project(gram, 0, 1.0 / spread**2, np.zeros_like(expected)).state_step
    return float(gram[:, -1, -1].sum() - np.sum(gram[:, :-1, -1] * step))


@dataclass(frozen=True)
class _Scale:
    """Map of a parameter's range to the unit interval, logarithmic for positive values."""

    low: float
    high: float

    @classmethod
    def of(cls, freedom: ParameterPrior) -> "_Scale":
        reach = REACH * freedom.scale
        low = freedom.low if np.isfinite(freedom.low) else freedom.centre - reach
        high = freedom.high if np.isfinite(freedom.high) else freedom.centre + reach
        return cls(low, high)

    def value(self, place: float) -> float:
        if self.low > 0:
            value = self.low * (self.high / self.low) ** place
        else:
            value = self.low + (self.high - self.low) * place
        return float(np.clip(value, self.low, self.high))

    def place(self, value: float) -> float:
        if self.high == self.low:
            return 0.5
        if self.low > 0:
            place = np.log(value / self.low) / np.log(self.high / self.low)
        else:
            place = (value - self.low) / (self.high - self.low)
        return float(np.clip(place, 0.0, 1.0))


def _left(found: ParameterFit, windowed: WindowedRecords) -> str:
    """Return the error of a fit as text."""
    measured = np.isfinite(windowed.windows.y).sum()
    size = np.sqrt(found.fit.squares / measured)
    return f"error {size:.4g} times the noise"


def _exceeds(found: ParameterFit, windowed: WindowedRecords, times: float) -> bool:
    """Return whether a fit leaves so many times the noise."""
    measured = np.isfinite(windowed.windows.y).sum()
    return not found.fit.squares <= times**2 * measured
