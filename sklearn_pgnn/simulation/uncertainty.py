"""Uncertainty of fitted parameters: standard errors and 95 % intervals."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.normal_equations import Normal, normal_equations, project
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, prior_precision
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate

#: half-width of a 95 % interval in standard errors
NORMAL_95 = 1.96
#: curvature along a direction, relative to the sharpest, below which it is rounding; and the
#: share of a parameter in such a direction from which on it counts as not fixed
FLAT, SHARE = 1e-10, 1e-3
#: share of the information on a direction that outputs give, below which only the expected initial
#: states tell it
LOST = 1e-6


def rounded(value: Any) -> str:
    """Return a value as text, its numbers with four digits."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k!r}: {rounded(v)}" for k, v in value.items()) + "}"
    return f"{value:.4g}" if isinstance(value, float) else repr(value)


class Rounded:
    """A dataclass that shows numbers with four digits, and none that is not a number."""

    def __repr__(self) -> str:
        values = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        given = (f"{name}={rounded(value)}" for name, value in values.items() if value == value)
        return f"{type(self).__name__}({', '.join(given)})"


@dataclass(frozen=True, repr=False)
class Estimate(Rounded):
    """A parameter's value with its 95 % interval.

    Parameters
    ----------
    value, low, high : float
        Estimate and interval [unit].
    unit : str
        Its unit.

    Examples
    --------
    >>> friction = Estimate(0.031, 0.028, 0.034, "N m")
    >>> friction
    Estimate(value=0.031, low=0.028, high=0.034, unit='N m')
    """

    value: float
    low: float
    high: float
    unit: str = ""


def estimate_of(model: PhysicsModel, name: str, errors: Mapping[str, float]) -> Estimate:
    """Return a parameter's value and interval, kept within its bounds."""
    parameter = model.parameters[name]
    reach = NORMAL_95 * errors.get(name, 0.0)
    low, high = parameter.bounds
    return Estimate(
        parameter.value,
        float(max(low, parameter.value - reach)),
        float(min(high, parameter.value + reach)),
        parameter.unit,
    )


