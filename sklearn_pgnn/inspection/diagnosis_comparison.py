"""Two diagnoses side by side: before and after a repair, two machines, two versions of a model."""

import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import chance, measured, number, readable, times
from sklearn_pgnn.inspection.result_files import FILE
from sklearn_pgnn.inspection.yardstick import models_called
from sklearn_pgnn.record_quality.finding import listed

#: by suffix, other files that may be given by mistake
OTHER_FILES = {
    ".yaml": "a model file",
    ".yml": "a model file",
    ".csv": "a file of records",
    ".html": "a report",
}
#: relative difference of window lengths up to which errors over them are set side by side
SAME_LENGTH = 0.05
_NEEDED = ("verdict", "causes", "parameters", "gain", "free_run", "remaining", "data_quality")


@dataclass(frozen=True)
class Quantity:
    """A quantity with the value, and the ends of its 95 % interval, that each diagnosis has."""

    name: str
    unit: str
    one: tuple[float, float, float] | None
    other: tuple[float, float, float] | None

    @property
    def differs(self) -> bool:
        r"""Whether the two differ by more than their intervals together allow.

        .. math:: |a - b| > \sqrt{h_a^2 + h_b^2}

        with the half-widths :math:`h` of the 95 % intervals.
        """
        if self.one is None or self.other is None:
            return False
        (a, *ends_a), (b, *ends_b) = self.one, self.other
        reach = math.hypot(*((high - low) / 2 for low, high in (ends_a, ends_b)))
        return bool(abs(a - b) > reach)


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class DiagnosisComparison:
    """Two diagnoses side by side.

    Parameters
    ----------
    names : tuple of str
        Names of the two.
    differences : tuple of str
        The differences, one sentence each; empty if there are none.
    quantities : tuple of Quantity
        The sizes of the causes, then the parameters.
    tables : tuple of Table
        Verdicts, causes, parameters and errors of both.

    Examples
    --------
    >>> DiagnosisComparison(("before", "after"), (), (), ()).summary
    'before and after agree within their 95 % intervals.'
    """

    names: tuple[str, str]
    differences: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    tables: tuple[Table, ...]

    @property
    def summary(self) -> str:
        """Summary of the comparison in words."""
        one, other = self.names
        if not self.differences:
            return f"{one} and {other} agree within their 95 % intervals."
        count = len(self.differences)
        return f"{one} and {other} differ in {count} {'thing' if count == 1 else 'things'}."

    def __repr__(self):
        return f"<DiagnosisComparison: {self.summary}>"

    def to_text(self) -> str:
        """Return the comparison as plain text."""
        parts = [self.summary, *(f"  {sentence}" for sentence in self.differences)]
        for table in self.tables:
            parts += ["", table.title, *_aligned(table)]
        return "\n".join(parts) + "\n"

    def to_dict(self) -> dict:
        """Return the comparison as plain data."""
        quantities = [
            {"name": q.name, "unit": q.unit, "one": q.one, "other": q.other, "differs": q.differs}
            for q in self.quantities
        ]
        names = list(self.names)
        return {"names": names, "differences": list(self.differences), "quantities": quantities}

    def to_html(self, path: FilePath) -> None:
        """Write the comparison as a report, one self-contained file.

        Parameters
        ----------
        path : str or path-like
            Where to write.
        """
        from sklearn_pgnn.inspection.comparison_report import render_comparison

        Path(path).write_text(render_comparison(self), encoding="utf-8")


