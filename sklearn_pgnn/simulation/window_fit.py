r"""Fit parameters to windows, every window's initial state projected out.

With the residuals :math:`r_w` of window :math:`w`, its initial state :math:`x_w`, the parameters
:math:`p` and their Gaussian priors, the minimum of

.. math:: \sum_w |r_w(p, x_w)|^2 + \sum_w |(x_w - \hat x_w)/\sigma_x|^2
          + \sum_i ((p_i - \bar p_i)/\sigma_i)^2

is found by Levenberg-Marquardt steps within bounds. The initial states are eliminated window by
window, so a step solves one small bounded least-squares problem. Every window has a damping of its
own, and one that a step makes worse keeps its initial state: under sticking dry friction a residual
is not a smooth function of it, and a few such windows must not hold up all others.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit, types

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.bounded_step import bounded_step
from sklearn_pgnn.simulation.normal_equations import follow, project
from sklearn_pgnn.simulation.stepping import OPTIONS
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate

#: called before each step of a fit; what is true tells it to end
EachStep = Callable[[], bool | None] | None
#: steps of a fit that is told to end
HURRIED = 2
#: first Levenberg-Marquardt damping, and its smallest and largest
FIRST_DAMPING, DAMPINGS = 1e-3, (1e-9, 1e9)
#: number of successive steps that may fail
MAX_REJECTED = 8
#: largest gain of a step, relative to the prediction of the linear model
OPTIMISM = 10.0

_F1, _F2, _F4 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, :, ::1]


@dataclass(frozen=True)
class ParameterPrior:
    """Bounds, spread (infinite for none) and typical change of a parameter in a fit."""

    name: str
    low: float
    high: float
    centre: float
    spread: float
    scale: float

    def beside(self, value: float, step: float) -> float:
        """Return the value a step up, or down where the bounds have more room there."""
        upwards = self.high - value >= min(step, value - self.low)
        return min(value + step, self.high) if upwards else max(value - step, self.low)


@dataclass(frozen=True)
class WindowFit:
    """A model fitted to windows.

    `x0`, of shape (n_windows, n_states), are fitted initial states, of led ones that of the record,
    see `sklearn_pgnn.simulation.led_states`. The objective is infinite where the model cannot be
    fitted. Its `parts` are those of the windows, and last the part of the parameters' priors; not a
    number where a parameter that hardly acts was sent beyond all numbers.
    """

    model: PhysicsModel
    freedoms: tuple[ParameterPrior, ...]
    x0: np.ndarray
    evaluation: Evaluation
    objective: float
    parts: np.ndarray

    @property
    def squares(self) -> float:
        """Sum of squared residuals in units of the noise."""
        return float(self.evaluation.squares.sum())

    @property
    def times_noise(self) -> float:
        """Root mean square residual in units of the noise; infinite if it cannot be fitted."""
        count = max(int(np.isfinite(self.evaluation.residual).sum()), 1)
        return float(np.sqrt(self.squares / count)) if self.usable else np.inf

    @property
    def values(self) -> np.ndarray:
        """Fitted values of the free parameters."""
        return _values(self.model, self.freedoms)

    @property
    def usable(self) -> bool:
        """Whether the model could be fitted: no window diverged or is mere rounding error."""
        return bool(np.isfinite(self.objective))


def fit_windows(
    model: PhysicsModel,
    windows: ShootingWindows,
    freedoms: tuple[ParameterPrior, ...],
    x0: np.ndarray,
    x0_spread: np.ndarray,
    *,
    x0_start: np.ndarray | None = None,
    evaluation: Evaluation | None = None,
    states_first: bool = False,
    min_steps: int = 0,
    max_steps: int = 25,
    tolerance: float = 1e-5,
    prune_above: float = np.inf,
    precision: np.ndarray | None = None,
    each_step: EachStep = None,
) -> WindowFit:
    """Fit a model's parameters and every window's initial state."""
    each_step = each_step or _nothing
    each_step()
    task = _Task(windows, freedoms, x0, 1.0 / x0_spread**2, precision)
    fit = task.at(task.moved(model, 0.0), x0 if x0_start is None else x0_start, evaluation)
    if x0_start is not None and not np.isfinite(fit.objective):
        fit = task.at(fit.model, np.where(np.isfinite(fit.parts)[:-1, None], fit.x0, x0))
    damping = _Damping(
        np.inf if states_first else FIRST_DAMPING, np.full(len(windows), FIRST_DAMPING)
    )
    steps = rejected = 0
    while steps < max_steps and rejected < MAX_REJECTED and np.isfinite(fit.objective):
        if each_step() and steps >= HURRIED:
            break
        small = tolerance * fit.objective
        step = task.step(fit, damping)
        if steps >= min_steps and rejected == 0 and task.is_done(fit, step, small, prune_above):
            break
        new = task.take(fit, step, small)
        decrease = fit.parts - new.parts
        damping = damping.after(decrease, step.promise, small)
        if not decrease.sum() > 0.0:
            rejected += 1
            continue
        fit, rejected, steps = new, 0, steps + 1
        if decrease.sum() < small:
            break
    return fit


def _nothing() -> None:
    """Do nothing at a step."""


@njit(types.void(_F4, _F2, _F1, _F1, _F2, _F1), **OPTIONS)
def _sum_parts(block_gram, offset, weight, off, pull, parts):
    """Fill the squares of every window with its state's prior, and last the parameters' prior."""
    n = offset.shape[0]
    for w in range(n):
        parts[w] = 0.0
        for block in range(block_gram.shape[1]):
            parts[w] += block_gram[w, block, -1, -1]
        for i in range(weight.size):
            parts[w] += weight[i] * offset[w, i] ** 2
    parts[n] = 0.0
    for i in range(off.size):
        for j in range(off.size):
            parts[n] += off[i] * pull[i, j] * off[j]


def lost_fit(
    model: PhysicsModel,
    windows: ShootingWindows,
    freedoms: tuple[ParameterPrior, ...],
    x0: np.ndarray,
) -> WindowFit:
    """Return the fit of a model that cannot be fitted: every window is lost."""
    size = len(freedoms) + len(model.states) + 1
    gram = np.zeros((len(windows), windows.blocks, size, size))
    gram[..., -1, -1] = np.inf
    evaluation = Evaluation(gram, np.full(windows.y.shape, np.nan), x0)
    return WindowFit(model, freedoms, x0, evaluation, np.inf, np.full(len(windows) + 1, np.inf))


class _Damping(NamedTuple):
    """Levenberg-Marquardt damping of the parameters and of every window's initial state."""

    parameters: float
    states: np.ndarray | float

    def after(self, decrease, promise, small) -> "_Damping":
        """Raise the damping where the decrease fell short of its prediction, by window."""
        missed = promise - decrease
        missed[np.isnan(missed)] = np.inf
        states = _damp(
            self.states, missed[:-1], np.abs(promise[:-1]), small / max(missed.size - 1, 1)
        )
        if np.isinf(self.parameters):
            return _Damping(FIRST_DAMPING, states)
        return _Damping(float(_damp(self.parameters, missed.sum(), promise.sum(), 0.0)), states)


