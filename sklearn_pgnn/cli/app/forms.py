"""Validation of a visitor's entries: known names, texts of limited length."""

from collections.abc import Mapping

from sklearn_pgnn.cli.app.work import Refused
from sklearn_pgnn.physics.channel_kinds import kinds

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
    """
    form = form if isinstance(form, Mapping) else {}
    hold = form.get("hold", "auto")
    if hold not in HOLDS:
        raise Refused(f"Expected inputs that are held as {', '.join(HOLDS)}, got {hold!r}.")
    text = _text(form.get("minutes", "")).strip()
    if not text:
        return {"hold": hold}
    try:
        minutes = float(text)
    except ValueError:
        minutes = 0.0
    if not 0 < minutes <= MINUTES:
        raise Refused(f"Expected a time limit of up to {MINUTES:g} minutes, got {text!r}.")
    return {"hold": hold, "time_limit": 60.0 * minutes}


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > TEXT:
        raise Refused(f"Expected a text of at most {TEXT} characters.")
    return value
