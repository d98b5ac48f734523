"""Data quality: what the records lack or hide, before any cause is blamed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import t as student

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.record_quality.flaws import (
    ALPHA,
    COARSE,
    FINE,
    WHOLE,
    Finding,
    Signal,
    find_clipping,
    find_dull_input,
    find_gaps,
    find_held_samples,
    find_jitter,
    find_outliers,
    find_quantisation,
    find_uneven_noise,
)
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, MIN_WINDOWS, median_window_length
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.uncertainty import standard_errors
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows, project
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate
from sklearn_pgnn.trajectories.record import Record

#: samples into the past that a series is predicted from, and into the future that are compared
ORDER, FUTURE = 10, 10
#: sines of the rich input that the record's own is compared with
SINES = 40
#: share of what a rich record would settle that counts as missing; a rich record must settle some
MISSING, SOME = 0.5, 0.1
#: share of the error above the noise that fits of single records must remove
HALF = 0.5
#: steps of a fit from a known minimum
STEPS = 8


def check_data_quality(
    problem: EstimationProblem,
    names: Sequence[str],
    whole: Sequence[Record],
    base: WindowFit,
    final: WindowFit,
    best: WindowFit | None = None,
) -> tuple[Finding, ...]:
    """Say what in the records stands in the way of a diagnosis.

    Parameters
    ----------
    problem : EstimationProblem
        the problem.
    names : sequence of str
        What the records are called.
    whole : sequence of Record
        The records as they were read, with their gaps.
    base, final : WindowFit
        The re-tuned prior and the extended model.
    best : WindowFit, optional
        The model with a formula for what has no name: it drifts less than one that lacks a part.

    Returns
    -------
    tuple of Finding
        What was found; empty where nothing stands in the way.

    Notes
    -----
    Every check of one quantity speaks up by chance in at most one of a thousand faultless sets of
    records.
    """
    windows, model = problem.windows, problem.prior
    outputs = _signals(model, model.outputs, windows, windows.y, names)
    inputs = _signals(model, model.inputs, windows, windows.u, names)
    left = _signals(model, model.outputs, windows, final.evaluation.residual, names)
    found: list[Finding | None] = [find_few_windows(windows)]
    found += [find_dull_input(signal) for signal in inputs]
    found += find_blind_parameters(problem, base)
    clocks = [record.t for record in whole]
    found += [find_gaps(clocks, [record.name for record in whole]), find_jitter(outputs)]
    for signal, rest in zip(outputs, left, strict=True):
        found += [find_clipping(signal), find_quantisation(signal), find_held_samples(signal)]
        found += [find_outliers(signal, rest), find_uneven_noise(signal)]
    found += [find_closed_loop(problem, final, outputs, inputs, left)]
    found += [
        find_early_output(problem, base, final),
        find_drift(problem, names, base, best or final),
    ]
    return tuple(finding for finding in found if finding is not None)


def clipped_outputs(problem: EstimationProblem) -> tuple[str, ...]:
    """Name the outputs that stand still at an end of their range though they are noisy elsewhere.

    That is the sensor: the machine itself may stand still at its stop, but its noise would not.

    Parameters
    ----------
    problem : EstimationProblem
        the problem.

    Returns
    -------
    tuple of str
        Outputs.
    """
    model, windows = problem.prior, problem.windows
    names = [""] * (windows.bounds.size - 1)
    outputs = _signals(model, model.outputs, windows, windows.y, names)
    noisy = [signal for signal in outputs if signal.chance_of_equals() < COARSE]
    return tuple(signal.name for signal in noisy if find_clipping(signal))


def _signals(model, quantities, windows: ShootingWindows, values, names) -> list[Signal]:
    cuts = windows.bounds[1:-1]
    times = np.split(windows.t, cuts)
    return [
        Signal(name, model.unit(name), np.split(values[:, i], cuts), times, names)
        for i, name in enumerate(quantities)
    ]


# -- length ----------------------------------------------------------------------------------------


def find_few_windows(windows: ShootingWindows) -> Finding | None:
    """Find that there are fewer windows than what is held out should be judged from.

    Parameters
    ----------
    windows : ShootingWindows
        The windows of the diagnosis.

    Returns
    -------
    Finding or None
        What was found.
    """
    count = len(windows)
    if count >= MIN_WINDOWS:
        return None
    return Finding(
        "short records",
        "t",
        f"the records make only {count} windows of {median_window_length(windows):.3g} s, fewer "
        f"than {MIN_WINDOWS}: held-out errors, and so the verdict, are uncertain",
        float(count),
        f"record longer, so that at least {MIN_WINDOWS} windows of {MIN_SAMPLES} samples fit, or "
        f"choose shorter windows",
    )


# -- excitation ------------------------------------------------------------------------------------


def find_blind_parameters(problem: EstimationProblem, base: WindowFit) -> list[Finding]:
    r"""Find parameters that these records cannot fix and richer ones of the same size could.

    With the Fisher information :math:`H` of the windows, initial states projected out, and the
    parameters' spread :math:`\sigma_i` in the prior, a record leaves the variance
    :math:`v_i = [(H + \mathrm{diag}(\sigma^{-2}))^{-1}]_{ii}`. A parameter is reported if a record
    with the same clock and range of inputs, but many sines, would settle more than twice as much
    of :math:`\sigma_i^2`. What no record settles is not reported.

    Parameters
    ----------
    problem : EstimationProblem
        the problem.
    base : WindowFit
        The re-tuned prior.

    Returns
    -------
    list of Finding
        A finding a parameter.

    References
    ----------
    .. [1] L. Ljung, "System identification: theory for the user", 2nd ed., Prentice Hall, 1999.
    """
    freedoms = [f for f in base.freedoms if np.isfinite(f.spread) and f.spread > 0]
    if not freedoms or not np.ptp(problem.windows.u, axis=0).any():
        return []
    rich = _rich_windows(problem.windows)
    x0 = _states_under(base, problem.windows, rich)
    spread = problem.states.estimate(base.model).spread
    here = _shares_left(base.model, problem.windows, base.x0, spread, freedoms)
    there = _shares_left(base.model, rich, x0, spread, freedoms)
    findings = []
    for freedom, mine, best in zip(freedoms, here, there, strict=True):
        if 1 - best > SOME and mine - best > MISSING * (1 - best):
            findings.append(_blind(freedom.name, float(np.sqrt(mine))))
    return findings


def _blind(name, share) -> Finding:
    return Finding(
        "poor excitation",
        name,
        f"these records leave {share:.0%} of what was uncertain about {name}; livelier inputs of "
        f"the same size would settle it",
        share,
        f"excite at several frequencies and levels, or measure {name} on its own",
    )


def _rich_windows(windows: ShootingWindows) -> ShootingWindows:
    """Put many sines of the inputs' own range in the place of the inputs."""
    rng = np.random.default_rng(0)
    u = np.empty_like(windows.u)
    for a, b in zip(windows.bounds[:-1], windows.bounds[1:], strict=True):
        clock = (windows.t[a:b] - windows.t[a]) / max(windows.t[b - 1] - windows.t[a], 1e-12)
        for i in range(u.shape[1]):
            cycles = np.geomspace(0.5, max((b - a) / 10, 1.0), SINES)
            wave = np.sin(2 * np.pi * (np.outer(clock, cycles) + rng.uniform(size=SINES))).sum(1)
            low, high = windows.u[:, i].min(), windows.u[:, i].max()
            u[a:b, i] = (low + high) / 2 + (high - low) / 2 * wave / np.abs(wave).max()
    return replace(windows, u=u)


