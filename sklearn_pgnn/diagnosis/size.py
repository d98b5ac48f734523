"""How accurately records determine the sizes of causes."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import t as student

from sklearn_pgnn.estimation.budgets import FINENESS, MUCH
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.freedoms import held_freedoms
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.residuals import Residuals
from sklearn_pgnn.estimation.window_fitter import WindowFitter
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.effects.differences import mark_at, parsed
from sklearn_pgnn.simulation.uncertainty import (
    NORMAL_95,
    curvatures,
    errors_by_held,
    overdispersion,
    parameter_covariance,
    standard_errors,
    trusted_spread,
)
from sklearn_pgnn.trajectories.grid import step_of


def parameter_errors(problem: EstimationProblem, trial: FittedHypothesis) -> dict[str, float]:
    """Return the parameters' standard errors, including the uncertainty of those held by causes.

    They are scaled so that 1.96 of them make a 95 % interval by Student's t-distribution, with the
    number of blocks less that of the parameters as its degrees of freedom. Where only the expected
    values of states that are not measured tell a direction, these do not count.
    """
    fit, expected = trial.fit, _expected_starts(problem, trial)
    expected = expected[0], trusted_spread(fit, *expected)
    blocks = len(problem.windows) * problem.windows.blocks
    wider = student.ppf(0.975, max(blocks - len(fit.freedoms), 1)) / NORMAL_95
    errors = {name: wider * e for name, e in standard_errors(fit, *expected).items()}
    held = tuple(f for f in held_freedoms(problem, trial.hypothesis) if f.name not in errors)
    if not held or not fit.usable:
        return errors
    more = errors_by_held(fit, problem.windows, held, *expected)
    return {name: math.hypot(error, more[name]) for name, error in errors.items()}


def likelihood_intervals(
    fitter: WindowFitter, trial: FittedHypothesis, errors: Mapping[str, float]
) -> dict[str, tuple[float, float]]:
    r"""Return the 95 % intervals of parameters, widened by profile likelihood where needed.

    Where the objective is a parabola of curvature :math:`c`, an interval ends at
    :math:`\pm 1.96 \sigma`, where the objective has risen by :math:`c (1.96 \sigma)^2`. For a limit
    that the records hardly reach it rises by less: there the interval is extended until it has
    risen by as much, with all other parameters and the initial states fitted again.
    """
    sharp = curvatures(trial.fit, *_expected_starts(fitter.problem, trial))
    return {
        name: _likelihood_interval(fitter, trial, name, error, sharp[name])
        for name, error in errors.items()
    }


def _likelihood_interval(
    fitter: WindowFitter, trial: FittedHypothesis, name: str, error: float, curvature: float
) -> tuple[float, float]:
    fit = trial.fit
    (free,) = (freedom for freedom in fit.freedoms if freedom.name == name)
    value, bounds = fit.model.parameters[name].value, fit.model.parameters[name].bounds
    if not math.isfinite(error):
        return bounds
    cost, ends = curvature * (NORMAL_95 * error) ** 2, []
    for side, limit, bound in zip((-1, 1), (free.low, free.high), bounds, strict=True):
        reach, further = NORMAL_95 * error, 2.0
        while further > 1.0 + FINENESS and side * (limit - value) > reach:
            rise = fitter.rise(trial, name, value + side * reach, FINENESS * cost)
            further = math.sqrt(cost / max(rise, cost / 4.0)) if cost > 0.0 else 1.0
            reach *= max(further, 1.0)
        is_open = side * (limit - value) <= reach
        ends.append(bound if is_open else float(value + side * reach))
    return min(ends), max(ends)


def onset_interval(
    fitter: WindowFitter, trial: FittedHypothesis, column: str
) -> tuple[float, float]:
    r"""Return the 95 % interval of the time [s] from which on a column is one, or grows to it.

    It holds the onsets :math:`\tau` with which the objective, fitted again, is

    .. math:: S(\tau) \le S(\hat\tau) + c\,s, \qquad (1 - e^{-c/2})^2 = 0.95,

    with the dispersion :math:`s` of the residuals: the objective has a corner at an onset, so that
    its rise has another distribution than that of a parameter [1]_, which an even growth has.
    Between two samples an onset may lie anywhere.

    .. [1] B. E. Hansen, "Sample splitting and threshold estimation", Econometrica 68(3), 2000,
       :doi:`10.1111/1468-0262.00124`.
    """
    problem, windows, fit = fitter.problem, fitter.problem.windows, trial.fit
    place = list(problem.prior.inputs).index(column)
    record = windows.record_at(np.arange(len(windows.t)))
    marked, (*_, until) = windows.u[:, place] > 0.0, parsed(column)
    is_in = np.isin(record, record[marked])
    times = np.unique(windows.t[is_in])
    dispersion = max(fit.objective / problem.n_samples, 1.0)
    rise = NORMAL_95**2 if until is not None else -2.0 * math.log(1.0 - math.sqrt(0.95))
    most = fit.objective + rise * dispersion

    def is_possible(k: int) -> bool:
        u = windows.u.copy()
        u[:, place] = is_in * mark_at(windows.t, times[k], until)
        moved = replace(windows, u=u)
        return fitter.objective_with(trial, fit.model, moved, fit.freedoms) <= most

    grows = until is not None  # it is zero at its onset
    here = int(np.searchsorted(times, windows.t[marked].min())) - grows
    low, high = (_last(is_possible, here, end) for end in (0, len(times) - 1 - grows))
    return float(times[max(low - 1, 0)]), float(times[high + grows])


def _last(is_possible: Callable[[int], bool], here: int, end: int) -> int:
    """Return the last possible place on the way from one that is towards an end."""
    near, reach, side = here, 1, 1 if end > here else -1
    while near != end:
        far = here + side * min(reach, abs(end - here))
        if not is_possible(far):
            break
        near, reach = far, 2 * reach
    else:
        return end
    while abs(far - near) > 1:
        middle = (near + far) // 2
        near, far = (middle, far) if is_possible(middle) else (near, middle)
    return near


def differs_from_none(
    problem: EstimationProblem, trial: FittedHypothesis, cause: Effect, alpha: float
) -> bool:
    r"""Return whether a cause's size differs from zero, by a Wald test of all its sizes.

    .. math:: s^T C^{-1} s > \chi^2_{n, 1 - \alpha}

    with the :math:`n` fitted sizes :math:`s` and their covariance :math:`C`, robust to coloured
    residuals. The position of a limit, such as a saturation, is no size. A cause of zero size may
    reduce to a special case of it, as play reduces to a lag: the size of that counts, too.
    """
    sizes = {cause.names()[field] for field in _size_fields(cause)}
    names = [free.name for free in trial.fit.freedoms]
    own = np.array([name in sizes for name in names])
    if not own.any():
        return True
    covariance = parameter_covariance(trial.fit, *_expected_starts(problem, trial))
    seen = own & (np.diag(covariance) > 0)
    error = np.sqrt(np.diag(covariance)[seen])
    size = np.array([trial.fit.model.parameters[name].value for name in names])[seen] / error
    related = covariance[np.ix_(seen, seen)] / np.outer(error, error)
    squares = size @ np.linalg.pinv(related, hermitian=True) @ size
    return bool(squares > chi2.ppf(1.0 - alpha, own.sum()))


def _size_fields(cause: Effect) -> set[str]:
    """Return the fields that are sizes of a cause, or of a special case with the same field."""

    def sizes(kind: Effect | type[Effect]) -> set[str]:
        return {q.name for q in kind.quantities() if q.metadata["role"] == "size"}

    own, fields = sizes(cause), {q.name for q in cause.quantities()}
    special = (kind for kind in CATALOGUE if kind.id in cause.generalises)
    return own and own.union(*(sizes(kind) & fields for kind in special))


def leaves_something(
    problem: EstimationProblem, trial: FittedHypothesis, cause: Effect, alpha: float
) -> bool:
    r"""Return whether the fitted limit of a cause exceeds the lowest limit considered.

    .. math:: L - L_\mathrm{min} > z_{1 - \alpha}\, \sigma_L

    with the fitted limit :math:`L`, its standard error and the lowest limit that is considered. At
    the lowest one the limit acts in nearly all samples, and the records say nothing of the
    quantity that it is said to limit: the cause then only compensates for a wrong equation.
    """
    own = cause.names()
    ends = (q for q in cause.quantities() if q.metadata["role"] == "end")
    limits = {own[q.name] for q in ends if q.metadata["low"] == 0.0}  # of magnitudes
    free = [each for each in trial.fit.freedoms if each.name in limits]
    if not free:
        return True
    error = standard_errors(trial.fit, *_expected_starts(problem, trial))
    value = {each.name: trial.fit.model.parameters[each.name].value for each in free}
    needed = norm.ppf(1.0 - alpha)
    return all(value[each.name] - each.low > needed * error[each.name] for each in free)


def only_begins(
    problem: EstimationProblem, trial: FittedHypothesis, cause: Effect, alpha: float
) -> bool:
    r"""Return whether the states of a cause may do nothing but begin.

    .. math:: T + z_{1 - \alpha}\, \sigma_T \ge T_\mathrm{max}

    with the fitted time constant, its standard error and the longest that is considered, a window
    or more: what such a state holds stays as it begins in every window, and may stand for any slow
    force. Where more than two windows are considered, whole records have to show the state, and the
    fitted value counts.
    """
    own, longest = cause.names(), problem.scales.window
    times = {own[q.name] for q in cause.quantities() if q.metadata["unit"] == "s"}
    times -= set(trial.fit.model.delays.values())
    free = [each for each in trial.fit.freedoms if each.name in times and each.high >= longest]
    if not free:
        return False
    error = standard_errors(trial.fit, *_expected_starts(problem, trial))
    beyond, value = norm.ppf(1.0 - alpha), trial.fit.model.parameters
    return any(
        value[each.name].value + (beyond * error[each.name] if each.high <= 2.0 * longest else 0.0)
        >= each.high
        for each in free
    )


def says_more_than_bounds(fitter: WindowFitter, trial: FittedHypothesis, cause: Effect) -> bool:
    """Return whether the records say more of a cause than the bounds of its parameters do.

    A cause is not determined if each of its strengths lies at a limit and may have any value.
    """
    own = cause.names()
    shapes = {own[q.name] for q in cause.quantities() if q.metadata["role"] == "shape"}
    free = [f for f in trial.fit.freedoms if f.name in set(own.values()) - shapes]
    value = {f.name: trial.fit.model.parameters[f.name].value for f in free}
    if not free or not all(value[f.name] in (f.low, f.high) for f in free):
        return True
    errors = standard_errors(trial.fit, *_expected_starts(fitter.problem, trial))
    ends = likelihood_intervals(fitter, trial, {f.name: errors[f.name] for f in free})
    bounds = {f.name: trial.fit.model.parameters[f.name].bounds for f in free}
    return any(ends[name] != bounds[name] for name in ends)


def reads_noise_at_limits(
    problem: EstimationProblem, trial: FittedHypothesis, cause: Effect
) -> bool:
    """Return whether a sensor reads nothing but noise where it is said to be at its limit.

    Half of the errors there are at most `MUCH` times as large as half of the noise is. A limit
    that readings pass stands for a law of the plant.
    """
    outputs, own = list(problem.prior.outputs), cause.names()
    if cause.target not in outputs:
        return True
    at, fit = outputs.index(cause.target), trial.fit
    error = fit.evaluation.residual[:, at]
    shown, most = problem.windows.y[:, at] - error, MUCH * norm.ppf(0.75)
    for name in (own[q.name] for q in cause.quantities() if q.metadata["role"] == "end"):
        there = np.abs(error[np.isclose(shown, fit.model.parameters[name].value)])
        if there.size and np.median(there) > most * problem.windows.scale[at]:
            return False
    return True


def exceeds_rounding(
    problem: EstimationProblem,
    without: FittedHypothesis,
    with_: FittedHypothesis,
    causes: Collection[Effect],
) -> bool:
    """Return whether causes at sensors change a sample by half a step, where steps are the noise.

    At rest a rounded value stays where it is: a limit there removes an error of rounding only.
    """
    outputs, windows = list(problem.prior.outputs), problem.windows
    are_sensors = all(cause.target in outputs for cause in causes)
    if not are_sensors or without.fit.model.equations != with_.fit.model.equations:
        return True
    changed = np.abs(without.fit.evaluation.residual - with_.fit.evaluation.residual)
    for i in (outputs.index(cause.target) for cause in causes):
        known = np.isfinite(windows.y[:, i])
        step = step_of([windows.y[known, i]])
        is_coarse = windows.scale[i] <= 1.01 * step / np.sqrt(12.0)
        if not (is_coarse and changed[known, i].max(initial=0.0) <= step / 2):
            return True
    return False


def overdispersion_along(
    problem: EstimationProblem,
    trial: FittedHypothesis,
    causes: Collection[Effect],
    residuals: Residuals,
) -> float:
    """Return the overdispersion of the residuals of a hypothesis along some of its causes."""
    dispersion = float((residuals.squares * residuals.times).sum() / residuals.counts.sum())
    found = overdispersion(trial.fit, *_expected_starts(problem, trial), dispersion)
    ratios = [[found[name] for name in c.names().values() if name in found] for c in causes]
    return max((float(np.mean(ratio)) for ratio in ratios if ratio), default=1.0)


def _expected_starts(
    problem: EstimationProblem, trial: FittedHypothesis
) -> tuple[np.ndarray, np.ndarray]:
    """Return the expected initial states of the windows, and how uncertain they are."""
    return problem.states.expected_starts(trial.fit.model, problem.windows)
