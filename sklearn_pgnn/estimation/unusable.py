"""Hypotheses whose fit failed: they are logged, and the search continues without them."""

from collections.abc import Hashable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, NamedTuple

import numpy as np

from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.exceptions import SimulationError
from sklearn_pgnn.simulation.window_fit import WindowFit

#: numerical failures; any other error is a bug in the program
BREAKDOWNS = (np.linalg.LinAlgError, FloatingPointError, SimulationError)


class Unusable(NamedTuple):
    """A candidate, or a part of the diagnosis, that could not be fitted, and the reason."""

    effect: str
    target: str
    reason: str


class FailureLog:
    """Log of failed fits, with the reasons, that did not succeed from another start or later."""

    def __init__(self) -> None:
        self._lost: dict[Any, Unusable] = {}
        self._fitted: set[Any] = set()

    def fitted(self, key: Hashable) -> None:
        """Record a successful fit."""
        self._fitted.add(key)

    def lost(
        self, key: Hashable, effect: str, target: str, beside: str = "", *, reason: Exception | str
    ) -> None:
        """Record a failed fit."""
        self._lost.setdefault(key, Unusable(effect, target, f"{reason}{beside}"))

    def absorb(self, other: "FailureLog", key: Hashable, *what: str) -> None:
        """Copy the entries of another log about one item, whose key begins with another name."""
        for (_, *about), one in other._lost.items():
            if tuple(about) == what:
                self._lost.setdefault((key, *what), one)
        if any(tuple(about) == what for _, *about in other._fitted):
            self._fitted.add((key, *what))

    @contextmanager
    def tolerate(self, key: Hashable, effect: str, target: str, beside: str = "") -> Iterator[None]:
        """Continue after numerical failures, and record them."""
        try:
            yield
        except BREAKDOWNS as error:
            self.lost(key, effect, target, beside, reason=error)

    def entries(self) -> tuple[Unusable, ...]:
        """Return all that could not be fitted, in the order of the attempts."""
        lost = (one for key, one in self._lost.items() if key not in self._fitted)
        return tuple(dict.fromkeys(lost))


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