def _states_under(fit: WindowFit, windows: ShootingWindows, other: ShootingWindows) -> np.ndarray:
    """Give the windows' initial states in a free run under other inputs."""
    x0, record = np.empty_like(fit.x0), windows.record
    for r, (a, b) in enumerate(zip(windows.bounds[:-1], windows.bounds[1:], strict=True)):
        mine = np.flatnonzero(record == r)
        if mine.size:
            run = free_run(fit.model, other, a, b, fit.x0[mine[0]])
            x0[mine] = np.where(np.isfinite(run.x), run.x, fit.x0[mine[0]])[
                windows.starts[mine] - a
            ]
    return x0


def _shares_left(model, windows, x0, spread, freedoms) -> np.ndarray:
    """Give the share of every parameter's prior variance that the windows leave."""
    gram = evaluate(model, windows, x0, tuple(f.name for f in freedoms)).gram
    normal = project(gram, len(freedoms), 1.0 / spread**2, np.zeros_like(x0))
    scale = np.array([f.spread for f in freedoms])
    information = normal.hessian.sum(axis=0) * np.outer(scale, scale)
    return np.diag(np.linalg.inv(information + np.eye(len(freedoms))))


# -- feedback --------------------------------------------------------------------------------------


def find_closed_loop(
    problem: EstimationProblem, final: WindowFit, outputs, inputs, left
) -> Finding | None:
    r"""Find an input that follows the noise of an output.

    The noise :math:`\varepsilon` that the extended model leaves and the part :math:`\nu` of an
    input that its own past does not tell are independent in open loop, whatever the input. With
    the share :math:`R^2` of :math:`\varepsilon_k` that a regression on
    :math:`\nu_k, \dots, \nu_{k+M}` explains,

    .. math:: n R^2 \sim \chi^2_{M+1}.

    It is looked for only where the model leaves no more than noise, and counts only where the
    noise makes up a part of :math:`\nu`.

    Parameters
    ----------
    problem : EstimationProblem
        the problem.
    final : WindowFit
        The extended model.
    outputs, inputs, left : list of Signal
        The quantities, and what the model leaves of the outputs.

    Returns
    -------
    Finding or None
        What was found.

    References
    ----------
    .. [1] L. D. Haugh, "Checking the independence of two covariance-stationary time series",
       Journal of the American Statistical Association 71, 1976,
       :doi:`10.1080/01621459.1976.10480353`.
    """
    chance = ALPHA / max(len(outputs) * len(inputs), 1)
    for signal, rest in zip(outputs, left, strict=True):
        if not signal.noisy or _excess(rest) > WHOLE:
            continue
        noise = _innovations(rest.pieces)
        for source in inputs:
            correlation = _follows(noise, _innovations(source.pieces), chance)
            if correlation:
                return _loop(signal.name, source.name, correlation)
    return None


