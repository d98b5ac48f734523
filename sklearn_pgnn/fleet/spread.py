"""A quantity over all machines: the usual value, the spread between machines, and odd machines."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import t as student

#: half-width of a 95 % interval in standard errors
WIDTH = float(norm.ppf(0.975))
#: fewest machines of which one may be odd
FEWEST = 3


@dataclass(frozen=True)
class ParameterSpread:
    r"""A parameter over the machines of a fleet.

    A machine is odd by the generalised extreme studentised deviate [1]_: each of :math:`n`
    estimates :math:`v_i` with standard errors :math:`s_i` is compared with the mean :math:`m` and
    the variance :math:`S^2` of the others, which is not below the power :math:`\bar s^2` of their
    errors,

    .. math:: t_i = \frac{v_i - m}{\sqrt{\max(S^2, \bar s^2)\, n / (n - 1) +
        \max(0, s_i^2 - \bar s^2)}},

    by Student's distribution with :math:`n - 2` degrees of freedom, for the largest of :math:`n`.
    The farthest is set aside and the rest is looked at again, up to less than half of them, so that
    several odd ones do not hide each other. The spread between the machines that are alike is what
    their variance exceeds their errors by, :math:`\tau^2 = \max(0, S^2 - \bar s^2)`.

    Parameters
    ----------
    name, unit : str
        The parameter.
    prior, usual, spread : float
        Value of the given model, median over the machines, and :math:`\tau` [unit].
    shared : bool
        Whether one value fits all machines that are not odd, within their intervals.
    values : dict of str to tuple of float
        By machine the value and the ends of its 95 % interval [unit].
    odd : dict of str to float
        The machines that are unlike the others, each with the probability of a value so far off on
        a machine that is like them.

    References
    ----------
    .. [1] B. Rosner, "Percentage points for a generalized ESD many-outlier procedure",
       Technometrics 25(2), 1983, :doi:`10.1080/00401706.1983.10487848`.

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
    """Compare a parameter over the machines; None where no machine has an estimate."""
    told = {m: e for m, e in found.items() if e["value"] is not None}
    if not told:
        return None
    first = next(iter(told.values()))
    values = np.array([e["value"] for e in told.values()], dtype=float)
    errors = np.array([standard_error(e["low"], e["high"]) for e in told.values()])
    known = np.isfinite(errors)
    usual = float(np.median(values[known] if known.any() else values))
    machines = [machine for machine, is_known in zip(told, known, strict=True) if is_known]
    values, errors = values[known], errors[known]
    odd = _odd(values, errors, rate)
    alike = np.setdiff1d(np.arange(values.size), [*odd])
    spread, shared = _between(values[alike], errors[alike], rate)
    intervals = {m: _interval(e) for m, e in told.items()}
    unlike = {machines[i]: chance for i, chance in odd.items()}
    prior = math.nan if first.get("prior") is None else float(first["prior"])
    return ParameterSpread(name, first["unit"], prior, usual, spread, shared, intervals, unlike)


def _odd(values: np.ndarray, errors: np.ndarray, rate: float) -> dict[int, float]:
    """Return the odd ones of some estimates, each with the probability of one so far off."""
    rest = alike = np.arange(values.size)
    while rest.size >= max(FEWEST, values.size // 2 + 2):
        chances = _chances(values[rest], errors[rest])
        first = int(np.argmin(chances))
        rest, is_odd = np.delete(rest, first), chances[first] * rest.size < rate
        alike = rest if is_odd else alike
    odd = np.setdiff1d(np.arange(values.size), alike).tolist()
    beside = [np.append(i, alike) for i in odd]
    return {i: float(_chances(values[b], errors[b])[0]) for i, b in zip(odd, beside, strict=True)}


def _chances(values: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Return for every estimate the probability of one so far from the others."""
    n = values.size
    mean, power = _without_each(values), _without_each(errors**2)
    square = (_without_each(values**2) - mean**2) * (n - 1) / (n - 2)
    size = np.maximum(square, power) * n / (n - 1) + np.maximum(errors**2 - power, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.nan_to_num(np.abs(values - mean) / np.sqrt(size), nan=0.0)
    return 2 * student.sf(far, n - 2)


def _without_each(values: np.ndarray) -> np.ndarray:
    """Return the mean of all but one, for every one."""
    return (values.sum() - values) / (values.size - 1)


def _between(values: np.ndarray, errors: np.ndarray, rate: float) -> tuple[float, bool]:
    """Return the spread between machines, and whether one value fits them all."""
    if values.size < 2:
        return 0.0, True
    spread = math.sqrt(max(0.0, float(np.var(values, ddof=1) - np.mean(errors**2))))
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = np.where(errors > 0, errors, np.finfo(float).tiny) ** -2.0
        squares = np.sum(weights * (values - np.average(values, weights=weights)) ** 2)
    return spread, bool(chi2.sf(squares, values.size - 1) > rate)


def standard_error(low: float | None, high: float | None) -> float:
    """Return the standard error of a 95 % interval; infinite where one of its ends is open."""
    return math.inf if low is None or high is None else (high - low) / 2 / WIDTH


def first_ones(chances: Sequence[float] | np.ndarray, rate: float) -> np.ndarray:
    r"""Select the significant ones among many p-values, by the Benjamini-Hochberg procedure.

    At most the share `rate` of the selected ones is expected to be due to chance alone: of the
    sorted values, the largest :math:`k` with :math:`p_{(k)} \le k\,\text{rate}/n` and all below it.
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
