"""The page's pieces of HTML; all inserted content is escaped."""

from functools import cache
from importlib.resources import files


def render(name: str, **content) -> str:
    """Return a template of the page, filled with its content."""
    return _room().get_template(name).render(**content)


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


@cache
def _room():
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    room = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(source),
    )
    room.filters["capitalize_first"] = lambda text: text[:1].upper() + text[1:]
    return room
