"""Numerical failures of the fits of a hypothesis: each is recorded under its last cause."""

from contextlib import AbstractContextManager

import numpy as np

from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.unusable import FailureLog
from sklearn_pgnn.simulation.window_fit import WindowFit


def tolerate_failures(
    failures: FailureLog, key: Key, hypothesis: Hypothesis, *what: str
) -> AbstractContextManager:
    """Continue after numerical failures, and record the unusable hypothesis."""
    return failures.tolerate((key, *what), *_described(hypothesis))


def note_fit(failures: FailureLog, key: Key, hypothesis: Hypothesis, fit: WindowFit) -> WindowFit:
    """Record whether a hypothesis could be fitted, and return the fit."""
    if fit.usable:
        failures.fitted((key,))
    else:
        failures.lost((key,), *_described(hypothesis), reason=_why_lost(fit))
    return fit


def _described(hypothesis: Hypothesis) -> tuple[str, str, str]:
    """Return the effect and target of the cause added last, and the other causes."""
    if not hypothesis.causes:
        return "", "", ""
    *others, last = hypothesis.causes
    names = " and ".join(f"{each.id} of {each.target}" for each in others)
    return last.id, last.target, f" with {names}" if names else ""


def _why_lost(fit: WindowFit) -> str:
    """Return the reason why a fit cannot be used, unless an error was recorded."""
    lost = np.count_nonzero(~np.isfinite(fit.evaluation.squares))
    return (
        f"its simulation diverges or is dominated by rounding errors in {lost} of {len(fit.x0)} "
        f"windows"
    )
