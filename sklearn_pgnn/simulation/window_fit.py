r"""Fit parameters to windows, every window's initial state projected out.

With the residuals :math:`r_w` of window :math:`w`, its initial state :math:`x_w`, the parameters
:math:`p` and their Gaussian priors, the minimum of

.. math:: \sum_w |r_w(p, x_w)|^2 + \sum_w |(x_w - \hat x_w)/\sigma_x|^2
          + \sum_i ((p_i - \bar p_i)/\sigma_i)^2

is found by Levenberg-Marquardt steps within bounds. The initial states are eliminated window by
window, so a step solves one small bounded least-squares problem.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.windows import Evaluation, Windows, evaluate


@dataclass(frozen=True)
class Freedom:
    """How far a parameter may go in a fit.

    Parameters
    ----------
    name : str
        The parameter.
    low, high : float
        Bounds.
    centre, spread : float
        Mean and standard deviation of its Gaussian prior; an infinite spread means none.
    scale : float
        A typical size of a change.
    """

    name: str
    low: float
    high: float
    centre: float
    spread: float
    scale: float


@dataclass(frozen=True)
class WindowFit:
    """A model fitted to windows.

    Parameters
    ----------
    model : PhysicsModel
        The model at the fitted values.
    freedoms : tuple of Freedom
        What was free.
    x0 : ndarray of shape (n_windows, n_states)
        Fitted initial states.
    evaluation : Evaluation
        Residuals and gradients at the fit.
    objective : float
        The minimum.
    """

    model: PhysicsModel
    freedoms: tuple[Freedom, ...]
    x0: np.ndarray
    evaluation: Evaluation
    objective: float

    @property
    def squares(self) -> float:
        """Sum of squared residuals in units of the noise."""
        return float(self.evaluation.squares.sum())

    @property
    def values(self) -> np.ndarray:
        """Fitted values of the free parameters."""
        return _values(self.model, self.freedoms)


@dataclass(frozen=True)
class Normal:
    """Normal equations of the parameters with the initial states projected out, per window."""

    hessian: np.ndarray
    gradient: np.ndarray
    to_state: np.ndarray
    state_step: np.ndarray


def fit_windows(
    model: PhysicsModel,
    windows: Windows,
    freedoms: tuple[Freedom, ...],
    x0: np.ndarray,
    x0_spread: np.ndarray,
    *,
    x0_start: np.ndarray | None = None,
    max_steps: int = 25,
    tolerance: float = 1e-5,
) -> WindowFit:
    """Fit a model's parameters and every window's initial state.

    Parameters
    ----------
    model : PhysicsModel
        The model; its values are the start.
    windows : Windows
        The windows.
    freedoms : tuple of Freedom
        The parameters to fit.
    x0 : ndarray of shape (n_windows, n_states)
        Expected initial states.
    x0_spread : ndarray of shape (n_states,)
        How uncertain they are.
    x0_start : ndarray of shape (n_windows, n_states), optional
        Where the initial states start; by default where they are expected.
    max_steps : int, default=25
        Largest number of steps.
    tolerance : float, default=1e-5
        Relative decrease of the objective at which the fit ends.

    Returns
    -------
    WindowFit
        The fit; its objective is infinite if the start itself diverges.
    """
    wrt = tuple(freedom.name for freedom in freedoms)
    expected, weight = x0, 1.0 / x0_spread**2
    x0 = expected if x0_start is None else x0_start
    centre, spread = _column(freedoms, "centre"), _column(freedoms, "spread")
    low, high = _column(freedoms, "low"), _column(freedoms, "high")
    model = _with_values(model, freedoms, np.clip(_values(model, freedoms), low, high))

    def objective(candidate, states, squares):
        pull = ((_values(candidate, freedoms) - centre) / spread) ** 2
        return squares.sum() + pull.sum() + (weight * (states - expected) ** 2).sum()

    evaluation = evaluate(model, windows, x0, wrt)
    best = objective(model, x0, evaluation.squares)
    if not np.isfinite(best):
        return WindowFit(model, freedoms, x0, evaluation, np.inf)
    damping = 1e-3
    for _ in range(max_steps):
        values = _values(model, freedoms)
        improved = False
        for _ in range(8):
            normal = project(evaluation.gram, len(wrt), weight, x0 - expected, damping)
            hessian = normal.hessian.sum(0) + np.diag(1.0 / spread**2)
            gradient = normal.gradient.sum(0) - (values - centre) / spread**2
            step = _bounded_step(hessian, gradient, damping, low - values, high - values)
            new_x0 = x0 + normal.state_step - normal.to_state @ step
            candidate = _with_values(model, freedoms, np.clip(values + step, low, high))
            new = evaluate(candidate, windows, new_x0, wrt)
            value = objective(candidate, new_x0, new.squares)
            if value < best:
                improved = True
                break
            damping *= 10.0
        if not improved:
            break
        decrease = (best - value) / best
        model, x0, evaluation, best = candidate, new_x0, new, value
        damping = max(damping / 10.0, 1e-9)
        if decrease < tolerance:
            break
    return WindowFit(model, freedoms, x0, evaluation, float(best))


def project(
    gram: np.ndarray, n_p: int, weight: np.ndarray, offset: np.ndarray, damping: float = 0.0
) -> Normal:
    """Eliminate every window's initial state from its normal equations.

    Parameters
    ----------
    gram : ndarray of shape (n_windows, q + 1, q + 1)
        Products of the columns ``[dy/dp, dy/dx0, residual]``.
    n_p : int
        Number of parameters.
    weight : ndarray of shape (n_states,)
        Inverse variances of the initial states.
    offset : ndarray of shape (n_windows, n_states)
        Initial states minus their expectation.
    damping : float, default=0
        Levenberg-Marquardt damping of the initial states.

    Returns
    -------
    Normal
        Hessian and gradient per window, and how the initial states follow the parameters.
    """
    p, x = slice(0, n_p), slice(n_p, gram.shape[1] - 1)
    state_hessian = gram[:, x, x] + np.diag(weight)
    state_gradient = gram[:, x, -1] - weight * offset
    size = np.sqrt(np.einsum("wii->wi", state_hessian))
    size = np.where(size > 0, size, 1.0)
    scaled = state_hessian / (size[:, :, None] * size[:, None, :])
    scaled = scaled + damping * np.eye(size.shape[1])
    inverse = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True)
    inverse = inverse / (size[:, :, None] * size[:, None, :])
    to_state = inverse @ gram[:, x, p]
    state_step = np.einsum("wij,wj->wi", inverse, state_gradient)
    hessian = gram[:, p, p] - gram[:, p, x] @ to_state
    gradient = gram[:, p, -1] - np.einsum("wpx,wx->wp", gram[:, p, x], state_step)
    return Normal(hessian, gradient, to_state, state_step)


def expected_decrease(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> float:
    """Tell by how much a linear model of the residuals would lower the objective further.

    Parameters
    ----------
    fit : WindowFit
        A fit, not at its minimum.
    expected : ndarray of shape (n_windows, n_states)
        Expected initial states.
    spread : ndarray of shape (n_states,)
        How uncertain they are.

    Returns
    -------
    float
        Decrease of the sum of squares; zero where the fit diverged.
    """
    if not np.isfinite(fit.objective):
        return 0.0
    n_p, weight = len(fit.freedoms), 1.0 / spread**2
    normal = project(fit.evaluation.gram, n_p, weight, fit.x0 - expected)
    pull = 1.0 / _column(fit.freedoms, "spread") ** 2
    hessian, gradient = normal.hessian.sum(0) + np.diag(pull), normal.gradient.sum(0)
    step = _bounded_step(hessian, gradient, 1e-6, np.full(n_p, -np.inf), np.full(n_p, np.inf))
    return float(gradient @ step)


def _bounded_step(hessian, gradient, damping, low, high):
    """Solve the damped normal equations within bounds."""
    if gradient.size == 0:
        return gradient
    size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / np.outer(size, size) + damping * np.eye(size.size)
    values, vectors = np.linalg.eigh(scaled)
    root = np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    matrix = root[:, None] * vectors.T
    target = (vectors.T @ (gradient / size)) / root
    lower, upper = np.minimum(low * size, -1e-15), np.maximum(high * size, 1e-15)
    return lsq_linear(matrix, target, bounds=(lower, upper), method="bvls").x / size


def _column(freedoms, attribute) -> np.ndarray:
    return np.array([getattr(freedom, attribute) for freedom in freedoms], dtype=float)


def _values(model, freedoms) -> np.ndarray:
    return np.array([model.parameters[f.name].value for f in freedoms], dtype=float)


def _with_values(model, freedoms, values) -> PhysicsModel:
    changes = {f.name: float(v) for f, v in zip(freedoms, values, strict=True)}
    return model.with_parameters(**changes)