def standard_errors(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> dict[str, float]:
    r"""Return the parameters' standard errors, robust to residuals that are not white.

    .. math:: \mathrm{cov} = H^{-1} \left(\frac{W}{W - n} \sum_w g_w g_w^T + P\right) H^{-1}

    with the Hessian :math:`H`, the gradients :math:`g_w` of the :math:`W` blocks of the windows,
    and the inverse variances :math:`P` of the parameters' priors; never less than the
    :math:`H^{-1}` of white noise, since there may be few blocks.

    .. [1] H. White, "Maximum likelihood estimation of misspecified models", Econometrica 50,
       1982, :doi:`10.2307/1912526`.
    """
    names = [freedom.name for freedom in fit.freedoms]
    if not names:
        return {}
    if not fit.usable:
        return dict.fromkeys(names, np.inf)
    found = _curvature(fit, expected, spread)
    variances = np.maximum(found.variances, np.diag(found.inverse))
    errors = np.where(found.flat, np.inf, np.sqrt(variances))
    return dict(zip(names, errors.tolist(), strict=True))


def rests_on_starts(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> bool:
    r"""Return whether only the expected initial states tell a direction of the parameters.

    .. math:: v^T H_\infty v \le \varepsilon\, v^T H v

    for an eigenvector :math:`v` of the Hessian with free initial states, :math:`H_\infty`: a state
    that is not measured, and the parameters with it, may then have another unit.
    """
    normal = normal_equations(fit, expected, spread).hessian.sum(axis=0)
    free = normal_equations(fit, expected, np.full(spread.shape, np.inf)).hessian.sum(axis=0)
    size = np.sqrt(np.where(np.diag(normal) > 0, np.diag(normal), 1.0))
    told, vectors = np.linalg.eigh(free / np.outer(size, size))
    anchored = np.einsum("ij,ik,kj->j", vectors, normal / np.outer(size, size), vectors)
    return bool(((told <= LOST * anchored) & (anchored > FLAT * anchored.max(initial=0.0))).any())


def trusted_spread(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return the spread of the initial states, infinite where they would settle a direction."""
    alone = fit.usable and fit.freedoms and rests_on_starts(fit, expected, spread)
    return np.full(spread.shape, np.inf) if alone else spread


def parameter_covariance(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> np.ndarray:
    r"""Return the covariance of the parameters, in the directions that the records determine.

    .. math:: C_{ij} = r_{ij} \sigma_i \sigma_j

    with the standard errors of `standard_errors` and the `correlations`; zero in rows and columns
    of parameters that the records do not determine: no simulation of such records depends on them.
    """
    errors = np.array(list(standard_errors(fit, expected, spread).values()))
    related = correlations(fit, expected, spread)
    seen = np.isfinite(errors) & np.isfinite(np.diag(related))
    size = np.where(seen, errors, 0.0)
    return np.where(np.outer(seen, seen), related, 0.0) * np.outer(size, size)


def correlations(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> np.ndarray:
    r"""Return how the errors of a fit's parameters are correlated.

    .. math:: r_{ij} = \mathrm{cov}_{ij} / \sqrt{\mathrm{cov}_{ii}\,\mathrm{cov}_{jj}}

    with the covariance of `standard_errors`.
    """
    n_p = len(fit.freedoms)
    if not (n_p and fit.usable):
        return np.full((n_p, n_p), np.nan)
    found = _curvature(fit, expected, spread)
    size = np.where(found.flat | ~(found.variances > 0), np.nan, np.sqrt(found.variances))
    return found.covariance / np.outer(size, size)


def curvatures(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> dict[str, float]:
    r"""Return the curvature of the objective along every parameter, the others adapting to it.

    .. math:: c_i = 1 / [H^{-1}]_{ii}
    """
    names = [freedom.name for freedom in fit.freedoms]
    if not (names and fit.usable):
        return dict.fromkeys(names, 0.0)
    found = _curvature(fit, expected, spread)
    variances = np.diag(found.inverse)
    seen = ~found.flat & (variances > 0)
    values = np.where(seen, 1.0 / np.where(seen, variances, 1.0), 0.0)
    return dict(zip(names, values.tolist(), strict=True))


def overdispersion(
    fit: WindowFit, expected: np.ndarray, spread: np.ndarray, dispersion: float
) -> dict[str, float]:
    r"""Return by how much the parameters' variances exceed those that residuals alone explain.

    .. math:: \phi_i = \frac{[H^{-1} (\frac{W}{W - n} \sum_w g_w g_w^T + P) H^{-1}]_{ii}}
              {[H^{-1} (d\,(H - P) + P) H^{-1}]_{ii}}

    with the symbols of `standard_errors` and the dispersion :math:`d`, the residuals' power times
    their autocorrelation time. An external disturbance is larger along the motion that it excites:
    there the residuals carry less information than their autocorrelation suggests.
    """
    names = [freedom.name for freedom in fit.freedoms]
    if not (names and fit.usable):
        return dict.fromkeys(names, 1.0)
    found = _curvature(fit, expected, spread)
    meat = dispersion * found.hessian + found.pull
    explained = np.diag(found.inverse @ meat @ found.inverse)
    ratio = found.variances / np.where(explained > 0, explained, np.inf)
    return dict(zip(names, np.maximum(ratio, 1.0).tolist(), strict=True))


class _Curvature(NamedTuple):
    """The curvature of a fit's objective, and the parameters' covariance."""

    hessian: np.ndarray
    pull: np.ndarray
    inverse: np.ndarray
    flat: np.ndarray
    covariance: np.ndarray

    @property
    def variances(self) -> np.ndarray:
        """Of the parameters."""
        return np.diag(self.covariance)


def _curvature(fit: WindowFit, expected: np.ndarray, spread: np.ndarray) -> _Curvature:
    """Return the curvature at a fit, and a covariance that is robust to coloured residuals."""
    normal, pull = normal_equations(fit, expected, spread), prior_precision(fit.freedoms)
    hessian, scores = normal.hessian.sum(axis=0), _block_scores(fit, normal)
    inverse, flat = invert(hessian + pull)
    factor = len(scores) / max(len(scores) - len(fit.freedoms), 1)
    covariance = inverse @ (scores.T @ scores * factor + pull) @ inverse
    return _Curvature(hessian, pull, inverse, flat, covariance)


def errors_by_held(
    fit: WindowFit,
    windows: ShootingWindows,
    held: tuple[ParameterPrior, ...],
    expected: np.ndarray,
    spread: np.ndarray,
) -> dict[str, float]:
    r"""Return the standard errors due to parameters that were held fixed in a fit.

    A held parameter :math:`q` would move the others by :math:`-H_{pp}^{-1} H_{pq}` for each of its
    units.
    """
    names, n_p = [freedom.name for freedom in fit.freedoms], len(fit.freedoms)
    wrt = (*names, *(freedom.name for freedom in held))
    there = evaluate(fit.model, windows, fit.x0, wrt)
    if not np.isfinite(there.squares).all():
        return dict.fromkeys(names, np.inf)
    hessian = project(there.gram, len(wrt), 1.0 / spread**2, fit.x0 - expected).hessian.sum(axis=0)
    inverse, _ = invert(hessian[:n_p, :n_p] + prior_precision(fit.freedoms))
    moved = inverse @ hessian[:n_p, n_p:] * np.array([freedom.spread for freedom in held])
    return dict(zip(names, np.sqrt((moved**2).sum(axis=1)).tolist(), strict=True))


def _block_scores(fit: WindowFit, normal: Normal) -> np.ndarray:
    """Return every block's gradient with the initial state of its window projected out."""
    n_p, gram = len(fit.freedoms), fit.evaluation.block_gram
    by_parameter, by_state = gram[:, :, :n_p, -1], gram[:, :, n_p:-1, -1]
    scores = by_parameter - np.einsum("wxp,wjx->wjp", normal.to_state, by_state)
    scores = scores.reshape(-1, n_p)
    return scores - scores.mean(axis=0)


def propagated_variance(slopes: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    r"""Return the variance of simulated outputs due to errors in the quantities they depend on.

    .. math:: \sigma_k^2 = \frac{\partial \hat y_k}{\partial p} C
              \left(\frac{\partial \hat y_k}{\partial p}\right)^T

    >>> propagated_variance(np.array([[[2.0, 0.0]], [[1.0, 1.0]]]), np.eye(2)).ravel().tolist()
    [4.0, 2.0]
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return np.einsum("kop,pq,koq->ko", slopes, covariance, slopes)


def invert(hessian: np.ndarray):
    """Invert a Hessian where it is not flat, and name the parameters that lie where it is.

    Return the inverse, zero along flat directions, and for every parameter whether it lies in one.
    """
    blind = ~(np.diag(hessian) > 0)
    size = np.sqrt(np.where(blind, 1.0, np.diag(hessian)))
    values, vectors = np.linalg.eigh(hessian / np.outer(size, size))
    is_flat = values <= FLAT * values[-1]
    inverse = (vectors / np.where(is_flat, np.inf, values)) @ vectors.T
    flat = blind | (np.abs(vectors[:, is_flat]) > SHARE).any(axis=1)
    return inverse / np.outer(size, size), flat
