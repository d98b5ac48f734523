"""The page, and the pieces of it that change; all inserted content is escaped."""

from functools import cache
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from sklearn_pgnn.cli.app.forms import choices_of
from sklearn_pgnn.cli.app.visitor import Visitor
from sklearn_pgnn.cli.app.work import RECORD_BYTES
from sklearn_pgnn.cli.options import SYSTEMS
from sklearn_pgnn.inspection.report.page import templates_of

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
