"""The parameters in a report: what became of them, how far they moved, what hides what."""

import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from sklearn_pgnn.inspection.numbers import measured, number, typeset_unit
from sklearn_pgnn.inspection.svg import Scale, dot, mark, scale_text, span, strip, whisker
from sklearn_pgnn.simulation.uncertainty import correlations
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows

#: correlation from which on two parameters are named, and shades of a colour
TIGHT, SHADES = 0.9, 5


@dataclass(frozen=True)
class ParameterFacts:
    """What became of the free parameters of a model and of its causes.

    The interval of those `changed` leaves the value out that was given; those `at_limit` are at the
    end of what the fit allowed, of the model or of a cause. The fit held those `held` where they
    were: beside the others the records do not fix them. Nor do they fix those `open`, whose
    interval is not finite, or all that their bounds allow.
    """

    changed: tuple[str, ...]
    at_limit: tuple[str, ...]
    held: tuple[str, ...]
    open: tuple[str, ...]

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Those that the records do not fix."""
        return tuple(dict.fromkeys((*self.held, *self.open)))


def parameter_facts(diagnosis) -> ParameterFacts:
    """Return what became of the parameters."""
    fit, found = diagnosis.records_.fits[diagnosis.records_.best], diagnosis.parameters_
    free = {freedom.name: freedom for freedom in fit.freedoms}
    value = {name: parameter.value for name, parameter in fit.model.parameters.items()}
    value |= {name: parameter.value for name, parameter in found.items()}
    limited = (n for n, f in free.items() if not f.low < value[n] < f.high)
    whole = {n: p.bounds for n, p in fit.model.parameters.items() if n in free}
    unfixed = (
        n
        for n, p in found.items()
        if not math.isfinite(p.high - p.low) or (p.low, p.high) == whole.get(n)
    )
    return ParameterFacts(
        changed=tuple(name for name, p in found.items() if p.changed),
        at_limit=tuple(limited),
        held=tuple(name for name in found if name not in free),
        open=tuple(unfixed),
    )


def forest(diagnosis) -> dict:
    """Return the parameters of a diagnosis as rows with strips, in percent of the given value."""
    facts, found = parameter_facts(diagnosis), diagnosis.parameters_
    freedoms = {f.name: f for f in diagnosis.records_.fits[diagnosis.records_.best].freedoms}
    moves = [
        100.0 * (end / p.prior - 1.0)
        for name, p in found.items()
        if p.prior
        for end in ((p.value,) if name in facts.open else (p.value, p.low, p.high))
        if math.isfinite(end)
    ]
    reach = 1.1 * max([1e-3, *map(abs, moves)])
    scale = Scale(-reach, reach)
    rows = [_row(scale, name, p, freedoms.get(name), facts) for name, p in found.items()]
    return {"rows": rows, "ticks": scale_text(scale)}


def _row(scale: Scale, name: str, p, freedom, facts: ParameterFacts) -> dict:
    state, css = _state(name, facts)
    change = f"{round(100 * (p.value / p.prior - 1), 1) or 0.0:+.1f} %" if p.prior else "-"
    return {
        "name": name,
        "prior": number(p.prior),
        "value": measured(p.value, p.low, p.high, typeset_unit(p.unit)),
        "change": change,
        "state": state,
        "css": css,
        "picture": _strip(scale, name, p, freedom, css, facts) if p.prior else "",
    }


def _state(name: str, facts: ParameterFacts) -> tuple[str, str]:
    """Return what is to be said of a parameter, and whether it changed or is to be looked at."""
    look = [
        text
        for text, names in (
            ("at its limit", facts.at_limit),
            ("held: the records do not fix it", facts.held),
            ("open: the records do not fix it", facts.open),
        )
        if name in names
    ]
    if look:
        return "; ".join(look), "look"
    return ("changed", "changed") if name in facts.changed else ("not\u00a0significant", "")


def _strip(scale: Scale, name: str, p, freedom, css: str, facts: ParameterFacts) -> Markup:
    def at(value):
        return float(scale.place(100.0 * (value / p.prior - 1.0)))

    shapes = [mark(float(scale.place(0.0)), "zero-mark", "as given")]
    if freedom is not None and math.isfinite(freedom.high - freedom.low):
        ends = sorted((at(freedom.low), at(freedom.high)))
        shapes.insert(0, span(ends[0], ends[1], "allowed", "what the fit allowed"))
    said = measured(p.value, p.low, p.high, typeset_unit(p.unit))
    if name not in facts.open:
        low, high = sorted((at(p.low), at(p.high)))
        shapes.append(whisker(low, high, "whisker", said))
    shapes.append(dot(at(p.value), "named" if css == "look" else "candidate", f"{name}: {said}"))
    return strip(f"{name}: {said}", shapes)


def correlation(diagnosis) -> dict | None:
    """Return the correlations of fitted parameters; None where there are less than two."""
    fit = fitted_again(diagnosis)
    names = [freedom.name for freedom in fit.freedoms]
    if len(names) < 2:
        return None
    records = diagnosis.records_
    expected = records.problem.states.expected_starts(fit.model, records.windows)
    found = correlations(fit, *expected)
    rows = [(names[i], [_cell(found[i, j]) for j in range(i)]) for i in range(1, len(names))]
    tight = [
        f"{names[j]} and {names[i]} ({_signed(found[i, j])})"
        for i in range(len(names))
        for j in range(i)
        if abs(found[i, j]) > TIGHT
    ]
    return {"names": names[:-1], "rows": rows, "tight": tight}


def fitted_again(diagnosis) -> WindowFit:
    """Return the model with all that was found, with its evaluation where it stands."""
    records = diagnosis.records_
    best = records.fits[records.best]
    expected = records.problem.states.expected_starts(best.model, records.windows)
    options = {"x0_start": best.x0, "max_steps": 0}
    return fit_windows(best.model, records.windows, best.freedoms, *expected, **options)


def _cell(value: float) -> dict[str, str]:
    if not math.isfinite(value):
        return {"text": "-", "css": ""}
    shade = min(int(SHADES * abs(value)), SHADES - 1)
    sign = "with" if value > 0 else "against"
    return {"text": _signed(value), "css": f"{sign} shade-{shade}" if shade else ""}


def _signed(value: float) -> str:
    """Return a correlation with two digits and a minus sign.

    >>> _signed(-0.954), _signed(0.999), _signed(0.001)
    ('−0.95', '1.00', '0')
    """
    text = f"{np.clip(value, -1.0, 1.0):.2f}".replace("-", "−")
    return "0" if float(text.replace("−", "-")) == 0 else text
