"""What came of a case: the right port and effect, a wrong port said surely, or between."""

import time
import warnings
from dataclasses import asdict, dataclass

from cases import Case, make

from sklearn_pgnn import ModelDiagnosis

#: right: named alone; group: right, though others do as well, or several that are the same law;
#: place: another effect at the right port; missed: nothing named; wrong: another port; adequate and
#: false: of nothing hidden
OUTCOMES = ("right", "group", "place", "missed", "wrong", "adequate", "false", "failed")
#: a wrong port is said surely above this probability
SURE = 0.9


@dataclass(frozen=True)
class Outcome:
    """What came of a case; `sure` are wrong ports with a probability above `SURE`."""

    machine: str
    number: int
    seed: int
    hidden: str
    said: str
    outcome: str
    verdict: str
    sure: list
    seconds: float

    @property
    def case(self) -> Case:
        """The case."""
        return Case(self.machine, self.number, self.seed)

    def to_dict(self) -> dict:
        """Return it as plain data."""
        return asdict(self)


def run(case: Case, **options) -> Outcome:
    """Diagnose a case; a diagnosis that ends in an error has failed."""
    warnings.simplefilter("ignore")
    records, start = make(case), time.process_time()
    what = case.hidden
    truth = "nothing" if what is None else f"{what.effect} ({what.target})"
    key = (case.machine, case.number, case.seed, truth)
    try:
        found = ModelDiagnosis(records.prior, n_jobs=1, **options).fit(records.X, records.y)
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        return Outcome(*key, said, "failed", "", [], _since(start))
    causes = found.causes_
    said = ", ".join(f"{c.effect} ({c.target}) {c.probability:.3f}" for c in causes) or "nothing"
    outcome = judge(what, found)
    return Outcome(*key, said, outcome, found.verdict_, _sure(what, causes), _since(start))


def _since(start: float) -> float:
    return round(time.process_time() - start, 2)


def judge(what, found) -> str:
    """Judge a diagnosis; a cause that is neither the right one nor a part of it makes it wrong."""
    causes = found.causes_
    if what is None:
        well = found.verdict_ in ("model_adequate", "nothing_found") and not causes
        return "adequate" if well else "false"
    if not causes:
        return "missed"
    if len(causes) > 1:
        return "group" if what.is_sum_of([*map(_may_be, causes)]) else "wrong"
    (cause,) = causes
    if (cause.effect, cause.target) in what.accepted:
        return "group" if cause.confused_with else "right"
    if what.accepted & _may_be(cause):
        return "group"
    return "place" if cause.target in what.places else "wrong"


def _may_be(cause) -> set[tuple[str, str]]:
    """Return a cause and what it is confused with."""
    return {(each.effect, each.target) for each in (cause, *cause.confused_with)}


def _sure(what, causes) -> list[str]:
    """Return causes at wrong ports that are said surely."""
    places = set() if what is None else what.places
    return [c.target for c in causes if c.probability > SURE and c.target not in places]