def compare(one: Any, other: Any, *, names: Sequence[str] | None = None) -> DiagnosisComparison:
    """Compare two diagnoses.

    Parameters
    ----------
    one, other : ModelDiagnosis, mapping, or path-like
        A fitted diagnosis, the result of its `to_dict`, the ``diagnosis.json`` that the command
        line writes, or the folder that contains it.
    names : sequence of str, optional
        Names of the two; by default those of their folders, else ``"A"`` and ``"B"``.

    Returns
    -------
    DiagnosisComparison
        The differences, and both diagnoses in tables: ``to_text()``, ``to_html(path)``.

    Raises
    ------
    OptionError
        If one of the two is not a diagnosis, or they have no output and no parameter in common.

    Examples
    --------
    >>> found = {"verdict": "model_adequate", "causes": [], "gain": {}, "free_run": {},
    ...          "parameters": {"m": dict(prior=2.0, value=2.1, low=2.0, high=2.2, unit="kg")},
    ...          "remaining": {"kind": "noise", "times_noise": {}}, "data_quality": []}
    >>> heavy = dict(prior=2.0, value=2.6, low=2.5, high=2.7, unit="kg")
    >>> print(*compare(found, {**found, "parameters": {"m": heavy}}).differences)
    m: 2.10 (2.00 to 2.20) kg in A, 2.60 (2.50 to 2.70) kg in B (24 % larger).
    """
    pair = (_read(one), _read(other))
    called = tuple(names or _names(one, other))
    if len(called) != 2:
        raise OptionError(f"names: expected two, got {len(called)}.")
    _check_related(pair, called)
    sizes, parameters = _sizes(pair), _parameters(pair)
    said = (
        *_of_verdicts(pair, called),
        *_of_causes(pair, called),
        *_of_formulas(pair, called),
        *(_of_quantity(q, called) for q in (*sizes, *parameters) if q.differs),
        *_of_rest(pair, called),
    )
    tables = (
        _verdicts(pair, called),
        _quantities("Causes and their sizes", sizes, called),
        _quantities("Parameters of the model", parameters, called),
        *_errors(pair, called),
    )
    filled = tuple(table for table in tables if table.rows)
    return DiagnosisComparison(called, said, (*sizes, *parameters), filled)


# -- what is compared ------------------------------------------------------------------------------


def _read(source) -> Mapping:
    if hasattr(source, "to_dict"):
        return source.to_dict()
    data = source if isinstance(source, Mapping) else _loaded(Path(source))
    missing = [key for key in _NEEDED if key not in data]
    if missing:
        raise OptionError(
            f"compare: expected the results of a diagnosis, got data without {missing[0]!r}."
        )
    return data


def _check_related(pair, names) -> None:
    """Raise `OptionError` if two diagnoses have nothing in common that could be compared."""
    known = [{*data["gain"], *data["parameters"]} for data in pair]
    if all(known) and known[0].isdisjoint(known[1]):
        has = " and ".join(
            f"{name} has the outputs {listed(data['gain']) or 'none'}"
            for name, data in zip(names, pair, strict=True)
        )
        raise OptionError(
            f"compare: expected two diagnoses of machines of one kind, got {has}, and no parameter "
            f"is in both. Remedy: compare diagnoses whose models use the same output names, such "
            f"as before and after a repair."
        )


def _loaded(path: Path) -> Mapping:
    if path.suffix.lower() in OTHER_FILES and path.is_file():
        raise OptionError(
            f"{path}: expected a diagnosis (a folder, or the {FILE} in it), got "
            f"{OTHER_FILES[path.suffix.lower()]}. Remedy: run sklearn-pgnn diagnose first, with "
            f"another --output for each, and compare what it has written."
        )
    file = path / FILE if path.is_dir() else path
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        why = error.strerror or str(error)
        raise OptionError(f"{file}: expected the {FILE} of a diagnosis, got: {why}.") from None
    except ValueError as error:
        raise OptionError(f"{file}: expected the {FILE} of a diagnosis, got: {error}.") from None
    if not isinstance(data, Mapping):
        raise OptionError(f"{file}: expected the {FILE} of a diagnosis, got something else.")
    return data


