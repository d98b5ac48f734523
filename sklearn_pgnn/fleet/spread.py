"""A quantity over all machines: the usual value, the spread between machines, and odd machines."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

#: half-width of a 95 % interval in standard errors, and a standard deviation in median deviations
WIDTH, DEVIATION = float(norm.ppf(0.975)), 1.0 / float(norm.ppf(0.75))
#: fewest machines that make a fleet, of which one may be odd
FEWEST = 5


@dataclass(frozen=True)
class ParameterSpread:
    r"""A parameter over the machines of a fleet.

    With the estimates :math:`v_i` and their standard errors :math:`s_i`, the usual value is the
    median :math:`c`, and the spread between machines is the part beyond the estimates' own errors:

    .. math:: \tau^2 = \max(0,\ (1.48\ \mathrm{med}|v_i - c|)^2 - \mathrm{med}\,s_i^2),
        \qquad z_i = \frac{v_i - c}{\sqrt{\tau^2 + s_i^2}}

    Parameters
    ----------
    name, unit : str
        The parameter.
    prior, usual, spread : float
        Value of the given model, median over the machines, and :math:`\tau` [unit].
    shared : bool
        Whether one value fits all machines, within their intervals.
    values : dict of str to tuple of float
        By machine the value and the ends of its 95 % interval [unit].
    odd : dict of str to float
        The machines that are unlike the others, each with the probability of a value so far off on
        a machine that is like them.

    Examples
    --------
    >>> def kg(value):
    ...     return dict(value=value, low=value - 0.1, high=value + 0.1, prior=2.0, unit="kg")
    >>> masses = {"a": 2.0, "b": 2.02, "c": 1.98, "d": 2.01, "e": 2.9, "f": 1.99}
    >>> mass = spread_of("m", {name: kg(value) for name, value in masses.items()}, 0.01)
    >>> mass.usual, mass.unit, list(mass.odd)
    (2.005, 'kg', ['e'])
    """

    name: str
    unit: str
    prior: float
    usual: float
    spread: float
    shared: bool
    values: Mapping[str, tuple[float, float, float]]
    odd: Mapping[str, float]


def spread_of(name: str, found: Mapping[str, Mapping], rate: float) -> ParameterSpread | None:
    """Compare a parameter over the machines.

    Parameters
    ----------
    name : str
        The parameter.
    found : mapping of str to mapping
        By machine its estimate: ``value``, ``low``, ``high``, ``prior`` and ``unit``.
    rate : float
        Largest expected share of false ones among the machines that are called odd.

    Returns
    -------
    ParameterSpread or None
        None where no machine has an estimate.

    Examples
    --------
    >>> def kg(value):
    ...     return dict(value=value, low=value - 0.1, high=value + 0.1, prior=2.0, unit="kg")
    >>> masses = {"a": 2.0, "b": 2.02, "c": 1.98, "d": 2.01, "e": 2.9, "f": 1.99}
    >>> mass = spread_of("m", {name: kg(value) for name, value in masses.items()}, 0.01)
    >>> mass.usual, list(mass.odd)
    (2.005, ['e'])
    """
    told = {m: e for m, e in found.items() if e["value"] is not None}
    if not told:
        return None
    first = next(iter(told.values()))
    values = np.array([e["value"] for e in told.values()], dtype=float)
    errors = np.array([standard_error(e["low"], e["high"]) for e in told.values()])
    known = np.isfinite(errors)
    usual = float(np.median(values[known] if known.any() else values))
    apart = values - usual
    spread, shared, odd = 0.0, True, {}
    if known.sum() >= FEWEST:
        middle = DEVIATION * np.median(np.abs(apart[known]))
        spread = math.sqrt(max(0.0, middle**2 - float(np.median(errors[known] ** 2))))
        with np.errstate(divide="ignore", invalid="ignore"):
            squares = np.nansum((apart[known] / errors[known]) ** 2)
            chances = 2 * norm.sf(np.abs(apart) / np.hypot(spread, errors))
        shared = bool(chi2.sf(squares, known.sum() - 1) > rate)
        chances[~known] = np.nan
        told_odd = first_ones(chances, rate)
        odd = {m: float(p) for m, p, o in zip(told, chances, told_odd, strict=True) if o}
    intervals = {m: _interval(e) for m, e in told.items()}
    return ParameterSpread(
        name, first["unit"], _or_nan(first.get("prior")), usual, spread, shared, intervals, odd
    )


def standard_error(low: float | None, high: float | None) -> float:
    """Return the standard error of a 95 % interval; infinite where one of its ends is open.

    Examples
    --------
    >>> round(standard_error(-1.96, 1.96), 3)
    1.0
    """
    return math.inf if low is None or high is None else (high - low) / 2 / WIDTH


def first_ones(chances: Sequence[float] | np.ndarray, rate: float) -> np.ndarray:
    r"""Select the significant ones among many p-values, by the Benjamini-Hochberg procedure.

    At most the share `rate` of the selected ones is expected to be due to chance alone: of the
    sorted values, the largest :math:`k` with :math:`p_{(k)} \le k\,\text{rate}/n` and all below it.

    Parameters
    ----------
    chances : array-like of shape (n,)
        Probabilities of so large a difference by chance; NaN is never chosen.
    rate : float
        The share.

    Returns
    -------
    ndarray of bool of shape (n,)
        Whether each is chosen.

    Examples
    --------
    >>> first_ones([0.5, 0.001, 0.04, 0.9], 0.05).tolist()
    [False, True, False, False]
    """
    chances = np.asarray(chances, dtype=float)
    known = np.sort(chances[np.isfinite(chances)])
    if not known.size:
        return np.zeros(chances.shape, dtype=bool)
    below = known <= rate * np.arange(1, known.size + 1) / known.size
    if not below.any():
        return np.zeros(chances.shape, dtype=bool)
    with np.errstate(invalid="ignore"):
        return chances <= known[np.flatnonzero(below)[-1]]


def _interval(estimate: Mapping) -> tuple[float, float, float]:
    low, high = estimate["low"], estimate["high"]
    return (
        float(estimate["value"]),
        -math.inf if low is None else float(low),
        math.inf if high is None else float(high),
    )


def _or_nan(value) -> float:
    return math.nan if value is None else float(value)
