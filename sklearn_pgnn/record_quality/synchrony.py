"""Synchrony: outputs that respond before their inputs."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.estimation.autocorrelation import white_power
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.improvement import is_better
from sklearn_pgnn.record_quality.limits import SHARE, STEPS
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows


def find_early_output(
    problem: EstimationProblem, base: WindowFit, final: WindowFit, each_step=None
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
    if lead < 1 or not is_better(final, best, 1) or not _leaves_noise(problem, best, final):
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


def _best_lead(problem, base, windows: ShootingWindows, each_step=None) -> tuple[int, WindowFit]:
    """Return by how many samples earlier inputs have the least error, and the fit with them."""
    fits = {0: base} if windows.hold == problem.windows.hold else {}
    sample_time = problem.scales.sample_time

    def error(lead):
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


def _refit(problem, fit: WindowFit, windows: ShootingWindows, each_step) -> WindowFit:
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


def _leaves_noise(problem: EstimationProblem, fit: WindowFit, worse: WindowFit) -> bool:
    """Return whether a fit leaves little beside white noise of what a worse one leaves."""
    left, before = fit.evaluation.residual, worse.evaluation.residual
    beyond = np.nanmean(left**2, axis=0) - white_power(left, problem.windows.starts)
    return bool((beyond <= SHARE * np.nanmean(before**2, axis=0)).all())
