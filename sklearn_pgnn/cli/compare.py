"""The job of ``sklearn-pgnn compare``: two diagnoses on the screen, and as a report."""

from pathlib import Path

import click

from sklearn_pgnn.cli.output import write_file
from sklearn_pgnn.cli.tables import cell, heading, print_table, say, screen, table
from sklearn_pgnn.inspection.comparison_report import render_comparison
from sklearn_pgnn.inspection.diagnosis_comparison import DiagnosisComparison
from sklearn_pgnn.inspection.result_files import as_strict_json


def write_comparison(found: DiagnosisComparison, output: str, *, force: bool, opens: bool) -> None:
    """Write a comparison as a report."""
    write_file(output, render_comparison(found), force=force)
    if opens:
        click.launch(str(Path(output).absolute()))


def print_comparison(found: DiagnosisComparison, *, as_json: bool, quiet: bool) -> None:
    """Print a comparison."""
    if as_json:
        click.echo(as_strict_json(found.to_dict()), nl=False)
        return
    console = screen()
    say(console, found.summary, "bold yellow" if found.differences else "bold green")
    for sentence in found.differences:
        say(console, f"- {sentence}")
    for each in () if quiet else found.tables:
        heading(console, each.title)
        rows = table(*each.headers)
        for row in each.rows:
            rows.add_row(*map(cell, row))
        print_table(console, rows)
