"""The result of a diagnosis, and the comparison of two, as printed to stdout."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import click
from rich.console import Console
from rich.text import Text

from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.cli.options import PROGRAM
from sklearn_pgnn.cli.tables import (
    change,
    heading,
    print_findings,
    print_table,
    print_trimmed,
    say,
    screen,
)
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.diagnosis.result import NamedCause
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.inspection.cause_names import cause_name, sizes_of
from sklearn_pgnn.inspection.diagnosis_comparison import DiagnosisComparison
from sklearn_pgnn.inspection.numbers import chance, free_run_error, measured, number, share
from sklearn_pgnn.inspection.report.parameters import parameter_facts
from sklearn_pgnn.inspection.result_files import as_strict_json, described_models
from sklearn_pgnn.inspection.words import (
    held_beside,
    remaining_sentence,
    rivals_or_none,
    separation_sentence,
    spread_sentence,
    unusable_sentence,
    verdict_sentence,
)
from sklearn_pgnn.inspection.yardstick import retuning_counts, shown_models
from sklearn_pgnn.record_quality.finding import Finding

#: colour of a verdict, on a terminal with colours
COLOURS = {
    "model_adequate": "green",
    "cause_named": "cyan",
    "ambiguous": "yellow",
    "unexplained": "red",
    "provisional": "yellow",
    "predicts_nothing": "red",
    "nothing_found": "yellow",
}
#: probability of a cause from which on the probability is not printed
SURE = 0.99


def described_files(diagnosis: "ModelDiagnosis") -> dict[str, str]:
    """Return a description of each file of a diagnosis, by file name."""
    return {
        "report.html": "the full report with plots; open it first",
        "diagnosis.json": "the same for programs",
        **described_models(diagnosis),
    }


def print_diagnosis(
    diagnosis: "ModelDiagnosis",
    output: Path,
    *,
    quiet: bool,
    more: Mapping[str, str] | None = None,
) -> None:
    """Print the findings of a diagnosis and the location of its files."""
    console = screen()
    if not quiet:
        _print_quality(console, diagnosis.data_quality_)
    title, sentence = f"{VERDICTS[diagnosis.verdict_]}. ", one_line(verdict_sentence(diagnosis))
    colour = f"bold {COLOURS[diagnosis.verdict_]}"
    print_trimmed(console, Text.assemble((title, colour), (sentence, "bold")))
    left = "" if diagnosis.remaining_.kind == "noise" else "yellow"
    say(console, remaining_sentence(diagnosis), left)
    if diagnosis.unusable_ and not quiet:
        say(console, unusable_sentence(diagnosis))
    if quiet:
        return
    if pinned := spread_sentence(diagnosis):
        say(console, pinned, "yellow")
    for place, cause in enumerate(diagnosis.causes_, start=1):
        _print_cause(console, place, cause, diagnosis)
    _print_parameters(console, diagnosis)
    _print_errors(console, diagnosis)
    heading(console, "Written")
    for name, what in {**described_files(diagnosis), **(more or {})}.items():
        console.print(Text(f"  {one_line(output / name)}  ({what})"), soft_wrap=True)
    say(console, f"{PROGRAM} explain {diagnosis.verdict_} says what the verdict means.", "dim")


def _print_quality(console: Console, findings: Iterable[Finding]) -> None:
    """Print the flaws of the records, before the verdict."""
    if not findings:
        return
    say(console, "Quality of the records: read this first", "bold yellow")
    print_findings(console, findings)
    console.print()


def _print_cause(
    console: Console, place: int, cause: NamedCause, diagnosis: "ModelDiagnosis"
) -> None:
    heading(console, f"Cause {place}: {cause_name(cause.effect, cause.target)}")
    if cause.summary:
        say(console, cause.summary)
    rows = list(sizes_of(cause).items())
    worth = f"{abs(cause.gain):.0f} % {'smaller' if cause.gain >= 0 else 'larger'}"
    rows.append(("gain", f"error on held-out windows {worth}"))
    if cause.probability < SURE:
        none = f" (none of the catalogue: {chance(cause.outside)})" if cause.tested else ""
        rows.append(("probability", f"{chance(cause.probability)}{none}"))
    rows.append(("confused with", rivals_or_none(cause, diagnosis.complete_)))
    if beside := held_beside(cause, diagnosis.causes_):
        rows.append(("holds beside", beside))
    rows += [
        ("to separate", separation_sentence(found))
        for found in diagnosis.separations_
        if found.cause == (cause.effect, cause.target)
    ]
    if cause.check:
        rows.append(("check on the rig", cause.check))
    print_table(console, ("", ""), rows)


def _print_parameters(console: Console, diagnosis: "ModelDiagnosis") -> None:
    parameters = diagnosis.parameters_
    if not parameters:
        return
    facts, told = parameter_facts(diagnosis), diagnosis.model.parameters
    limited, remarks = facts.at_limit, dict.fromkeys(facts.open, "not determined")
    remarks |= dict.fromkeys(limited, "at a limit")
    unknown = [name for name in parameters if math.isinf(told[name].reach)]
    shown = {n: p for n, p in parameters.items() if p.changed or n in (*limited, *unknown)}
    if not shown:
        is_alone = not diagnosis.causes_ and diagnosis.discrepancy_ is None
        moved = is_alone and retuning_counts(diagnosis)
        together = "re-tuned together; " if moved else ""
        heading(console, f"Parameters: {together}none changed beyond its 95 % interval")
        return
    kinds = "changed, unknown or at a limit" if (limited or unknown) else "changed"
    heading(console, f"Parameters {kinds} (95 % interval)")
    rows = (
        (
            name,
            number(p.prior),
            measured(p.value, p.low, p.high, p.unit),
            change(p.value, p.prior) if name not in facts.open else "",
            remarks.get(name, ""),
        )
        for name, p in shown.items()
    )
    print_table(console, ("", "as given", "re-tuned", "change", ""), rows)


def _print_errors(console: Console, diagnosis: "ModelDiagnosis") -> None:
    """Print the errors over windows and in free run."""
    shown = shown_models(diagnosis)
    heading(
        console, f"Error on held-out windows of {number(diagnosis.window_, 3)} s (root mean square)"
    )
    rows = (
        (output, *(number(getattr(gain, e), 3) for e in (*shown, "noise")), gain.unit, share(gain))
        for output, gain in diagnosis.gain_.items()
    )
    print_table(console, ("", *shown.values(), "noise", "", "explained"), rows)
    heading(console, "Error in free run, every record from its own start (root mean square)")
    rows = (
        (
            output,
            *(free_run_error(getattr(e, which)) for which in shown),
            diagnosis.model.unit(output),
        )
        for output, e in diagnosis.free_run_.items()
    )
    print_table(console, ("", *shown.values(), ""), rows)


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
        print_table(console, each.headers, each.rows)