def _loop(output, source, correlation) -> Finding:
    return Finding(
        "closed loop",
        source,
        f"{source} follows the noise of {output} (correlation {correlation:.2f}): it was "
        f"commanded by a controller that sees {output}",
        correlation,
        "record in open loop, or add a test signal to the command that is large beside the noise; "
        "name no cause from an input that answers to the error",
    )


def _excess(rest: Signal) -> float:
    """Give the share of the left power that is more than white noise."""
    steps = np.concatenate([np.diff(piece) for piece in rest.pieces])
    return float(1 - np.nanmean(steps**2) / 2 / np.nanmean(rest.values**2))


def _innovations(pieces) -> list[np.ndarray]:
    """Give what the past does not tell of a series; NaN where it is not known."""
    windows = [np.lib.stride_tricks.sliding_window_view(p, ORDER + 1) for p in pieces
               if p.size > ORDER]  # fmt: skip
    if not windows:
        return [np.full(p.size, np.nan) for p in pieces]
    rows = np.concatenate(windows)
    rows = rows[np.isfinite(rows).all(axis=1)]
    past = np.column_stack([rows[:, :-1], np.ones(len(rows))])
    weights = np.linalg.lstsq(past, rows[:, -1], rcond=None)[0]
    found = []
    for piece in pieces:
        new = np.full(piece.size, np.nan)
        if piece.size > ORDER:
            window = np.lib.stride_tricks.sliding_window_view(piece, ORDER + 1)
            new[ORDER:] = window[:, -1] - window[:, :-1] @ weights[:-1] - weights[-1]
        found.append(new)
    return found


