"""Tables and headings on the screen: no wider than the terminal, no blanks at the ends of lines."""

from collections.abc import Iterable, Sequence

from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.cli.options import PROGRAM
from sklearn_pgnn.record_quality.finding import Finding


def screen() -> Console:
    """Return the console for stdout."""
    return Console(highlight=False, markup=False, emoji=False)


def say(console: Console, text: object, style: str = "") -> None:
    """Print a paragraph."""
    print_trimmed(console, Text(one_line(text), style=style))


def heading(console: Console, text: str) -> None:
    """Print a heading below an empty line."""
    console.print()
    say(console, text, "bold")


def print_findings(console: Console, findings: Iterable[Finding], style: str = "") -> None:
    """Print findings with their codes, and how to read more of them."""
    for each in findings:
        text = Text(f"  {one_line(f'{each.code}: {each.said}')}", style=style)
        console.print(text, soft_wrap=True)
    say(console, f"{PROGRAM} explain CODE says more.", "dim")


def change(value: float, prior: float) -> str:
    """Return a change in percent; small changes are not rounded to zero, none is given from zero.

    >>> change(2.1, 2.0), change(1.9998, 2.0), change(2.0, 2.0), change(1.0, 0.0)
    ('+5.0 %', '-0.01 %', '0 %', '')
    """
    if not prior:
        return ""
    percent = 100 * (value / prior - 1)
    if not percent:
        return "0 %"
    return f"{percent:+.1f} %" if abs(percent) >= 0.1 else f"{percent:+.1g} %"


def print_trimmed(console: Console, what: RenderableType) -> None:
    """Print without blanks at the ends of lines."""
    with console.capture() as captured:
        console.print(what)
    for line in captured.get().splitlines():
        console.out(line.rstrip(), highlight=False)


def print_table(console: Console, headers: Sequence[str], rows: Iterable[Iterable]) -> None:
    """Print a table without lines, with a small indent; without a head where that is empty."""
    made = Table(box=None, show_header=any(headers), header_style="", pad_edge=False)
    for header in headers:
        made.add_column(header, overflow="fold")
    for row in rows:
        made.add_row(*(Text(one_line(text)) for text in row))
    print_trimmed(console, Padding(made, (0, 0, 0, 2), expand=False))
