"""The report of a fleet: one HTML file, a row a machine, each leading to its own report."""

import math
from collections import Counter
from html import escape
from pathlib import Path
from urllib.parse import quote

import numpy as np

from sklearn_pgnn.fleet.machine import Machine
from sklearn_pgnn.fleet.spread import ParameterSpread
from sklearn_pgnn.fleet.store import PAGE, Store
from sklearn_pgnn.inspection.numbers import chance, measured, number, percent, sized
from sklearn_pgnn.inspection.report.page import style_sheet
from sklearn_pgnn.inspection.svg import Scale, dot, mark, scale_text, strip
from sklearn_pgnn.inspection.words import VERDICTS, cause_name

#: a verdict's words and its colour in the table
SAID = {**VERDICTS, "failed": "Not diagnosed"}
COLOUR = {"model_adequate": "good", "failed": "bad", "unexplained": "look"}
_STYLE = """
body { max-width: 78rem; }
.badge { white-space: nowrap; border-left: .3rem solid var(--blue); padding-left: .45rem; }
.badge.good { border-color: var(--good-bar); } .badge.look { border-color: var(--look-bar); }
.badge.bad { border-color: var(--bad-bar); }
.machines td { min-width: 6rem; overflow-wrap: anywhere; }
.tiles { grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); }
circle.like { fill: var(--gray); } circle.odd { fill: var(--orange); }
line.usual { stroke: var(--blue); stroke-width: 2; }
"""


def render_fleet(fleet, folder: Path) -> str:
    """Return the report of a fleet as HTML.

    Parameters
    ----------
    fleet : FleetDiagnosis
        The fitted fleet.
    folder : Path
        Where the report is going to be; pages of machines that are there are led to.

    Returns
    -------
    str
        The HTML text, which loads nothing else.
    """
    machines = list(fleet.machines_.values())
    title = f"{fleet.model.name}: {_count(len(machines), 'machine')}"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style_sheet()}{_STYLE}</style></head><body><main>"
        f"<h1>{escape(title)}</h1>{_tiles(machines)}{_changes(fleet)}{_table(fleet, folder)}"
        f"{_causes(fleet)}{_parameters(fleet)}</main></body></html>\n"
    )


def _tiles(machines: list[Machine]) -> str:
    counts = Counter(machine.verdict for machine in machines)
    tiles = (
        f'<li class="tile {COLOUR.get(verdict, "look")}"><h3>{escape(said)}</h3>'
        f"<strong>{counts[verdict]}</strong></li>"
        for verdict, said in SAID.items()
        if counts[verdict]
    )
    return f'<ul class="tiles">{"".join(tiles)}</ul>'


# -- what changed ----------------------------------------------------------------------------------


def _changes(fleet) -> str:
    if fleet.earlier is None:
        return ""
    rows = [
        (escape(c.machine), escape(c.what), "" if math.isnan(c.sure) else chance(c.sure))
        for c in fleet.changes_
    ]
    rows += [(escape(name), "was not there before", "") for name in fleet.new_]
    rows += [(escape(name), "is not there now", "") for name in fleet.missing_]
    if not rows:
        return "<h2>What changed</h2><p>Nothing that would stand out of chance.</p>"
    note = (
        f"<p class=soft>Of the parameters and sizes that are told, at most "
        f"{percent(fleet.rate)} differ by chance alone.</p>"
    )
    return f"<h2>What changed</h2>{note}{_rows(('Machine', 'What', 'How sure'), rows)}"


# -- a row a machine -------------------------------------------------------------------------------


def _table(fleet, folder: Path) -> str:
    odd: dict[str, list[str]] = {}
    for spread in fleet.parameters_.values():
        for name in spread.odd:
            odd.setdefault(name, []).append(_odd(spread, name))
    rows = [
        (
            _link(machine, folder),
            f'<span class="badge {COLOUR.get(machine.verdict, "")}">{SAID[machine.verdict]}</span>',
            _named(machine) or escape(machine.failed),
            chance(machine.sure) if machine.named else "",
            percent(machine.explained) if machine.named else "",
            "; ".join(odd.get(machine.name, ())),
            _faults(machine),
        )
        for machine in fleet.machines_.values()
    ]
    headers = (
        "Machine", "Verdict", "Causes", "How sure", "Explained", "Unlike the others", "Records",
    )  # fmt: skip
    note = (
        "<p class=soft>How sure: the probability that the cause, or one that the records do not "
        "tell from it, acts. Explained: share of the prior's error power above the noise.</p>"
    )
    return f"<h2>The machines, the surest first</h2>{note}{_rows(headers, rows, 'machines')}"


