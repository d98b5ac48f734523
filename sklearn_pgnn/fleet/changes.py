"""What changed on the machines of a fleet since the last time."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.fleet.machine import Machine, acts
from sklearn_pgnn.fleet.spread import first_ones, standard_error
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.diagnosis_comparison import Quantity, compare
from sklearn_pgnn.inspection.numbers import measured

#: the names of the two times
NAMES = ("before", "now")


@dataclass(frozen=True)
class Change:
    """A change on a machine since the last time.

    Parameters
    ----------
    machine : str
        The machine.
    kind : {"cause", "gone", "verdict", "quantity"}
        A new cause, a cause that is gone, another verdict without either, or a parameter or size
        that differs.
    what : str
        The change in a sentence.
    sure : float
        Probability that the change is not due to chance: that the cause acts, or acted, or one
        minus the probability of so large a difference between two estimates of the same number;
        NaN for a verdict alone.

    Examples
    --------
    >>> change = Change("robot 12", "cause", "Coulomb friction on omega is new.", sure=0.98)
    >>> change.machine
    'robot 12'
    """

    machine: str
    kind: str
    what: str
    sure: float


def changes_between(
    before: Mapping[str, Machine], now: Iterable[Machine], rate: float
) -> tuple[Change, ...]:
    """Return what changed, the surest first."""
    pairs = [(before[m.name], m) for m in now if m.name in before and m.found is not None]
    pairs = [(old, new) for old, new in pairs if old.found is not None]
    found = [change for pair in pairs for change in _of_causes(*pair)]
    quantities = [
        (new.name, q) for old, new in pairs for q in compare(old.found, new.found).quantities
    ]
    chances = np.array([chance_of(q) for _, q in quantities])
    for (name, q), chance, chosen in zip(
        quantities, chances, first_ones(chances, rate), strict=True
    ):
        if chosen:
            one, other = (measured(*e, q.unit) for e in (q.one, q.other) if e is not None)
            said = f"{q.name}: {one} before, {other} now"
            found.append(Change(name, "quantity", said, float(1.0 - chance)))
    surest = sorted(found, key=lambda c: (math.isnan(c.sure), -c.sure, c.machine))
    return tuple(surest)


def chance_of(quantity: Quantity) -> float:
    r"""Return the probability of so large a difference between estimates of one number.

    .. math:: p = 2\,\Phi\!\left(-\frac{|a - b|}{\sqrt{s_a^2 + s_b^2}}\right)

    >>> round(chance_of(Quantity("m", "kg", (2.0, 1.9, 2.1), (2.0, 1.8, 2.2))), 3)
    1.0
    >>> chance_of(Quantity("m", "kg", (2.0, 1.9, 2.1), (3.0, 2.9, 3.1))) < 1e-9
    True
    """
    if quantity.one is None or quantity.other is None:
        return math.nan
    (a, *ends_a), (b, *ends_b) = quantity.one, quantity.other
    error = math.hypot(standard_error(*ends_a), standard_error(*ends_b))
    if not (math.isfinite(error) and error > 0):
        return math.nan
    return float(2 * norm.sf(abs(a - b) / error))


def _of_causes(old: Machine, new: Machine) -> list[Change]:
    """Return the causes that are new or gone, or else the change of the verdict."""
    found = []
    for kind, here, there in (("cause", new, old), ("gone", old, new)):
        for pair, cause in here.named.items():
            if not _has(there, pair, here.alike[pair]):
                word = "is newly named" if kind == "cause" else "is no longer named"
                found.append(Change(new.name, kind, f"{cause_name(*pair)} {word}", acts(cause)))
    if not found and old.verdict != new.verdict:
        one, other = VERDICTS[old.verdict].lower(), VERDICTS[new.verdict].lower()
        found.append(Change(new.name, "verdict", f"{one} before, {other} now", math.nan))
    return found


def _has(machine: Machine, pair: Candidate, alike: set[Candidate]) -> bool:
    """Return whether a machine has a cause, or one that it may be confused with."""
    return any(pair in theirs or named in alike for named, theirs in machine.alike.items())
