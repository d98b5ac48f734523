"""The characteristic of every cause: points of the records, its law, rivals thin beside."""

from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup

from sklearn_pgnn.inspection.case import Case, make_case
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.curves import Evidence, Line
from sklearn_pgnn.inspection.display import binned_median, limits
from sklearn_pgnn.inspection.evidence import evidence_of, missing_evidence
from sklearn_pgnn.inspection.report.members import Member
from sklearn_pgnn.inspection.svg import Plot, Scale

#: points of a cloud that are drawn
CLOUD = 1500


@dataclass(frozen=True)
class Characteristic:
    """A characteristic as it is drawn.

    `keys` are class and name of everything that is drawn.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    note: str
    keys: tuple[tuple[str, str], ...]
    plot: Markup


def characteristics(diagnosis, members: dict[int, list[Member]]) -> list[Characteristic]:
    """Return the characteristics of the causes, and of what no cause explains."""
    drawn = []
    for number, cause in enumerate(diagnosis.causes_):
        case = make_case(diagnosis, cause)
        evidence, rivals = evidence_of(case), members.get(number, [])[1:]
        beside = [line for rival in rivals for line in _beside(evidence, case, rival)]
        drawn.append(_draw(cause_name(cause.effect, cause.target), evidence, beside))
    if diagnosis.discrepancy_ is not None:
        drawn.append(_draw("what no cause explains", missing_evidence(diagnosis), []))
    return drawn


def _beside(evidence: Evidence, case: Case, rival: Member) -> list[Line]:
    """Return the law of a rival, where it is drawn over the same."""
    model = rival.fit.model
    if list(model.states) != list(case.full.states):
        return []
    known = {n: p.value for n, p in model.parameters.items() if n in case.without.parameters}
    records = replace(case.records, fits={**case.records.fits, "extended": rival.fit})
    other = evidence_of(Case(records, model, case.without.with_parameters(**known), rival.effect))
    if (other.x_label, other.y_label) != (evidence.x_label, evidence.y_label):
        return []
    return [replace(other.lines[-1], whose="rival", label=rival.name)]


def _draw(name: str, evidence: Evidence, beside: list[Line]) -> Characteristic:
    lines = [*beside, *evidence.lines]
    x_values = [line.x for line in evidence.lines]
    y_values = [line.y for line in lines]
    keys: list[tuple[str, str]] = [(line.whose, line.label) for line in lines]
    if evidence.points is not None:
        x, y = (np.asarray(part, dtype=float) for part in evidence.points)
        good = np.isfinite(x) & np.isfinite(y)
        x, y = x[good], y[good]
        x_values.append(x)
        y_values = [np.array(limits(y, lines))]
    plot = Plot(Scale.over(*x_values, room=0.02), Scale.over(*y_values, room=0.02), evidence.title)
    if evidence.points is not None:
        few = slice(None, None, max(1, x.size // CLOUD))
        plot.points(x[few], y[few], "cloud", "records")
        keys.insert(0, ("cloud", "records"))
    for line in lines:
        plot.line(line.x, line.y, line.whose, line.label)
    if evidence.points is not None and np.any(np.diff(x) <= 0):
        centres, medians = binned_median(x, y)
        plot.points(centres, medians, "median", "their median")
        keys.append(("median", "their median"))
    return Characteristic(
        name,
        evidence.title,
        evidence.x_label,
        evidence.y_label,
        evidence.note,
        tuple(keys),
        plot.html(),
    )
