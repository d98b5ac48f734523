"""The time limit of a recipe: what it judges is judged in order, as far as the time goes."""

from dataclasses import dataclass, field
from math import inf
from time import monotonic

from sklearn_pgnn.user_line import warn_user

#: share of the time that the diagnosis may take
OF_DIAGNOSIS = 0.5


@dataclass
class TimeLimit:
    """A time [s] from the making of the limit on; None stands for no limit."""

    limit: float | None
    #: whether it applies: not before there is a result
    counts: bool = False
    begun: float = field(default_factory=monotonic)

    @property
    def is_up(self) -> bool:
        """Whether nothing further is to be begun."""
        return self.counts and self.limit is not None and monotonic() - self.begun > self.limit

    def of_diagnosis(self, own: float | None) -> float | None:
        """Return the time limit of the diagnosis, which may have its own."""
        share = inf if self.limit is None else OF_DIAGNOSIS * float(self.limit)
        least = min(share, inf if own is None else own)
        return None if least == inf else least


def said_of(limit: float | None, diagnosis, skipped: tuple[str, ...]) -> str | None:
    """Say what a time limit cut short, with a warning; None where nothing was."""
    parts = []
    if limit is not None and diagnosis is not None and not diagnosis.complete_:
        parts.append("the diagnosis ended with the best until then")
    if skipped:
        parts.append(f"not judged: {', '.join(skipped)}")
    if not parts:
        return None
    said = f"time limit of {limit:g} s: {'; '.join(parts)}"
    warn_user(f"{said}. Remedy: a longer time_limit, or fewer depths.")
    return said
