r"""Whether a fit depends on its integration steps, and in which it does not.

A fit moves the eigenvalues of the model. At the limit of stability of explicit steps its error
rises like a wall, and the curvature of the wall would pass for information. With steps that are too
long the optimum is off. So at the optimum the steps are looked at again:

.. math:: |\lambda| h \le 2 \qquad\text{and}\qquad
          |H_{1/2}^{-1} (g_{1/2} - g_1)|_i \le \tfrac{1}{10} \sigma_i,

with the gradients :math:`g` in these steps and in half ones, their Hessian :math:`H_{1/2}`, and the
standard errors :math:`\sigma`.
"""

from copy import copy
from dataclasses import replace

import numpy as np

from sklearn_pgnn.simulation.normal_equations import normal_equations
from sklearn_pgnn.simulation.record_windows import (
    WindowedRecords,
    enough_substeps,
    speed_in_windows,
)
from sklearn_pgnn.simulation.substeps import IMPLICIT, MAX_SUBSTEPS, Steps
from sklearn_pgnn.simulation.uncertainty import invert, standard_errors
from sklearn_pgnn.simulation.window_fit import WindowFit, prior_precision
from sklearn_pgnn.simulation.windows import evaluate

#: share of a standard error that is small
SMALL_SHARE = 0.1
#: a model may become so many times faster in a further fit before its steps are too long again
ROOM = 4.0


def with_steps(windowed: WindowedRecords, steps: Steps) -> WindowedRecords:
    """Return the same records in other integration steps."""
    states = copy(windowed.states)
    windows = replace(windowed.windows, **steps._asdict())
    states.windows = replace(states.windows, **steps._asdict())
    return replace(windowed, windows=windows, states=states)


def steps_for_fit(
    windowed: WindowedRecords, fit: WindowFit, expected: np.ndarray, spread: np.ndarray
) -> Steps:
    """Return the steps in which to fit again, the present ones if the fit depends on none."""
    windows, now = windowed.windows, windowed.windows.steps
    if not fit.usable:
        return now
    fast = speed_in_windows(fit.model, windows, fit.evaluation)
    if not now.are_stable(fast):
        if windowed.steps_are_told:
            return Steps(IMPLICIT, now.substeps)
        return enough_substeps(fit.model, replace(windows, substeps=1), fit.x0, ROOM * fast)
    if windowed.steps_are_told or now.substeps >= MAX_SUBSTEPS or not fit.freedoms:
        return now
    double = Steps(now.method, 2 * now.substeps)
    finer = evaluate(
        fit.model,
        replace(windows, **double._asdict()),
        fit.x0,
        tuple(freedom.name for freedom in fit.freedoms),
    )
    return double if _moves(fit, replace(fit, evaluation=finer), expected, spread) else now


def _moves(fit: WindowFit, finer: WindowFit, expected, spread) -> bool:
    """Return whether finer steps move a parameter by a notable part of its standard error."""
    if not np.isfinite(finer.evaluation.squares).all():
        return False
    before, after = (normal_equations(each, expected, spread) for each in (fit, finer))
    inverse, _ = invert(after.hessian.sum(axis=0) + prior_precision(fit.freedoms))
    moved = inverse @ (after.gradient - before.gradient).sum(axis=0)
    errors = np.array(list(standard_errors(fit, expected, spread).values()))
    known = np.isfinite(errors) & (errors > 0)
    return bool((np.abs(moved[known]) > SMALL_SHARE * errors[known]).any())
