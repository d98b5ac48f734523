"""One machine of a fleet, and the probability that a cause acts on it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

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

    Examples
    --------
    >>> acts({"probability": 0.5, "confused_with": [{"probability": 0.25}]})
    0.75
    >>> acts({"probability": None, "confused_with": []})  # provisional
    0.0
    """
    each = [cause["probability"], *(rival["probability"] for rival in cause["confused_with"])]
    return min(1.0, float(sum(probability or 0.0 for probability in each)))
