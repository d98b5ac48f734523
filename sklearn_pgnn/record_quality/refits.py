"""Faults that a refit shows: parameters that drift, and outputs before their inputs."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import compress, pairwise

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import t as student

from sklearn_pgnn.estimation.autocorrelation import white_power
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import ALPHA, FINE, SHARE, STEPS, TWICE
from sklearn_pgnn.record_quality.signals import Signal, looks_like_noise
from sklearn_pgnn.simulation.uncertainty import standard_errors
from sklearn_pgnn.simulation.window_fit import EachStep, WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.trajectories.noise import finest_differences, noise_level, relative_error


def is_better(worse: WindowFit, better: WindowFit, n_parameters: int) -> bool:
    r"""Return whether a fit with more parameters is better than chance makes it.

    The squares must fall by more than noise lets them, :math:`\hat\sigma^2 \chi^2_q`, and the
    root errors of the blocks on average, as a t test says.
    """
    count = np.isfinite(worse.evaluation.residual).sum()
    noise = better.squares / max(count - n_parameters, 1)
    if not worse.squares - better.squares > noise * chi2.isf(ALPHA, n_parameters):
        return False
    fall = np.sqrt(worse.evaluation.block_squares) - np.sqrt(better.evaluation.block_squares)
    error = np.std(fall, ddof=1) / np.sqrt(fall.size) if fall.size > 1 else 0.0
    limit = student.isf(ALPHA, fall.size - 1) if fall.size > 1 else norm.isf(ALPHA)
    return bool(fall.mean() > limit * error)


# -- parameters, or the noise, that differ from record to record -----------------------------------

#: the kind of its findings
DRIFT = "drift between records"


def differing(findings: Iterable[Finding], model: PhysicsModel) -> Finding | None:
    """Return the finding that a parameter differs between records, if there is one."""
    return next((f for f in findings if f.kind == DRIFT and f.where in model.parameters), None)


def find_drift(
    problem: EstimationProblem,
    names: Sequence[str],
    base: WindowFit,
    final: WindowFit,
    each_step: EachStep = None,
) -> Finding | None:
    r"""Find parameters that differ from record to record.

    The prior is re-tuned on every record alone. These fits together must be better than the
    extended model on all, as an F test and the errors of the windows say, and remove most of what
    it leaves above the noise. The parameter with the largest
    :math:`\sum_r ((p_r - \bar p)/\sigma_r)^2` is named.

    .. [1] G. C. Chow, "Tests of equality between sets of coefficients in two linear regressions",
       Econometrica 28, 1960, :doi:`10.2307/1910133`.
    """
    record = problem.windows.record
    groups = [np.flatnonzero(record == r) for r in range(len(names))]
    if len(groups) < 2 or not base.freedoms or min(map(len, groups)) < 1:
        return None
    estimate = problem.states.estimate(base.model)
    expected = estimate.x[problem.windows.starts]
    alone = [_fit_alone(problem, base, expected, estimate.spread, g, each_step) for g in groups]
    together = _put_together(base, alone, groups)
    if not np.isfinite(together.squares) or not _removes_most(problem, final, together):
        return None
    if not is_better(final, together, len(base.freedoms) * (len(groups) - 1)):
        return None
    errors = [
        standard_errors(fit, expected[g], estimate.spread)
        for fit, g in zip(alone, groups, strict=True)
    ]
    return _drift(problem, names, alone, errors)


def _fit_alone(
    problem: EstimationProblem,
    base: WindowFit,
    expected: np.ndarray,
    spread: np.ndarray,
    group: np.ndarray,
    each_step: EachStep,
) -> WindowFit:
    known = base.model.parameters
    bounds = [known[freedom.name].bounds for freedom in base.freedoms]  # beyond the spread
    wide = zip(base.freedoms, bounds, strict=True)
    return fit_windows(
        base.model,
        problem.windows.select(group),
        tuple(replace(freedom, low=low, high=high) for freedom, (low, high) in wide),
        expected[group],
        spread,
        x0_start=base.x0[group],
        max_steps=STEPS,
        each_step=each_step,
    )


def _put_together(
    base: WindowFit, alone: Sequence[WindowFit], groups: Sequence[np.ndarray]
) -> WindowFit:
    """Return the fits of single records as one of all."""
    gram = np.empty_like(base.evaluation.block_gram)
    residual = np.full_like(base.evaluation.residual, np.nan)
    for fit, group in zip(alone, groups, strict=True):
        gram[group] = fit.evaluation.block_gram
        seen = np.isfinite(fit.evaluation.residual)
        residual[seen] = fit.evaluation.residual[seen]
    return replace(base, evaluation=replace(base.evaluation, block_gram=gram, residual=residual))


def _removes_most(problem: EstimationProblem, final: WindowFit, together: WindowFit) -> bool:
    """Return whether fits of single records leave less than half of what is above the noise."""
    rest = together.evaluation.residual / problem.windows.scale
    counts = np.isfinite(rest).sum(axis=0)
    least = FINE * np.nanstd(problem.windows.y, axis=0) / problem.windows.scale
    noise = np.maximum(white_power(rest, problem.windows.starts), least**2)
    floor = float((noise * counts).sum())
    return TWICE * (together.squares - floor) < max(final.squares - floor, 0.0)


def _drift(
    problem: EstimationProblem,
    names: Sequence[str],
    alone: Sequence[WindowFit],
    errors: Sequence[Mapping[str, float]],
) -> Finding:
    """Return the finding of the parameter that differs most, in units of its standard errors."""
    spreads = {}
    for freedom in alone[0].freedoms:
        values = np.array([fit.model.parameters[freedom.name].value for fit in alone])
        sigma = np.array([e[freedom.name] for e in errors])
        weight = np.where(np.isfinite(sigma), 1.0 / np.maximum(sigma, 1e-12) ** 2, 0.0)
        mean = np.sum(weight * values) / max(weight.sum(), 1e-300)
        spreads[freedom.name] = (float(np.sum(weight * (values - mean) ** 2)), values)
    name = max(spreads, key=lambda key: spreads[key][0])
    values = spreads[name][1]
    low, high, unit = int(np.argmin(values)), int(np.argmax(values)), problem.prior.unit(name)
    return Finding(
        DRIFT,
        name,
        f"the parameters differ between records; {name} goes from {values[low]:.4g} in record "
        f"{names[low]} to {values[high]:.4g} {unit} in record {names[high]}".rstrip(),
        float(values[high] - values[low]),
        "look for what changed between the records (temperature, load, supply), or diagnose them "
        "separately",
    )


def find_uneven_noise(signal: Signal) -> Finding | None:
    """Find records that are noisier than others by more than twice."""
    measured = [bool(np.isfinite(piece).any()) for piece in signal.pieces]
    timed = list(compress(zip(signal.pieces, signal.times, strict=True), measured))
    records = list(compress(signal.records, measured))
    if len(timed) < 2 or not all(looks_like_noise([y], [t]) for y, t in timed):
        return None
    if signal.resolution > signal.noise:  # then the steps are seen, and not the noise
        return None
    rounding = signal.resolution / np.sqrt(12)
    levels = np.array([max(noise_level(*piece), rounding) for piece in timed])
    finest = (finest_differences(*piece) for piece in timed)
    errors = np.array([relative_error(values.size, order) for values, order in finest])
    low, high = int(np.argmin(levels)), int(np.argmax(levels))
    error = np.hypot(errors[low], errors[high])
    pairs = len(levels) * (len(levels) - 1)
    least = np.log(TWICE) + norm.isf(ALPHA / pairs) * error
    if not levels[low] > 0 or np.log(levels[high] / levels[low]) < least:
        return None
    return Finding(
        DRIFT,
        signal.name,
        f"the noise of {signal.name} is {signal.measured(levels[high])} in record "
        f"{records[high]} and {signal.measured(levels[low])} in record {records[low]}",
        float(levels[high] / levels[low]),
        "find out what changed between the records, or diagnose them separately",
    )


# -- outputs that respond before their inputs ------------------------------------------------------


def find_early_output(
    problem: EstimationProblem, base: WindowFit, final: WindowFit, each_step: EachStep = None
) -> Finding | None:
    """Find outputs that respond before their input: the two were not recorded synchronously.

    The re-tuned prior is fitted with its inputs moved to earlier samples, held or straight in
    between. It must then do better than the extended model, by more than chance, and leave little
    but white noise: earlier inputs also make up for a model that is too slow.
    """
    if not problem.prior.inputs:
        return None
    held = (replace(problem.windows, hold=hold) for hold in ("zoh", "foh"))
    leads = [_best_lead(problem, base, windows, each_step) for windows in held]
    lead, best = min(leads, key=lambda found: found[1].objective)
    is_found = lead >= 1 and is_better(final, best, 1)
    if not is_found or not leaves_noise(problem.windows, best, final):
        return None
    ahead = lead * problem.scales.sample_time
    count = "1 sample" if lead == 1 else f"{lead} samples"
    return Finding(
        "not synchronous",
        ", ".join(problem.prior.outputs),
        f"the outputs lead the inputs by {count} ({ahead:.3g} s): no cause acts backward in time",
        ahead,
        "record inputs and outputs on one clock, or shift the inputs by this time",
    )


def _best_lead(
    problem: EstimationProblem,
    base: WindowFit,
    windows: ShootingWindows,
    each_step: EachStep = None,
) -> tuple[int, WindowFit]:
    """Return by how many samples earlier inputs have the least error, and the fit with them."""
    fits = {0: base} if windows.hold == problem.windows.hold else {}
    sample_time = problem.scales.sample_time

    def error(lead: int) -> float:
        if lead not in fits:
            fits[lead] = _refit(problem, base, _earlier(windows, lead * sample_time), each_step)
        return fits[lead].objective

    best, step = 0, 1
    longest = int(windows.lengths.min()) // 2
    while best + step <= longest and error(best + step) < error(best):
        best, step = best + step, 2 * step
    while step > 1:
        step //= 2
        best = min((best, best - step, min(best + step, longest)), key=error)
    return best, fits[best]


def _earlier(windows: ShootingWindows, time: float) -> ShootingWindows:
    """Return the windows with inputs moved to earlier samples, of every record's own clock."""
    u = windows.u.copy()
    for a, b in pairwise(windows.bounds):
        lead = round(time / float(np.median(np.diff(windows.t[a:b]))))
        u[a:b] = windows.u[np.minimum(np.arange(a, b) + lead, b - 1)]
    return replace(windows, u=u)


def _refit(
    problem: EstimationProblem, fit: WindowFit, windows: ShootingWindows, each_step: EachStep
) -> WindowFit:
    estimate = problem.states.estimate(fit.model)
    return fit_windows(
        fit.model,
        windows,
        fit.freedoms,
        estimate.x[windows.starts],
        estimate.spread,
        x0_start=fit.x0,
        max_steps=STEPS,
        each_step=each_step,
    )


def leaves_noise(windows: ShootingWindows, fit: WindowFit, worse: WindowFit) -> bool:
    """Return whether a fit leaves little beside white noise of what a worse one leaves."""
    left, before = fit.evaluation.residual, worse.evaluation.residual
    beyond = np.nanmean(left**2, axis=0) - white_power(left, windows.starts)
    return bool((beyond <= SHARE * np.nanmean(before**2, axis=0)).all())