def _link(machine: Machine, folder: Path) -> str:
    page = Store(folder).place(machine.name) / PAGE
    if machine.found is None or not page.exists():
        return escape(machine.name)
    return f'<a href="{quote(page.relative_to(folder).as_posix())}">{escape(machine.name)}</a>'


def _named(machine: Machine) -> str:
    said = []
    for pair, cause in machine.named.items():
        sizes = (
            f"{name.replace('_', ' ')} {sized(*_ends(size), size['unit'])}"
            for name, size in cause["parameters"].items()
            if size["value"] is not None
        )
        said.append(escape(f"{cause_name(*pair)} ({chance(cause['probability'])}): ")
                    + escape(", ".join(sizes)))  # fmt: skip
    return "<br>".join(said)


def _ends(size) -> tuple[float, float, float]:
    low, high = (math.nan if size[end] is None else size[end] for end in ("low", "high"))
    return size["value"], low, high


def _odd(spread: ParameterSpread, name: str) -> str:
    value = measured(*spread.values[name], spread.unit)
    return escape(f"{spread.name} {value}, usually {number(spread.usual, 3)}")


def _faults(machine: Machine) -> str:
    if machine.found is None:
        return ""
    kinds = dict.fromkeys(finding["kind"] for finding in machine.found["data_quality"])
    said = [kind.replace("_", " ") for kind in kinds]
    if machine.found["stopped"]:
        said.append(f"stopped: {machine.found['stopped']}")
    return escape("; ".join(said))


# -- what the machines show together ---------------------------------------------------------------


def _causes(fleet) -> str:
    if not fleet.causes_:
        return ""
    rows = [
        (
            escape(cause_name(cause.effect, cause.target)),
            str(len(cause.machines)),
            str(len(cause.possible)),
            f"{percent(cause.low)} to {percent(cause.high)}",
            "belongs into the model that all share" if cause.is_of_the_model else "",
        )
        for cause in fleet.causes_
    ]
    headers = ("Cause", "Named on", "Possible on", "Of all such machines (95 %)", "")
    return f"<h2>Causes over the fleet</h2>{_rows(headers, rows)}"


def _parameters(fleet) -> str:
    if not fleet.parameters_:
        return ""
    rows = [
        (
            escape(spread.name),
            escape(f"{number(spread.prior)} {spread.unit}"),
            escape(f"{number(spread.usual)} {spread.unit}"),
            "the same on all" if spread.shared else escape(f"± {number(spread.spread, 2)}"),
            _strip(spread),
        )
        for spread in fleet.parameters_.values()
    ]
    note = (
        "<p class=soft>Every machine as a dot; the line is the median, orange is unlike the "
        "others.</p>"
    )
    headers = ("Parameter", "Given", "Usual", "Between machines", "")
    return f"<h2>Parameters over the fleet</h2>{note}{_rows(headers, rows)}"


def _strip(spread: ParameterSpread) -> str:
    values = np.array([value for value, _, _ in spread.values.values()])
    scale = Scale.over(values)
    shapes = [mark(float(scale.place(spread.usual)), "usual", "median")]
    for (name, (value, low, high)), at in zip(
        spread.values.items(), scale.place(values), strict=True
    ):
        css = "odd" if name in spread.odd else "like"
        shapes.append(dot(float(at), css, f"{name}: {measured(value, low, high, spread.unit)}"))
    return f"{strip(spread.name, shapes)}{scale_text(scale)}"


# -- HTML ------------------------------------------------------------------------------------------


def _rows(headers, rows, css: str = "") -> str:
    """Return a table; its cells are HTML already."""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in headers)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return (
        f'<div class="wide"><table class="{css}"><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