def _follows(noise, news, chance) -> float:
    """Give the largest correlation of noise with what an input brings next; 0 if by chance."""
    pairs = [_ahead(e, v) for e, v in zip(noise, news, strict=True) if e.size > FUTURE]
    rows = np.concatenate([np.zeros((0, FUTURE + 2)), *pairs])
    rows = rows[np.isfinite(rows).all(axis=1)]
    size = np.sqrt(np.mean(rows**2, axis=0)) if len(rows) else np.zeros(1)
    if not size.min() > 0:
        return 0.0
    own, ahead = rows[:, 0] / size[0], rows[:, 1:] / size[1:]
    weights, _, rank, _ = np.linalg.lstsq(ahead, own, rcond=1e-8)
    statistic = len(rows) - float(np.sum((own - ahead @ weights) ** 2))
    correlations = own @ ahead / len(rows)
    part = float(np.sum(correlations**2)) - ahead.shape[1] / len(rows)
    follows = statistic > chi2.isf(chance, rank) and part > WHOLE
    return float(np.abs(correlations).max()) if follows else 0.0


def _ahead(noise, news) -> np.ndarray:
    """Put the noise of a sample beside what the input brings from there on."""
    future = np.lib.stride_tricks.sliding_window_view(news, FUTURE + 1)
    return np.column_stack([noise[: len(future)], future])


# -- synchronism -----------------------------------------------------------------------------------


def find_early_output(
    problem: EstimationProblem, base: WindowFit, final: WindowFit
) -> Finding | None:
    """Find outputs that answer before their input: the two were not recorded in step.

    The re-tuned prior is fitted with its inputs moved to earlier samples. It must then do better
    than the extended model, by more than chance, with the inputs more than one sample early.

    Parameters
    ----------
    problem : EstimationProblem
        the problem.
    base, final : WindowFit
        The re-tuned prior and the extended model.

    Returns
    -------
    Finding or None
        What was found.
    """
    if not problem.prior.inputs:
        return None
    lead, best = _best_lead(problem, base)
    if lead < 2 or not _is_better(final, best, 1):
        return None
    ahead = lead * problem.scales.sample_time
    return Finding(
        "not synchronous",
        ", ".join(problem.prior.outputs),
        f"the outputs lead the inputs by {lead} samples ({ahead:.3g} s): no cause acts backward "
        f"in time",
        ahead,
        "record inputs and outputs on one clock, or move the inputs by this time",
    )


def _best_lead(problem, base) -> tuple[int, WindowFit]:
    """Move the inputs earlier by doubling, then step by step, while that lowers the error."""
    fits, sample_time = {0: base}, problem.scales.sample_time

    def error(lead):
        if lead not in fits:
            fits[lead] = _refit(problem, base, _earlier(problem.windows, lead * sample_time))
        return fits[lead].objective

    best, step = 0, 1
    longest = int(problem.windows.lengths.min()) // 2
    while best + step <= longest and error(best + step) < error(best):
        best, step = best + step, 2 * step
    while step > 1:
        step //= 2
        best = min((best, best - step, min(best + step, longest)), key=error)
    return best, fits[best]


def _earlier(windows: ShootingWindows, time: float) -> ShootingWindows:
    """Move the inputs to earlier samples, of every record's own clock."""
    u = windows.u.copy()
    for a, b in zip(windows.bounds[:-1], windows.bounds[1:], strict=True):
        lead = round(time / float(np.median(np.diff(windows.t[a:b]))))
        u[a:b] = windows.u[np.minimum(np.arange(a, b) + lead, b - 1)]
    return replace(windows, u=u)


def _refit(problem, fit: WindowFit, windows: ShootingWindows) -> WindowFit:
    estimate = problem.states.estimate(fit.model)
    return fit_windows(
        fit.model,
        windows,
        fit.freedoms,
        estimate.x[windows.starts],
        estimate.spread,
        x0_start=fit.x0,
        max_steps=STEPS,
    )


def _is_better(worse: WindowFit, better: WindowFit, n_parameters: int) -> bool:
    """Tell whether a fit with so many more parameters is better than chance makes it.

    The squares must fall by more than noise lets them, and the pieces' errors on average.
    """
    count = np.isfinite(worse.evaluation.residual).sum()
    noise = better.squares / max(count - n_parameters, 1)
    if not worse.squares - better.squares > noise * chi2.isf(ALPHA, n_parameters):
        return False
    fall = np.sqrt(worse.evaluation.block_squares) - np.sqrt(better.evaluation.block_squares)
    error = np.std(fall, ddof=1) / np.sqrt(fall.size) if fall.size > 1 else 0.0
    limit = student.isf(ALPHA, fall.size - 1) if fall.size > 1 else norm.isf(ALPHA)
    return bool(fall.mean() > limit * error)


