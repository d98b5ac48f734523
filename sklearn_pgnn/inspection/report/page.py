"""Render the report as HTML, and write it to a file."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup, escape
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.experiment_design.detectability import Detectability
from sklearn_pgnn.inspection.report.content import report_content
from sklearn_pgnn.inspection.report.provenance import Provenance
from sklearn_pgnn.whole_file import write_whole

if TYPE_CHECKING:
    from jinja2 import Environment

    from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis

TEMPLATES = "templates"
#: terms of the field, as they stand in the sentences of a report, and what each means
TERMS = {
    "free run": "a model follows a whole record from its first state by the inputs alone",
    "held-out windows": "short pieces of the records to which the parameters were not fitted",
    "re-tuned": "the same equations, with parameters fitted to the records",
    "× the noise": "an error in units of the noise; at 1 nothing is left to explain",
}
#: a hyphen that is a minus: before a number, and neither in a word nor in a range
MINUS = re.compile(r"(?<![\w)\]])-(?=[\d.])")


def write_report(
    diagnosis: ModelDiagnosis,
    path: FilePath,
    provenance: Provenance | None = None,
    detectability: Detectability | None = None,
) -> None:
    """Write the report of a diagnosis.

    The file contains its plots and styles and loads nothing else. It is written completely or
    not at all.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The fitted diagnosis.
    path : str or path-like
        Where to write.
    provenance : Provenance, optional
        Files, command and day, to be stated.
    detectability : Detectability, optional
        Detectable sizes, see `ModelDiagnosis.detectability`: where nothing was named, the report
        states how large an undetected effect can be.

    Examples
    --------
    >>> from sklearn_pgnn import ModelDiagnosis, datasets, effects
    >>> friction = effects.CoulombFriction("v", level=1.0)
    >>> hidden = datasets.make_cart(3, effect=friction, sample_rate=50)
    >>> diagnosis = ModelDiagnosis(hidden.prior, catalogue=["coulomb_friction"], window_length=0.5)
    >>> _ = diagnosis.fit(hidden.X, hidden.y)
    >>> write_report(diagnosis, "report.html")
    >>> "Coulomb friction on v" in Path("report.html").read_text(encoding="utf-8")
    True
    """
    check_is_fitted(diagnosis)
    write_whole(Path(path), render_report(diagnosis, provenance, detectability))


def render_report(
    diagnosis: ModelDiagnosis,
    provenance: Provenance | None = None,
    detectability: Detectability | None = None,
) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The fitted diagnosis.
    provenance : Provenance, optional
        Files, command and day, to be stated; the report of a diagnosis is reproducible if the day
        is given.
    detectability : Detectability, optional
        Detectable sizes, for a report of a model that is adequate.

    Returns
    -------
    str
        The HTML text; names and units of the model are escaped.

    Examples
    --------
    >>> from sklearn_pgnn import ModelDiagnosis, datasets, effects
    >>> friction = effects.CoulombFriction("v", level=1.0)
    >>> hidden = datasets.make_cart(3, effect=friction, sample_rate=50)
    >>> diagnosis = ModelDiagnosis(hidden.prior, catalogue=["coulomb_friction"], window_length=0.5)
    >>> _ = diagnosis.fit(hidden.X, hidden.y)
    >>> "Coulomb friction on v" in render_report(diagnosis)
    True
    """
    content = report_content(diagnosis, provenance or Provenance(), detectability)
    for name in ("style.css", "zoom.js"):
        text = _source(name)
        content |= {name.split(".")[0]: text, f"{name.split('.')[0]}_digest": digest(text)}
    return render(_source, "report.html.j2", content)


def render(source: Callable[[str], str], name: str, content: Mapping) -> str:
    """Render a template."""
    templates = templates_of(source)
    templates.finalize = lambda value: MINUS.sub("\u2212", value) if type(value) is str else value
    templates.filters["as_it_is"] = escape  # hyphens stay what they are, to be copied
    return templates.get_template(name).render(terms=TERMS, **content)


def explained(text: str) -> Markup:
    """Return a sentence, in which every term says what it means where it is pointed at."""
    said = escape(MINUS.sub("\u2212", text))
    for term, meaning in TERMS.items():
        said = said.replace(term, Markup('<abbr title="{}">{}</abbr>').format(meaning, term), 1)
    return said


@cache
def templates_of(source: Callable[[str], str]) -> Environment:
    """Return the templates whose text a function gives by name."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    templates = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(source),
    )
    templates.filters["explained"] = explained
    templates.filters["capitalize_first"] = lambda text: text[:1].upper() + text[1:]
    return templates


def digest(text: str) -> str:
    """Return the hash by which a page's security policy allows a style or a script."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def style_sheet() -> str:
    """Return the styles of the report, for other pages in the same style."""
    return _source("style.css")


def _source(name: str) -> str:
    folder = files("sklearn_pgnn.inspection.report").joinpath(TEMPLATES)
    return folder.joinpath(name).read_text(encoding="utf-8")
