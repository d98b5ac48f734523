"""The report of a fleet: one HTML file with one row per machine, each linked to its own report."""

import math
from collections import Counter
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.fleet.machine import FAILED, SAID, FleetCause, Machine
from sklearn_pgnn.fleet.one_machine import PAGE, Store
from sklearn_pgnn.fleet.spread import ParameterSpread
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import (
    chance,
    measured,
    number,
    percent,
    sized,
    typeset_unit,
)
from sklearn_pgnn.inspection.report.page import digest, render, style_sheet
from sklearn_pgnn.inspection.svg import Scale, dot, mark, scale_text, strip
from sklearn_pgnn.record_quality.finding import listed

if TYPE_CHECKING:
    from sklearn_pgnn.fleet.fleet_diagnosis import FleetDiagnosis

#: a verdict's colour
COLOUR = {VERDICTS["model_adequate"]: "good", FAILED: "bad"}
HEADERS = ("Machine", "Verdict", "Causes", "How sure", "Explained", "Unlike the others", "Records")


def render_fleet(fleet: "FleetDiagnosis", folder: Path) -> str:
    """Return the report of a fleet as HTML, which links the machines' reports in its folder."""
    machines = list(fleet.machines_.values())
    style = style_sheet() + _source("fleet.css")
    content = {
        "title": f"{fleet.model.name}: {len(machines)} machine{'s' * (len(machines) != 1)}",
        "style": style,
        "style_digest": digest(style),
        "tiles": _tiles(machines),
        "changes": _changes(fleet),
        "rate": percent(fleet.rate),
        "headers": HEADERS,
        "machines": [_row(machine, fleet, folder) for machine in machines],
        "causes": list(map(_cause, fleet.causes_)),
        "parameters": list(map(_parameter, fleet.parameters_.values())),
    }
    return render(_source, "fleet.html.j2", content)


def _source(name: str) -> str:
    return files("sklearn_pgnn.fleet").joinpath("templates", name).read_text(encoding="utf-8")


def _tiles(machines: list[Machine]) -> list[dict]:
    counts = Counter(machine.said for machine in machines)
    told = (said for said in SAID if counts[said])
    return [{"css": _colour(said), "said": said, "count": counts[said]} for said in told]


def _colour(said: str) -> str:
    return COLOUR.get(said, "look")


def _changes(fleet: "FleetDiagnosis") -> list[dict] | None:
    """Return the changes; None where there is no earlier fit."""
    if fleet.earlier is None:
        return None
    told = [
        (c.machine, c.what, "" if math.isnan(c.sure) else chance(c.sure)) for c in fleet.changes_
    ]
    told += [(name, "is new", "") for name in fleet.new_]
    told += [(name, "is no longer among the records", "") for name in fleet.missing_]
    return [{"machine": machine, "what": what, "sure": sure} for machine, what, sure in told]


# -- a row a machine -------------------------------------------------------------------------------


def _row(machine: Machine, fleet: "FleetDiagnosis", folder: Path) -> dict:
    page = Store(folder).place(machine.name) / PAGE
    told = machine.found is not None and page.exists()
    odd = []
    for spread in fleet.parameters_.values():
        if machine.name in spread.odd:
            value, low, high = spread.values[machine.name]
            said = measured(value, low, high, typeset_unit(spread.unit))
            odd.append(f"{spread.name} {said}, usually {number(spread.usual, 3)}")
    return {
        "name": machine.name,
        "page": quote(page.relative_to(folder).as_posix()) if told else "",
        "css": _colour(machine.said),
        "said": machine.said,
        "causes": _named(machine) or ([machine.failed] if machine.failed else []),
        "sure": chance(machine.sure or None) if machine.named else "",
        "explained": percent(machine.explained) if machine.named else "",
        "odd": "; ".join(odd),
        "faults": _faults(machine),
    }


def _named(machine: Machine) -> list[str]:
    said = []
    for pair, cause in machine.named.items():
        sizes = []
        for name, size in cause["parameters"].items():
            if size["value"] is not None:
                low, high = (math.nan if size[e] is None else size[e] for e in ("low", "high"))
                text = sized(size["value"], low, high, typeset_unit(size["unit"]))
                sizes.append(f"{name.replace('_', ' ')} {text}")
        said.append(f"{cause_name(*pair)} ({chance(cause['probability'])}): {', '.join(sizes)}")
    return said


def _faults(machine: Machine) -> str:
    if machine.found is None:
        return ""
    kinds = dict.fromkeys(finding["kind"] for finding in machine.found["data_quality"])
    said = [kind.replace("_", " ") for kind in kinds]
    if machine.found["stopped"]:
        said.append(f"stopped: {machine.found['stopped']}")
    return "; ".join(said)


# -- what the machines show together ---------------------------------------------------------------


def _cause(cause: FleetCause) -> dict:
    return {
        "name": cause_name(cause.effect, cause.target),
        "named": len(cause.machines),
        "possible": len(cause.possible),
        "share": f"{percent(cause.low)} to {percent(cause.high)}",
        "remark": "add it to the common model" if cause.is_of_the_model else "",
    }


def _parameter(spread: ParameterSpread) -> dict:
    values = np.array([value for value, _, _ in spread.values.values()])
    scale = Scale.over(values)
    return {
        "name": spread.name,
        "given": f"{number(spread.prior)} {typeset_unit(spread.unit)}",
        "usual": f"{number(spread.usual)} {typeset_unit(spread.unit)}",
        "between": _between(spread),
        "strip": _strip(spread, scale, values),
        "scale": scale_text(scale),
    }


def _between(spread: ParameterSpread) -> str:
    """Return how far the machines that are not odd differ."""
    said = "the same" if spread.shared else f"± {number(spread.spread, 2)}"
    return f"{said} on all but {listed(spread.odd)}" if spread.odd else f"{said} on all"


def _strip(spread: ParameterSpread, scale: Scale, values: np.ndarray) -> Markup:
    """Return a strip with one dot per machine; the odd ones lie on top."""
    shapes = [mark(float(scale.place(spread.usual)), "usual", "median")]
    places = dict(zip(spread.values, scale.place(values), strict=True))
    for name in sorted(places, key=spread.odd.__contains__):
        css = "odd" if name in spread.odd else "like"
        told = f"{name}: {measured(*spread.values[name], typeset_unit(spread.unit))}"
        shapes.append(dot(float(places[name]), css, told))
    return strip(spread.name, shapes)