def _names(one, other) -> tuple[str, str]:
    """Return the names of two folders, with as many parents as needed to distinguish them."""
    if not all(isinstance(source, str | os.PathLike) for source in (one, other)):
        return "A", "B"
    paths = [Path(source).resolve() for source in (one, other)]
    paths = [path.parent if path.name == FILE else path for path in paths]
    if paths[0].name != paths[1].name:
        return paths[0].name, paths[1].name
    return str(one), str(other)


def _interval(found: Mapping | None) -> tuple[float, float, float] | None:
    if found is None:
        return None
    low, high = found["low"], found["high"]
    return found["value"], -math.inf if low is None else low, math.inf if high is None else high


def _causes(data: Mapping) -> dict[tuple[str, str], Mapping]:
    return {(cause["effect"], cause["target"]): cause for cause in data["causes"]}


def _both(one: Mapping, other: Mapping) -> list:
    """Return the keys of both, each once, in their order."""
    return list(dict.fromkeys([*one, *other]))


def _sizes(pair) -> list[Quantity]:
    causes = [_causes(data) for data in pair]
    rows = []
    for key in _both(*causes):
        sizes = [c.get(key, {}).get("parameters", {}) for c in causes]
        rows += [
            _quantity(f"{cause_name(*key)}: {name.replace('_', ' ')}", sizes, name)
            for name in _both(*sizes)
        ]
    return rows


def _parameters(pair) -> list[Quantity]:
    both = [data["parameters"] for data in pair]
    return [_quantity(name, both, name) for name in _both(*both)]


def _quantity(title: str, both, name: str) -> Quantity:
    one, other = (each.get(name) for each in both)
    unit = (one or other)["unit"]
    return Quantity(title, unit, _interval(one), _interval(other))


# -- what differs ----------------------------------------------------------------------------------


def _of_verdicts(pair, names) -> list[str]:
    one, other = (VERDICTS[data["verdict"]].lower() for data in pair)
    return [] if one == other else [f"{names[0]}: {one}; {names[1]}: {other}."]


def _of_causes(pair, names) -> list[str]:
    causes, said = [_causes(data) for data in pair], []
    for here, there in ((0, 1), (1, 0)):
        for key in causes[here]:
            if key not in causes[there]:
                rival = _rival_of(key, causes[there])
                but = f", but {rival}, which it may be confused with" if rival else ""
                where = f"named in {names[here]}, not in {names[there]}"
                said.append(f"{cause_name(*key)}: {where}{but}.")
    return said


def _of_formulas(pair, names) -> list[str]:
    """Return the formulas that only one of two diagnoses has, or that differ in their terms."""
    parts = [data.get("unexplained") for data in pair]
    one, other = (part and (part["target"], _terms(part["formula"])) for part in parts)
    if one == other:
        return []
    said = (
        f"{_formula(part) or 'none'} in {name}" for part, name in zip(parts, names, strict=True)
    )
    return [f"Formula: {'; '.join(said)}."]


def _terms(formula: str) -> frozenset[str]:
    """Return the terms of a formula without their coefficients."""
    return frozenset(term.partition("*")[2] for term in re.split(r" [+-] ", formula))


def _rival_of(key, causes: Mapping) -> str:
    """Return the named cause of which another one is a rival; empty if there is none."""
    for named, cause in causes.items():
        if key in [(r["effect"], r["target"]) for r in cause["confused_with"]]:
            return cause_name(*named)
    return ""


def _of_quantity(quantity: Quantity, names) -> str:
    """Return what each has found, and the relative difference where the sign is the same."""
    one, other = _shown(quantity)
    change = ""
    if quantity.one and quantity.other and quantity.one[0] * quantity.other[0] > 0:
        share = quantity.other[0] / quantity.one[0] - 1
        change = f" ({abs(100 * share):.0f} % {'larger' if share > 0 else 'smaller'})"
    return f"{quantity.name}: {one} in {names[0]}, {other} in {names[1]}{change}."


def _shown(quantity: Quantity) -> list[str]:
    """Return the value found by each diagnosis."""
    both = (quantity.one, quantity.other)
    return ["-" if found is None else measured(*found, quantity.unit) for found in both]


