"""What came of a diagnosis, judged by what was hidden."""

import itertools
import time
import warnings
from dataclasses import asdict, dataclass

from cases import Case, make
from laws import laws_of
from machines import MACHINES

from sklearn_pgnn import ModelDiagnosis
from sklearn_pgnn.effects import by_id
from sklearn_pgnn.estimation.same_in_equations import same_parameter

OUTCOMES = ("named", "group", "absorbed", "missed", "wrong", "failed")
#: share of the error power above the sensors' noise that counts as only noise
LEFT = 0.05


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Parameters
    ----------
    kind, machine, detail : str
        See `cases.Case`.
    seed : int
        Its seed.
    hidden, said : str
        What was hidden, and causes and verdict.
    outcome : str
        One of `OUTCOMES`.
    verdict : str
        The verdict.
    group : int
        Members of the largest group said to be inseparable; 1 for a name without doubt.
    covered, intervals : int
        Intervals of rightly named effects with the truth inside, and all of them.
    chances : list of (float, bool)
        Probabilities of the named causes and of what may be in their places, and whether each is
        what was hidden.
    seconds : float
        Time the diagnosis took [s].
    """

    kind: str
    machine: str
    detail: str
    seed: int
    hidden: str
    said: str
    outcome: str
    verdict: str
    group: int
    covered: int
    intervals: int
    chances: list
    seconds: float

    @property
    def case(self) -> Case:
        """The case."""
        return Case(self.kind, self.machine, self.detail, self.seed)

    def to_dict(self) -> dict:
        """Return it as plain data."""
        return asdict(self)


def run(case: Case) -> Outcome:
    """Diagnose a case; a diagnosis that ends in an error has failed."""
    warnings.simplefilter("ignore")
    hidden = make(case)
    truth = ", ".join(f"{e.id} ({e.target})" for e in hidden.effects)
    start = time.process_time()
    try:
        diagnosis = ModelDiagnosis(hidden.prior, n_jobs=1).fit(hidden.X, hidden.y)
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        return Outcome(*_key(case), truth, said, "failed", "", 0, 0, 0, [], _since(start))
    seconds = _since(start)
    groups = [
        {(c.effect, c.target), *((o.effect, o.target) for o in c.confused_with)}
        for c in diagnosis.causes_
    ]
    names = [f"{cause.effect} ({cause.target})" for cause in diagnosis.causes_]
    inside = _inside(diagnosis, hidden)
    return Outcome(
        *_key(case),
        truth,
        f"{', '.join(names) or 'nothing'}; {diagnosis.verdict_}",
        judge(case, diagnosis, hidden, groups),
        diagnosis.verdict_,
        max(map(len, groups), default=0),
        sum(inside),
        len(inside),
        _chances(diagnosis, hidden),
        seconds,
    )


def _key(case):
    return case.kind, case.machine, case.detail, case.seed


def _since(start) -> float:
    return round(time.process_time() - start, 2)


def judge(case, diagnosis, hidden, groups) -> str:
    """Judge a diagnosis.

    Where nothing is hidden, and for a disturbance, *named* means that no cause is named and, of a
    right model, that it is called adequate. For a law beyond the catalogue it means ``unexplained``
    in the right equation, or a cause that is just this law: the catalogue has grown since the laws
    were chosen.
    """
    kind = case.kind
    if kind == "nothing":
        return (
            "named" if diagnosis.verdict_ in ("model_adequate", "nothing_found") else _false(groups)
        )
    if kind == "disturbance":
        return "wrong" if groups else "named"
    if kind == "law":
        return _judge_law(diagnosis, hidden)
    truth = _truth(hidden)
    groups = [group for group in groups if not group & _special_cases(hidden)]
    matched = _matched(groups, truth)
    if matched < len(groups):
        return "wrong"
    if matched < len(truth):
        return "absorbed" if _leaves_noise(diagnosis, case) else "missed"
    return "named" if max(map(len, groups), default=1) == 1 else "group"


def _truth(hidden) -> set[tuple[str, str]]:
    """Return the names of what was hidden."""
    return {_as_named(hidden.prior, effect) for effect in hidden.effects}


def _special_cases(hidden) -> set[tuple[str, str]]:
    """Return the special cases of hidden effects: to name one is no mistake if it leaves noise."""
    return {(special, effect.target) for effect in hidden.effects for special in effect.generalises}


def _false(groups) -> str:
    """Return what it is called if a right model is not adequate: a false name, or none."""
    return "wrong" if groups else "missed"


def _judge_law(diagnosis, hidden) -> str:
    law = laws_of(hidden.effect, hidden.prior)
    causes = [by_id(cause.effect)(cause.target) for cause in diagnosis.causes_]
    if len(causes) == 1 and law <= laws_of(causes[0], hidden.prior):
        return "named"
    if diagnosis.verdict_ == "unexplained":
        part = diagnosis.discrepancy_
        return "named" if part and part.target == hidden.effect.target else "missed"
    return "wrong" if diagnosis.causes_ else "absorbed"


def _as_named(model, effect) -> tuple[str, str]:
    """Return an effect's name; the parameter's if a free one already is the effect."""
    parameter = same_parameter(model, effect)
    return (effect.id, effect.target) if parameter is None else ("wrong_parameter", parameter)


def _matched(groups, truth) -> int:
    """Return the number of hidden causes that can be told, each in a group of its own."""
    orders = itertools.permutations(truth, min(len(groups), len(truth)))
    return max(sum(c in g for c, g in zip(order, groups, strict=False)) for order in orders)


def _leaves_noise(diagnosis, case) -> bool:
    """Return whether no output has more left than the noise that its sensor was given."""
    noise = MACHINES[case.machine].noise
    left = [gain.extended for gain in diagnosis.gain_.values()]
    return all(each**2 - noise**2 < LEFT * each**2 for each in left)


def _chances(diagnosis, hidden) -> list[tuple[float, bool]]:
    """Return the probabilities of causes and rivals, and whether each is right."""
    right = _truth(hidden) | _special_cases(hidden)
    every = [each for cause in diagnosis.causes_ for each in (cause, *cause.confused_with)]
    return [(float(each.probability), (each.effect, each.target) in right) for each in every]


def _inside(diagnosis, hidden) -> list[bool]:
    """Return for every parameter of rightly named effects whether its interval is right."""
    truth = {(effect.id, effect.target): effect for effect in hidden.effects}
    found = []
    for cause in diagnosis.causes_:
        effect = truth.get((cause.effect, cause.target))
        values = cause.parameters.items() if effect is not None else ()
        found += [bool(e.low <= getattr(effect, name) <= e.high) for name, e in values]
    return found
