r"""Fit a model's parameters to windows: a local fit, and a global search for poor starts.

The local fit follows the gradient from the model's own values and finds the nearest minimum. The
global search takes, on some of the windows, the error that the best initial states leave,
:math:`\sum_w \min_{x_w} |r_w(p, x_w)|^2` to first order in :math:`x_w`, minimises it between the
parameters' bounds by differential evolution, and fits locally from the best members.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import differential_evolution
from sklearn.utils import check_random_state

from sklearn_pgnn.estimators.progress import PrintLine, silence
from sklearn_pgnn.estimators.steps_of_fit import steps_for_fit, with_steps
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.freedom import freedom_of
from sklearn_pgnn.simulation.normal_equations import project
from sklearn_pgnn.simulation.record_windows import WindowedRecords
from sklearn_pgnn.simulation.substeps import IMPLICIT
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows
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


@dataclass(frozen=True)
class ParameterFit:
    """A model fitted to records.

    `expected` initial states of the windows have shape (n_windows, n_states), their uncertainty
    `spread` (n_states,); the windows are in the steps of the fit.
    """

    fit: WindowFit
    expected: np.ndarray
    spread: np.ndarray
    windowed: WindowedRecords


def find_parameters(
    model: PhysicsModel,
    windowed: WindowedRecords,
    names: tuple[str, ...],
    search: str = "auto",
    random_state=None,
    progress: PrintLine = silence,
    within_spread: bool = False,
) -> ParameterFit:
    """Fit parameters of a model to windows."""
    free = tuple(freedom_of(model, name, within_spread) for name in names)
    local = fit_locally(model, windowed, free)
    progress(f"fit from the model's values: {_left(local, windowed)}")
    if search == "local" or not names or (search == "auto" and not _exceeds(local, windowed, POOR)):
        return local
    start = search_globally(local.fit.model, windowed, free, random_state, progress)
    found = fit_locally(start, windowed, free)
    progress(f"fit from the best values between the bounds: {_left(found, windowed)}")
    return min(local, found, key=lambda each: each.fit.objective)


def find_beside_free_run(
    model: PhysicsModel,
    windowed: WindowedRecords,
    whole: Callable[[], WindowedRecords],
    names: tuple[str, ...],
    search: str = "auto",
    random_state=None,
    progress: PrintLine = silence,
    within_spread: bool = False,
) -> ParameterFit:
    """Fit parameters to windows, also from the values of the free run where a fit may be stuck.

    Windows begin where hidden states are simulated with the values so far, which may hold those.
    """
    options = search, random_state, progress, within_spread
    found = find_parameters(model, windowed, names, *options)
    is_hidden = not set(model.states) <= set(windowed.states.known)
    if not (names and is_hidden and search != "local" and _exceeds(found, windowed, ABOVE)):
        return found
    free = tuple(freedom_of(model, name, within_spread) for name in names)
    starts, records = dict.fromkeys((model, found.fit.model)), whole()
    runs = [fit_locally(start, records, free) for start in starts]
    run = min(runs, key=lambda each: each.fit.objective)
    again = fit_locally(run.fit.model, windowed, free)
    progress(f"fit from the values of the free run: {_left(again, windowed)}")
    return min(found, again, key=lambda each: each.fit.objective)


def find_in_free_run(
    model: PhysicsModel,
    short: WindowedRecords,
    whole: WindowedRecords,
    names: tuple[str, ...],
    search: str = "auto",
    random_state=None,
    progress: PrintLine = silence,
    within_spread: bool = False,
) -> ParameterFit:
    """Fit parameters to whole records, from the model's values and from a fit to short windows."""
    near = model
    if names:
        near = find_parameters(
            model, short, names, search, random_state, progress, within_spread
        ).fit.model
    free = tuple(freedom_of(model, name, within_spread) for name in names)
    fits = [fit_locally(start, whole, free) for start in dict.fromkeys((model, near))]
    best = min(fits, key=lambda each: each.fit.objective)
    progress(f"fit to whole trajectories: {_left(best, whole)}")
    return best