# -- drift -----------------------------------------------------------------------------------------


def find_drift(
    problem: EstimationProblem, names, base: WindowFit, final: WindowFit
) -> Finding | None:
    r"""Find parameters that differ from record to record.

    The prior is re-tuned on every record alone. These fits together must be better than the
    extended model on all, as an F test and the errors of the windows say, and remove most of what
    it leaves above the noise. The parameter with the largest
    :math:`\sum_r ((p_r - \bar p)/\sigma_r)^2` is named.

    Parameters
    ----------
    problem : EstimationProblem
        the problem.
    names : sequence of str
        What the records are called.
    base, final : WindowFit
        The re-tuned prior and the extended model.

    Returns
    -------
    Finding or None
        What was found.

    References
    ----------
    .. [1] G. C. Chow, "Tests of equality between sets of coefficients in two linear regressions",
       Econometrica 28, 1960, :doi:`10.2307/1910133`.
    """
    record = problem.windows.record
    groups = [np.flatnonzero(record == r) for r in range(len(names))]
    if len(groups) < 2 or not base.freedoms or min(map(len, groups)) < 1:
        return None
    estimate = problem.states.estimate(base.model)
    expected = estimate.x[problem.windows.starts]
    alone = [_fit_alone(problem, base, expected, estimate.spread, g) for g in groups]
    together = _put_together(base, alone, groups)
    if not np.isfinite(together.squares) or not _removes_most(problem, final, together):
        return None
    if not _is_better(final, together, len(base.freedoms) * (len(groups) - 1)):
        return None
    errors = [
        standard_errors(fit, expected[g], estimate.spread)
        for fit, g in zip(alone, groups, strict=True)
    ]
    return _drift(problem, names, alone, errors)


def _fit_alone(problem, base, expected, spread, group) -> WindowFit:
    return fit_windows(
        base.model,
        problem.windows.select(group),
        tuple(_wide(base.model, freedom) for freedom in base.freedoms),
        expected[group],
        spread,
        x0_start=base.x0[group],
        max_steps=STEPS,
    )


def _wide(model, freedom: ParameterPrior) -> ParameterPrior:
    """Let a parameter go to its bounds: a drift may exceed its spread."""
    low, high = model.parameters[freedom.name].bounds
    return replace(freedom, low=low, high=high)


def _put_together(base, alone, groups) -> WindowFit:
    """Give the windows' squares and residuals of the fits of single records as those of one."""
    gram = np.empty_like(base.evaluation.block_gram)
    residual = np.full_like(base.evaluation.residual, np.nan)
    for fit, group in zip(alone, groups, strict=True):
        gram[group] = fit.evaluation.block_gram
        seen = np.isfinite(fit.evaluation.residual)
        residual[seen] = fit.evaluation.residual[seen]
    return replace(base, evaluation=replace(base.evaluation, block_gram=gram, residual=residual))


def _removes_most(problem, final, together) -> bool:
    """Tell whether the fits of single records leave less than half above the noise."""
    rest = together.evaluation.residual / problem.windows.scale
    steps = np.diff(rest, axis=0)
    steps[problem.windows.starts[1:] - 1] = np.nan
    counts = np.isfinite(rest).sum(axis=0)
    least = FINE * np.nanstd(problem.windows.y, axis=0) / problem.windows.scale
    noise = np.maximum(np.nanmean(steps**2, axis=0) / 2, least**2)
    floor = float((noise * counts).sum())
    return together.squares - floor < HALF * max(final.squares - floor, 0.0)


def _drift(problem, names, alone, errors) -> Finding:
    """Name the parameter that differs most, in units of its standard errors."""
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
        "drift between records",
        name,
        f"every record has parameters of its own; {name} goes from {values[low]:.4g} in record "
        f"{names[low]} to {values[high]:.4g} {unit} in record {names[high]}".rstrip(),
        float(values[high] - values[low]),
        "look for what changed between the records (temperature, load, supply), or diagnose them "
        "apart",
    )