def _damp(damping, missed, promise, small):
    """Change damping tenfold where a linear model is three quarters off, or a quarter at most."""
    least, most = DAMPINGS
    factor = np.where(missed > 0.75 * promise + small, 10.0, 1.0)
    factor = np.where(missed < 0.25 * promise + small, 0.1, factor)
    return np.minimum(np.maximum(damping * factor, least), most)


#: least damping: nearly a Gauss-Newton step
UNDAMPED = _Damping(DAMPINGS[0], DAMPINGS[0])


class _Step(NamedTuple):
    """A step's end, and the decrease of every part that a linear model predicts."""

    model: PhysicsModel
    x0: np.ndarray
    promise: np.ndarray


class _Task:
    """The objective: the squares of every window with its prior, and the parameters' priors."""

    def __init__(self, windows, freedoms, expected, weight, precision=None):
        self.windows, self.freedoms = windows, freedoms
        self.expected, self.weight = expected, weight
        self.wrt = tuple(freedom.name for freedom in freedoms)
        self.centre = _column(freedoms, "centre")
        self.pull = prior_precision(freedoms) if precision is None else precision
        self.low, self.high = _column(freedoms, "low"), _column(freedoms, "high")

    def moved(self, model, by) -> PhysicsModel:
        values = np.clip(_values(model, self.freedoms) + by, self.low, self.high)
        return model.with_parameters(**dict(zip(self.wrt, values.tolist(), strict=True)))

    def at(self, model, x0, evaluation=None) -> WindowFit:
        if evaluation is None:
            evaluation = evaluate(model, self.windows, x0, self.wrt)
        parts = np.empty(len(x0) + 1)
        off = _values(model, self.freedoms) - self.centre
        _sum_parts(evaluation.block_gram, x0 - self.expected, self.weight, off, self.pull, parts)
        objective = float(parts.sum())
        objective = np.inf if np.isnan(objective) else objective
        return WindowFit(model, self.freedoms, x0, evaluation, objective, parts)

    def step(self, fit, damping) -> _Step:
        by_p, by_x, promise = self._change(fit, damping)
        return _Step(self.moved(fit.model, by_p), fit.x0 + by_x, promise)

    def _change(self, fit, damping):
        """Return the changes of parameters and initial states, and the decrease they promise."""
        values, offset = fit.values, fit.x0 - self.expected
        gram, n_p = fit.evaluation.gram, len(self.wrt)
        normal = project(gram, n_p, self.weight, offset, damping.states)
        slope = self.pull @ (self.centre - values)
        by_p = bounded_step(
            normal.hessian.sum(axis=0) + self.pull,
            normal.gradient.sum(axis=0) + slope,
            damping.parameters,
            self.low - values,
            self.high - values,
        )
        by_x, promise = follow(gram, normal, self.weight, offset, by_p)
        pulled = float(by_p @ (2 * slope - self.pull @ by_p))
        return by_p, by_x, np.append(promise, pulled)

    def is_done(self, fit, step, small, prune_above) -> bool:
        """Return whether the linear model predicts a small or an insufficient decrease.

        The undamped step promises no less than the damped one, so it is asked only if that is not
        enough.
        """

        def is_enough(promise) -> bool:
            return promise > small and not fit.objective - OPTIMISM * promise > prune_above

        return not (
            is_enough(step.promise.sum()) or is_enough(self._change(fit, UNDAMPED)[2].sum())
        )

    def take(self, fit, step, small) -> WindowFit:
        """Take a step; windows that it harms keep their initial state where that is better."""
        new = self.at(step.model, step.x0)
        harmed = np.flatnonzero(~(new.parts - fit.parts < small)[:-1])
        if not harmed.size:
            return new
        windows, expected = self.windows.select(harmed), self.expected[harmed]
        part = _Task(windows, self.freedoms, expected, self.weight, self.pull)
        is_known = np.array_equal(new.values, fit.values)
        known = fit.evaluation.select(harmed) if is_known else None
        stay = part.at(step.model, fit.x0[harmed], known)
        better = stay.parts[:-1] < new.parts[harmed]
        which, x0 = harmed[better], new.x0.copy()
        x0[which] = stay.x0[better]
        evaluation = new.evaluation.replaced(self.windows, which, stay.evaluation, better)
        return self.at(step.model, x0, evaluation)


def expected_decrease(
    fit: WindowFit, windows: ShootingWindows, expected: np.ndarray, spread: np.ndarray
) -> float:
    """Return the further decrease of the objective that a linear model predicts."""
    if not np.isfinite(fit.objective):
        return 0.0
    task = _Task(windows, fit.freedoms, expected, 1.0 / spread**2)
    decrease = float(task.step(fit, UNDAMPED).promise.sum())
    return decrease if decrease <= fit.objective else 0.0


def prior_precision(freedoms: tuple[ParameterPrior, ...]) -> np.ndarray:
    """Return the inverse covariance of parameters by their priors."""
    return np.diag(1.0 / _column(freedoms, "spread") ** 2)


def _column(freedoms, attribute) -> np.ndarray:
    return np.array([getattr(freedom, attribute) for freedom in freedoms], dtype=float)


def _values(model, freedoms) -> np.ndarray:
    return np.array([model.parameters[f.name].value for f in freedoms], dtype=float)
