"""Many simulations that fail in one call are one warning."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.user_line import warn_user


@contextmanager
def one_simulation_warning() -> Iterator[list[str]]:
    """Issue the first `SimulationWarning` of a block at its end, with the number of the others."""
    names: list[str] = []
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", SimulationWarning)
            yield names
    finally:  # an error may be the consequence of what was warned of
        _issue(caught, f"trajectory {names[0]!r}: " if names else "")


def _issue(caught: list[warnings.WarningMessage], where: str) -> None:
    """Issue recorded warnings again, those of simulations as one."""
    failed = []
    for each in caught:
        if issubclass(each.category, SimulationWarning):
            failed.append(each.message)
        else:
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
    if failed:
        warn_user(_counted(failed, where))


def _counted(messages, where: str) -> SimulationWarning:
    """Return the first of several warnings with their number; those may be counted ones, too."""
    first = where + getattr(messages[0], "first", str(messages[0]))
    count = sum(getattr(each, "count", 1) for each in messages)
    simulations = "simulation" if count == 2 else "simulations"
    more = f" {count - 1} more {simulations} failed in the same call." if count > 1 else ""
    found = SimulationWarning(f"{first}{more}")
    vars(found).update(first=first, count=count)
    return found
