"""``sklearn-pgnn explain``: what the code of a verdict, a finding, an error or a warning means."""

import tomllib
from collections.abc import Iterator
from difflib import get_close_matches
from importlib.resources import files
from textwrap import fill

import click

from sklearn_pgnn.cli.guard import Unusable, one_line
from sklearn_pgnn.cli.options import PROGRAM

#: the kinds of codes, by their tables in ``codes.toml``
KINDS = {
    "verdicts": "Verdicts",
    "findings": "Faults of the records",
    "errors": "Errors",
    "warnings": "Warnings",
}
#: the parts of an entry, and how they are called; the last one is that of an effect
PARTS = {
    "means": "",
    "how": "How it comes about: ",
    "remedy": "Remedy: ",
    "example": "Example: ",
    "check": "Check on the rig: ",
}
WIDTH = 88


def read_codes() -> dict[str, dict[str, dict[str, str]]]:
    """Return the parts of every entry by kind and code."""
    text = files("sklearn_pgnn.cli").joinpath("codes.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def complete_codes(_context: click.Context, _argument: click.Parameter, begun: str) -> list[str]:
    """Return the possible completions of a code.

    >>> complete_codes(None, None, "cl")
    ['closed_loop', 'clipping', 'clock_jitter']
    """
    return [code for entries in read_codes().values() for code in entries if code.startswith(begun)]


@click.command()
@click.argument("code", required=False, shell_complete=complete_codes)
def explain(code: str | None) -> None:
    """Explain a code: what it means, how it comes about, and what to do.

    CODE is that of a verdict, of a fault of the records, of an error or a warning, as it is printed
    beside it and stands in the JSON files, or the id of an effect; without one all but the effects
    are listed.
    """
    lines = list_of_codes() if code is None else page_of(code)
    click.echo("\n".join(lines))


def list_of_codes() -> Iterator[str]:
    """Yield the lines of a list of all codes."""
    codes = read_codes()
    width = max(len(code) for entries in codes.values() for code in entries)
    for kind, title in KINDS.items():
        yield f"{title}:"
        for code, parts in codes[kind].items():
            sentence = plain(parts["means"]).partition(". ")[0].rstrip(".")
            yield f"  {code:{width}}  {sentence}."
        yield ""
    yield f"{PROGRAM} explain CODE says more."


def page_of(code: str) -> Iterator[str]:
    """Yield the lines of an entry.

    >>> next(page_of("Dropped samples"))
    'dropped_samples'
    """
    entries = {name: parts for each in read_codes().values() for name, parts in each.items()}
    name = code.lower().replace("-", "_").replace(" ", "_")
    if name not in entries:
        from sklearn_pgnn.physics.effects import CATALOGUE

        entries |= {each.id: {"means": each.summary, "check": each.check} for each in CATALOGUE}
    if name not in entries:
        near = get_close_matches(name, entries, n=3)
        meant = f"did you mean {' or '.join(near)}?" if near else f"{PROGRAM} explain lists all."
        raise Unusable(one_line(f"CODE: expected a known code, got {code!r}; {meant}"))
    yield name
    for part, text in entries[name].items():
        yield ""
        yield fill(plain(f"{PARTS[part]}{text}"), WIDTH)


def plain(text: str) -> str:
    """Return a text without marks of code."""
    return text.replace("``", "")
