"""Hypotheses whose fit failed: they are noted, and the search goes on without them."""

from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from sklearn_pgnn.exceptions import SimulationError

#: numbers that break down; any other error is a mistake in the program
BREAKDOWNS = (np.linalg.LinAlgError, FloatingPointError, SimulationError)


class Unusable(NamedTuple):
    """Something that could not be fitted.

    Parameters
    ----------
    effect, target : str
        The candidate: id of the effect and what it acts on; or a part of the diagnosis.
    reason : str
        What went wrong, and beside which other causes.
    """

    effect: str
    target: str
    reason: str


class FailureLog:
    """What could not be fitted, and why.

    What could be fitted from another start, or at another time, is not unusable.
    """

    def __init__(self):
        self._lost: dict[Any, Unusable] = {}
        self._fitted: set[Any] = set()

    def fitted(self, key: Hashable) -> None:
        """Note that something could be fitted."""
        self._fitted.add(key)

    def lost(self, key: Hashable, effect: str, target: str, beside: str = "", *, reason) -> None:
        """Note what could not be fitted."""
        self._lost.setdefault(key, Unusable(effect, target, f"{reason}{beside}"))

    def absorb(self, other: "FailureLog", key: Hashable, *what: str) -> None:
        """Note what another log has of one thing, whose key begins with a name of its own.

        Parameters
        ----------
        other : FailureLog
            The log.
        key : hashable
            How this log names what the other one is about.
        *what : str
            What comes after the name.
        """
        for (_, *about), one in other._lost.items():
            if tuple(about) == what:
                self._lost.setdefault((key, *what), one)
        if any(tuple(about) == what for _, *about in other._fitted):
            self._fitted.add((key, *what))

    @contextmanager
    def tolerate(self, key: Hashable, effect: str, target: str, beside: str = "") -> Iterator[None]:
        """Go on where numbers break down, and note what could not be fitted."""
        try:
            yield
        except BREAKDOWNS as error:
            self.lost(key, effect, target, beside, reason=error)

    def entries(self) -> tuple[Unusable, ...]:
        """Return what could not be fitted at all, in the order in which it was tried."""
        lost = (one for key, one in self._lost.items() if key not in self._fitted)
        return tuple(dict.fromkeys(lost))
