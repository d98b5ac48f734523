"""The causes named in a fleet, and on how many of its machines."""

from collections.abc import Iterable
from dataclasses import dataclass

from scipy.stats import binomtest

from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.fleet.machine import Machine


@dataclass(frozen=True)
class FleetCause:
    """A cause that is named on some machines.

    Parameters
    ----------
    effect, target : str
        Id of the effect in the catalogue, and what it acts on.
    machines : tuple of str
        The machines where it is named, the surest first.
    possible : tuple of str
        The machines where another cause is named and this one is not refuted in its place.
    low, high : float
        Ends of the 95 % interval (Wilson) of the share of machines of this kind where it is named.

    Examples
    --------
    >>> cause = FleetCause("leak", "h", ("tank 3", "tank 7"), ("tank 1",), low=0.01, high=0.03)
    >>> len(cause.machines), len(cause.possible)
    (2, 1)
    """

    effect: str
    target: str
    machines: tuple[str, ...]
    possible: tuple[str, ...]
    low: float
    high: float

    @property
    def is_of_the_model(self) -> bool:
        """Whether most machines have it, so that it belongs in the model they share."""
        return self.low > 0.5


def common_causes(machines: Iterable[Machine]) -> tuple[FleetCause, ...]:
    """Return the causes that are named in a fleet, the most frequent first.

    Examples
    --------
    >>> found = {"verdict": "cause_named", "gain": {}, "causes": [
    ...     {"effect": "input_bias", "target": "F", "probability": 1.0, "confused_with": []}]}
    >>> (bias,) = common_causes([Machine(str(k), found) for k in range(9)])
    >>> bias.machines, bias.is_of_the_model
    (('0', '1', '2', '3', '4', '5', '6', '7', '8'), True)
    """
    told = [machine for machine in machines if machine.found is not None]
    pairs = dict.fromkeys(pair for machine in told for pair in machine.named)
    causes = []
    for pair in pairs:
        named = tuple(m.name for m in told if pair in m.named)
        rivals = tuple(m.name for m in told if pair not in m.named and _may_have(m, pair))
        share = binomtest(len(named), len(told)).proportion_ci(method="wilson")
        causes.append(FleetCause(*pair, named, rivals, float(share.low), float(share.high)))
    return tuple(sorted(causes, key=lambda cause: -len(cause.machines)))


def _may_have(machine: Machine, pair: Candidate) -> bool:
    return any(pair in alike for alike in machine.alike.values())