def _of_rest(pair, names) -> list[str]:
    one, other = (data["remaining"]["kind"] for data in pair)
    said = []
    if one != other:
        said.append(f"What is left is {one} in {names[0]}, {other} in {names[1]}.")
    flaws = [{f["kind"] for f in data["data_quality"]} for data in pair]
    for name, only in zip(names, (flaws[0] - flaws[1], flaws[1] - flaws[0]), strict=True):
        if only:
            kinds = listed(sorted(only))
            said.append(f"Only the records of {name} have faults of this kind: {kinds}.")
    return said


# -- in tables -------------------------------------------------------------------------------------


def _verdicts(pair, names) -> Table:
    rows = [
        ("verdict", *(VERDICTS[data["verdict"]] for data in pair)),
        ("causes", *(_named(data) or "none" for data in pair)),
        ("formula", *(_formula(data.get("unexplained")) or "none" for data in pair)),
        ("what is left", *(_left(data["remaining"]) for data in pair)),
    ]
    flaws = (dict.fromkeys(flaw["kind"] for flaw in data["data_quality"]) for data in pair)
    rows.append(("faults of the records", *(listed(kinds) or "none" for kinds in flaws)))
    return Table("The two diagnoses", ("", *names), tuple(rows))


def _named(data) -> str:
    return listed(
        f"{cause_name(c['effect'], c['target'])} ({chance(c['probability'])})"
        for c in data["causes"]
    )


def _formula(part: Mapping | None) -> str:
    """Return a formula and its place; empty where there is none."""
    return "" if part is None else f"{readable(part['formula'])} in {part['target']}"


def _left(remaining) -> str:
    left = listed(
        f"{times(math.inf if x is None else x)} the noise of {output}"
        for output, x in remaining["times_noise"].items()
    )
    return f"{remaining['kind']} ({left})" if left else remaining["kind"]


def _quantities(title, quantities, names) -> Table:
    rows = tuple((q.name, *_shown(q), "differs" if q.differs else "") for q in quantities)
    return Table(f"{title} (95 % intervals)", ("", *names, ""), rows)


def _errors(pair, names) -> list[Table]:
    """Return the errors over windows, if of about one length, and in free run."""
    lengths = [length for data in pair if (length := data.get("window"))]
    free = _error_table("Error in free run (root mean square)", "free_run", pair, names)
    if len(lengths) < 2 or math.isclose(*lengths, rel_tol=SAME_LENGTH):
        title = "Error on held-out windows (root mean square)"
        return [_error_table(title, "gain", pair, names), free]
    said = " and ".join(f"{number(length, 3)} s" for length in lengths)
    why = f"; on windows they are not comparable, the windows are {said} long"
    return [replace(free, title=f"{free.title}{why}")]


def _error_table(title: str, key: str, pair, names) -> Table:
    """Return the errors of every output by every model that either of two diagnoses has."""
    found, rows = [data[key] for data in pair], []
    titles = models_called(True, any(data.get("unexplained") for data in pair))
    units = {output: g.get("unit", "") for data in pair for output, g in data["gain"].items()}
    for output in _both(*found):
        for which, said in titles.items():
            cells = [_error(errors.get(output), which, units.get(output, "")) for errors in found]
            rows.append((f"{output}, {said}", *cells))
    return Table(title, ("", *names), tuple(rows))


def _error(errors, which: str, unit: str) -> str:
    if errors is None or errors.get(which) is None:
        return "-"
    return f"{number(errors[which], 3)} {unit}".rstrip()


def _aligned(table: Table) -> list[str]:
    """Return a table as lines of even columns."""
    rows = [table.headers, *table.rows]
    widths = [max(len(row[i]) for row in rows) for i in range(len(table.headers))]
    lines = ("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in rows)
    return [f"  {line}".rstrip() for line in lines]
