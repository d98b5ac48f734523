"""HTML representations of a model, an effect, a cause and a diagnosis for notebooks."""

import re
from html import escape

from sklearn.base import BaseEstimator

from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.inspection.case import model_with_all
from sklearn_pgnn.inspection.cause_names import cause_name, sizes_of
from sklearn_pgnn.inspection.equations import equations_of
from sklearn_pgnn.inspection.numbers import (
    chance,
    free_run_error,
    least_size,
    number,
    share,
    typeset_unit,
)
from sklearn_pgnn.inspection.words import (
    remaining_sentence,
    rivals_or_none,
    verdict_sentence,
)
from sklearn_pgnn.inspection.yardstick import shown_models
from sklearn_pgnn.physics.effects import find_effect

_CELL = "text-align: left; padding: 0 1em 0 0"


def model_html(model) -> str:
    """Return a model as escaped HTML: its equations, and its quantities with their units.

    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> "cart on a spring" in model_html(cart_on_spring())
    True
    """
    equations = "".join(
        f"<div style='padding-bottom:.5em'>{shown}</div>"
        for each in equations_of(model, model)
        for shown in [each.mathml or f"<code>{escape(each.text)}</code>"]
    )
    signals = [
        (name, kind, typeset_unit(model.unit(name)) or "-")
        for kind in ("state", "input", "output")
        for name in getattr(model, f"{kind}s")
    ]
    rows = [
        (name, number(p.value), typeset_unit(p.unit) or "-", "known" if p.fixed else "free")
        for name, p in model.parameters.items()
    ]
    parameters = _table(("parameter", "value", "unit", ""), rows) if rows else ""
    return _box(
        f"<b>{escape(model.name)}</b>{equations}",
        _table(("signal", "", "unit"), signals) + parameters,
    )


def model_latex(model) -> str:
    """Return the equations of a model as LaTeX, to be shown on lines of their own."""
    return f"$$\n{model.to_latex()}\n$$"


def effect_html(effect) -> str:
    """Return an effect as HTML: its description and its quantities.

    >>> from sklearn_pgnn.physics.effects import InputBias
    >>> effect_html(InputBias("torque", bias=0.1)).count("input bias of torque")
    1
    """
    rows = [
        (f.name.replace("_", " "), effect.names()[f.name], number(getattr(effect, f.name)))
        for f in effect.quantities()
    ]
    about = " ".join(filter(None, (effect.summary, effect.check and f"Check: {effect.check}")))
    return _box(
        f"<b>{escape(effect.title(effect.target))}</b><div>{escape(about)}</div>",
        _table(("quantity", "symbol", "value"), rows) if rows else "",
    )


def effect_latex(effect) -> str | None:
    r"""Return the law of an effect as LaTeX, from its documentation; None where it has none.

    >>> from sklearn_pgnn.physics.effects import ViscousFriction
    >>> effect_latex(ViscousFriction("v"))
    '$F = d\\,v$'
    """
    first = (getattr(effect, "__doc__", None) or "").split("Parameters\n")[0]
    found = re.search(r":math:`([^`]+)`", first)
    return None if found is None else f"${' '.join(found[1].split())}$"


def cause_html(cause, complete: bool = True) -> str:
    """Return a named cause as HTML; whether it was compared with others, `complete` says."""
    rows = (
        *sizes_of(cause).items(),
        ("error on held-out windows", f"{-cause.gain:+.0f} %"),
        ("probability", chance(cause.probability)),
        ("confused with", rivals_or_none(cause, complete)),
        ("check on the rig", cause.check or "-"),
    )
    name = escape(cause_name(cause.effect, cause.target))
    return _box(f"<b>{name}</b><div>{escape(cause.summary)}</div>", _table((), rows))


def cause_latex(cause) -> str | None:
    """Return the law of a cause's effect as LaTeX; None where it has none."""
    return effect_latex(find_effect(cause.effect))


def diagnosis_html(diagnosis) -> str:
    """Return a diagnosis as HTML: before the fit its settings, then its verdict."""
    if not hasattr(diagnosis, "verdict_"):
        return BaseEstimator._html_repr(diagnosis)
    head = (
        f"<b>{VERDICTS[diagnosis.verdict_]}.</b> {escape(verdict_sentence(diagnosis))}"
        f"<div>{escape(remaining_sentence(diagnosis))}</div>"
    )
    causes = "".join(cause_html(cause, diagnosis.complete_) for cause in diagnosis.causes_)
    shown = shown_models(diagnosis)
    titles = ("error (rms)", *shown.values(), "noise", "unit", "explained")
    rows = []
    for name, g in diagnosis.gain_.items():
        errors = (number(getattr(g, which), 3) for which in (*shown, "noise"))
        rows.append((f"{name}, windows", *errors, typeset_unit(g.unit) or "-", share(g)))
    for name, run in diagnosis.free_run_.items():
        errors = (free_run_error(getattr(run, which)) for which in shown)
        unit = typeset_unit(diagnosis.model.unit(name)) or "-"
        rows.append((f"{name}, free run", *errors, "", unit, ""))
    return _box(head, causes + _table(titles, rows))


def diagnosis_latex(diagnosis) -> str | None:
    """Return the equations of all that was found as LaTeX; None before the fit."""
    if not hasattr(diagnosis, "verdict_"):
        return None
    return model_latex(model_with_all(diagnosis))


def detectability_html(detectability) -> str:
    """Return a detectability as HTML: the smallest size of every effect, or why there is none."""
    rows = [
        (
            cause_name(row.effect, row.target),
            row.parameter.replace("_", " "),
            row.reason or least_size(row, 3),
        )
        for row in detectability.rows
    ]
    title = f"named with probability {100 * detectability.power:.0f} % from"
    return _box("<b>Detectability</b>", _table(("effect", "quantity", title), rows))


def _box(head: str, rest: str) -> str:
    return f'<div style="margin: 0.4em 0">{head}{rest}</div>'


def _table(titles, rows) -> str:
    """Return a table; every cell is escaped."""
    head = "".join(f'<th style="{_CELL}">{escape(str(t))}</th>' for t in titles)
    body = "".join(
        "<tr>" + "".join(f'<td style="{_CELL}">{escape(str(cell))}</td>' for cell in row) + "</tr>"
        for row in rows
    )
    top = f"<thead><tr>{head}</tr></thead>" if head else ""
    return f"<table>{top}<tbody>{body}</tbody></table>"
