"""The page, and the pieces of it that change; all inserted content is escaped."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from sklearn_pgnn.cli.app.visitor import Visitor
from sklearn_pgnn.cli.app.work import RECORD_BYTES, Refused
from sklearn_pgnn.cli.options import SYSTEMS
from sklearn_pgnn.inspection.report.page import templates_of
from sklearn_pgnn.physics.channel_kinds import kinds

#: the pieces, in the order in which one comes to them
PIECES = ("model", "records", "columns", "seen", "work", "result")


def render(name: str, **content: Any) -> str:
    """Return a template of the page, filled with its content."""
    return templates_of(source).get_template(name).render(**content)


@cache
def source(name: str) -> str:
    """Return a file of the page unchanged."""
    return files("sklearn_pgnn.cli.app").joinpath("templates", name).read_text(encoding="utf-8")


@cache
def style() -> str:
    """Return the style sheet: that of the report, and the additions of the page."""
    return f"{of_report('style.css')}\n{source('app.css')}"


@cache
def of_report(name: str) -> str:
    """Return a file of the report unchanged."""
    folder = files("sklearn_pgnn").joinpath("inspection", "report", "templates")
    return folder.joinpath(name).read_text(encoding="utf-8")


def page(visitor: Visitor) -> str:
    """Return the whole page of a visitor."""
    marked = {name: Markup(html) for name, html in sections(visitor).items()}
    return render("page.html.j2", sections=marked)


def sections(visitor: Visitor) -> dict[str, str]:
    """Return the pieces of a visitor's page, by name."""
    path = visitor.folder / "look.html"
    content = {
        "visitor": visitor,
        "systems": SYSTEMS,
        "most": f"{RECORD_BYTES / 1e6:g}",
        "look": Markup(path.read_text(encoding="utf-8") if visitor.looked else ""),
        "choices": _choices(visitor),
    }
    return {name: render(f"{name}.html.j2", **content) for name in PIECES}


def _choices(visitor: Visitor) -> list[dict]:
    """Return every quantity with its chosen column and unit."""
    if visitor.columns is None:
        return []
    nothing = {"column": "", "unit": "", "kind": ""}
    return [
        {"name": name, "role": role, "needs": unit, "kinds": choices_of(role)}
        | visitor.mapping.get(name, nothing)
        for name, role, unit in visitor.columns["quantities"]
    ]


# -- what a visitor enters: known names, texts of limited length -----------------------------------


#: longest text of a field [characters]
TEXT = 200
HOLDS = ("auto", "zoh", "foh")
#: longest time limit [min]
MINUTES = 24 * 60.0


def clean_mapping(form: object, columns: Mapping) -> dict:
    """Return a mapping of quantities to columns and units."""
    form = form if isinstance(form, Mapping) else {}
    cleaned: dict = {"sample_time": _text(form.get("sample_time", ""))}
    for name, role, unit in columns["quantities"]:
        said = form.get(name)
        said = said if isinstance(said, Mapping) else {}
        column = _text(said.get("column", ""))
        if column and column not in columns["columns"]:
            raise Refused(f"Expected a column of the files for {name!r}, got {column!r}.")
        kind = _text(said.get("kind", ""))
        if kind and kind not in choices_of(role):
            raise Refused(f"Expected a kind of channel for {name!r}, got {kind!r}.")
        unit = _text(said.get("unit", unit)).strip()
        cleaned[name] = {"column": column, "unit": unit, "kind": kind}
    return cleaned


def choices_of(role: str) -> tuple[str, ...]:
    """Return the kinds that a quantity of a role can be of.

    >>> choices_of("time"), choices_of("input")[:2]
    ((), ('commanded', 'measured'))
    """
    return () if role == "time" else kinds(role == "input")


def clean_options(form: object) -> dict:
    """Return the options of a diagnosis.

    >>> clean_options({"minutes": "2", "hold": "zoh"}), clean_options({})
    ({'hold': 'zoh', 'time_limit': 120.0}, {'hold': 'auto'})
    >>> clean_options({"exclude": "leak, drift", "targets": ""})
    {'hold': 'auto', 'exclude': ['leak, drift']}
    """
    form = form if isinstance(form, Mapping) else {}
    said = {name: _text(form.get(name, "")).strip() for name in ("exclude", "targets")}
    hold = form.get("hold", "auto")
    if hold not in HOLDS:
        raise Refused(f"Expected inputs that are held as {', '.join(HOLDS)}, got {hold!r}.")
    options: dict = {"hold": hold, **{name: [text] for name, text in said.items() if text}}
    text = _text(form.get("minutes", "")).strip()
    if not text:
        return options
    try:
        minutes = float(text)
    except ValueError:
        minutes = 0.0
    if not 0 < minutes <= MINUTES:
        raise Refused(f"Expected a time limit of up to {MINUTES:g} minutes, got {text!r}.")
    return {**options, "time_limit": 60.0 * minutes}


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > TEXT:
        raise Refused(f"Expected a text of at most {TEXT} characters.")
    return value
