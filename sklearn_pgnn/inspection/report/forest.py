"""Parameters as a forest plot: how far each moved from what was given, with its interval."""

import math
from dataclasses import dataclass

from markupsafe import Markup

from sklearn_pgnn.inspection.numbers import measured, number, typeset_unit
from sklearn_pgnn.inspection.report.parameter_facts import ParameterFacts, parameter_facts
from sklearn_pgnn.inspection.svg import Scale, dot, mark, scale_text, span, strip, whisker


@dataclass(frozen=True)
class ParameterRow:
    """A parameter of the prior.

    `state` is what is to be said of it, `css` whether it changed or is to be looked at; its strip
    is empty where it cannot be drawn.
    """

    name: str
    prior: str
    value: str
    change: str
    state: str
    css: str
    picture: Markup


@dataclass(frozen=True)
class Forest:
    """The parameters.

    The axis is in percent of the given value.
    """

    rows: list[ParameterRow]
    ticks: Markup


def forest(diagnosis) -> Forest:
    """Return the parameters of a diagnosis as rows with strips."""
    facts, found = parameter_facts(diagnosis), diagnosis.parameters_
    freedoms = {f.name: f for f in diagnosis.records_.fits[diagnosis.records_.best].freedoms}
    moves = [
        100.0 * (end / p.prior - 1.0)
        for p in found.values()
        if p.prior
        for end in (p.value, p.low, p.high)
        if math.isfinite(end)
    ]
    reach = 1.1 * max([1e-3, *map(abs, moves)])
    scale = Scale(-reach, reach)
    rows = [_row(scale, name, p, freedoms.get(name), facts) for name, p in found.items()]
    return Forest(rows, scale_text(scale))


def _row(scale: Scale, name: str, p, freedom, facts: ParameterFacts) -> ParameterRow:
    change = f"{round(100 * (p.value / p.prior - 1), 1) or 0.0:+.1f} %" if p.prior else "-"
    state, css = _state(name, facts)
    value = measured(p.value, p.low, p.high, typeset_unit(p.unit))
    picture = _strip(scale, name, p, freedom, css) if p.prior else Markup("")
    return ParameterRow(name, number(p.prior), value, change, state, css, picture)


def _state(name: str, facts: ParameterFacts) -> tuple[str, str]:
    said = [
        ("at its limit", name in facts.at_limit),
        ("held: the records do not fix it", name in facts.held),
        ("open: the records do not fix it", name in facts.open),
    ]
    look = [text for text, holds in said if holds]
    if look:
        return "; ".join(look), "look"
    return ("changed", "changed") if name in facts.changed else ("not significantly", "")


def _strip(scale: Scale, name: str, p, freedom, css: str) -> Markup:
    def at(value):
        return float(scale.place(100.0 * (value / p.prior - 1.0)))

    shapes = [mark(float(scale.place(0.0)), "zero-mark", "as given")]
    if freedom is not None and math.isfinite(freedom.high - freedom.low):
        ends = sorted((at(freedom.low), at(freedom.high)))
        shapes.insert(0, span(ends[0], ends[1], "allowed", "what the fit allowed"))
    said = measured(p.value, p.low, p.high, typeset_unit(p.unit))
    if math.isfinite(p.high - p.low):
        low, high = sorted((at(p.low), at(p.high)))
        shapes.append(whisker(low, high, "whisker", said))
    shapes.append(dot(at(p.value), "named" if css == "look" else "candidate", f"{name}: {said}"))
    return strip(f"{name}: {said}", shapes)
