"""One machine of a fleet, the probability that a cause acts on it, and the causes of many."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from scipy.stats import binomtest

from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.estimation.candidate import Candidate

FAILED = "Not diagnosed"
#: the verdicts in words, with an entry for no verdict
SAID = (*VERDICTS.values(), FAILED)
#: the order of verdicts in a fleet
ORDER = (*VERDICTS, "failed")


@dataclass(frozen=True)
class Machine:
    """The results of one machine.

    Parameters
    ----------
    name : str
        Its name.
    found : mapping or None
        The result of `ModelDiagnosis.to_dict`; None where the records could not be used.
    failed : str, default=""
        Why there is no diagnosis.
    seconds : float, default=0
        Processor time that the diagnosis took [s].
    warned : tuple of str, default=()
        Warnings about the records.

    Examples
    --------
    >>> Machine("pump 7", None, "no time in the file").verdict
    'failed'
    """

    name: str
    found: Mapping | None = field(repr=False)
    failed: str = ""
    seconds: float = 0.0
    warned: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """The verdict, as `ModelDiagnosis.verdict_`, or ``"failed"``."""
        return "failed" if self.found is None else self.found["verdict"]

    @property
    def said(self) -> str:
        """The verdict in words, one of `SAID`."""
        return FAILED if self.found is None else VERDICTS[self.verdict]

    @property
    def named(self) -> dict[Candidate, Mapping]:
        """The named causes by effect and target, the most important first."""
        causes = () if self.found is None else self.found["causes"]
        return {Candidate(cause["effect"], cause["target"]): cause for cause in causes}

    @property
    def alike(self) -> dict[Candidate, set[Candidate]]:
        """For every named cause, itself and those that the records do not separate from it."""
        return {
            pair: {pair, *(Candidate(r["effect"], r["target"]) for r in cause["confused_with"])}
            for pair, cause in self.named.items()
        }

    @property
    def sure(self) -> float:
        """Probability that a cause, or a rival in its place, acts; 0 where none was tested."""
        return max(map(acts, self.named.values()), default=0.0)

    @property
    def rank(self) -> tuple:
        """Sort key of machines, the surest first."""
        first = next(iter(self.named.values()), None)
        alone = 0.0 if first is None else first["probability"] or 0.0
        return ORDER.index(self.verdict), -self.sure, -alone, -self.explained, self.name

    @property
    def explained(self) -> float:
        """Largest share of an output's error power that the extension explains."""
        gains = () if self.found is None else self.found["gain"].values()
        return max((gain["explained_share"] or 0.0 for gain in gains), default=0.0)


def acts(cause: Mapping) -> float:
    """Return the probability that a cause of `ModelDiagnosis.to_dict`, or a rival of it, acts.

    >>> acts({"probability": 0.5, "confused_with": [{"probability": 0.25}]})
    0.75
    >>> acts({"probability": None, "confused_with": []})  # provisional
    0.0
    """
    each = [cause["probability"], *(rival["probability"] for rival in cause["confused_with"])]
    return min(1.0, float(sum(probability or 0.0 for probability in each)))


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
        rivals = tuple(
            m.name
            for m in told
            if pair not in m.named and any(pair in alike for alike in m.alike.values())
        )
        share = binomtest(len(named), len(told)).proportion_ci(method="wilson")
        causes.append(FleetCause(*pair, named, rivals, float(share.low), float(share.high)))
    return tuple(sorted(causes, key=lambda cause: -len(cause.machines)))