def fit_locally(
    model: PhysicsModel, windowed: WindowedRecords, free, tolerance=1e-9
) -> ParameterFit:
    """Follow the gradient to the nearest minimum on all windows, in steps that do not matter."""
    found = _fit_in_steps(model, windowed, free, tolerance)
    for _ in range(REFINED):
        steps = steps_for_fit(found.windowed, found.fit, found.expected, found.spread)
        if steps == found.windowed.windows.steps:
            break
        finer = with_steps(found.windowed, steps)
        found = _fit_in_steps(found.fit.model, finer, free, tolerance)
    return found


def _fit_in_steps(model: PhysicsModel, windowed: WindowedRecords, free, tolerance) -> ParameterFit:
    x0_start, starts = None, windowed.windows.starts
    for _ in range(ROUNDS):
        estimate = windowed.states.estimate(model)
        expected, spread = _where_told(windowed, estimate.x[starts], estimate.spread)
        fit = fit_windows(
            model, windowed.windows, free, expected, spread, x0_start=x0_start,
            max_steps=60, tolerance=tolerance,
        )  # fmt: skip
        is_known = set(model.states) <= set(windowed.states.known)
        if is_known or not np.isfinite(fit.objective) or _is_settled(model, fit):
            break
        model, x0_start = fit.model, fit.x0
    return ParameterFit(fit, expected, spread, windowed)


def _is_settled(model: PhysicsModel, fit: WindowFit) -> bool:
    """Return whether a fit hardly moves the parameters, and so hidden states no more."""
    before = np.array([model.parameters[each.name].value for each in fit.freedoms])
    return bool(np.allclose(fit.values, before, rtol=SETTLED, atol=0.0))


def _where_told(windowed: WindowedRecords, expected, spread):
    """Hold the initial states that are known in all records."""
    if windowed.told is None:
        return expected, spread
    known = np.isfinite(windowed.told).all(axis=0)
    return np.where(known, windowed.told, expected), np.where(known, HELD * spread, spread)


def search_globally(
    model: PhysicsModel,
    windowed: WindowedRecords,
    free,
    random_state=None,
    progress: PrintLine = silence,
):
    """Search between the bounds for the values from which a local fit ends lowest."""
    scales = [_Scale.of(freedom) for freedom in free]
    which = _some(windowed.windows)
    windows = windowed.windows.select(which)
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
        progress(
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
        rng=_generator(random_state),
        callback=told,
    )
    order = np.argsort(result.population_energies)[:FOLLOWED]
    found = [at(result.population[k]) for k in order]
    stable = replace(windows, method=IMPLICIT)
    fits = [fit_windows(each, windows, free, expected, estimate.spread) for each in found]
    if not any(fit.usable for fit in fits):
        fits = [fit_windows(each, stable, free, expected, estimate.spread) for each in found]
    return min(fits, key=lambda each: each.objective).model


def _generator(random_state) -> np.random.Generator:
    """Return a random generator for scipy, seeded from scikit-learn's ``random_state``."""
    return np.random.default_rng(check_random_state(random_state).randint(2**31 - 1))


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


def _some(windows) -> np.ndarray:
    """Take every k-th window, so that a search is cheap whatever the length of the records."""
    step = min(windows.lengths.sum() // SOME_SAMPLES, len(windows) // SOME_WINDOWS)
    return np.arange(0, len(windows), max(1, step))


def _left(found: ParameterFit, windowed: WindowedRecords) -> str:
    """Return the error of a fit as text."""
    measured = np.isfinite(windowed.windows.y).sum()
    size = np.sqrt(found.fit.squares / measured)
    return f"error {size:.4g} times the noise"


def _exceeds(found: ParameterFit, windowed: WindowedRecords, times: float) -> bool:
    """Return whether a fit leaves so many times the noise."""
    measured = np.isfinite(windowed.windows.y).sum()
    return not found.fit.squares <= times**2 * measured
