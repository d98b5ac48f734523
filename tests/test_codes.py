"""Every finding, verdict, error and warning has an entry, and every entry is of one."""

import ast
import inspect
from pathlib import Path

import pytest
from click.testing import CliRunner

import sklearn_pgnn
from sklearn_pgnn import exceptions
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.explain import PARTS, read_codes
from sklearn_pgnn.exceptions import code_of
from sklearn_pgnn.fleet.machine import ORDER
from sklearn_pgnn.record_quality.refits import DRIFT

pytestmark = pytest.mark.core

CODES = read_codes()


def codes_of(kind):
    """Return the codes of the errors, or of the warnings."""
    classes = [value for value in vars(exceptions).values() if inspect.isclass(value)]
    return {code_of(each) for each in classes if issubclass(each, Warning) == (kind == "warnings")}


def codes_of_findings():
    """Yield the codes of the findings that the package makes, as its source names their kinds."""
    yield DRIFT.replace(" ", "_")
    for path in Path(sklearn_pgnn.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            makes = isinstance(node, ast.Call) and getattr(node.func, "id", "")
            if makes in ("Finding", "finding_of") and isinstance(node.args[0], ast.Constant):
                yield node.args[0].value.replace(" ", "_")


def test_every_code_has_one_entry_and_every_entry_a_code():
    assert {kind: set(entries) for kind, entries in CODES.items()} == {
        "verdicts": set(ORDER),
        "findings": set(codes_of_findings()),
        "errors": codes_of("errors"),
        "warnings": codes_of("warnings"),
    }
    assert len({code for each in CODES.values() for code in each}) == sum(map(len, CODES.values()))
    for parts in (parts for entries in CODES.values() for parts in entries.values()):
        assert list(parts) == [part for part in PARTS if part != "check"]
        assert all(parts[part].endswith(".") for part in ("means", "how", "remedy"))


def explained(*words, code=0):
    result = CliRunner().invoke(main, ["explain", *words])
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


def test_a_code_is_explained_however_it_is_written():
    said = explained("dropped_samples")
    assert said.startswith("dropped_samples Samples are missing")
    assert said == explained("Dropped samples") == explained("dropped-samples")
    assert "Check on the rig: Raise the drive slowly" in explained("coulomb_friction")


def test_all_codes_are_listed_and_an_unknown_one_is_answered_with_one_that_is_meant():
    assert {code for each in CODES.values() for code in each} < set(explained().split())
    assert "did you mean dropped_samples" in explained("droped_samples", code=2)
    assert "sklearn-pgnn explain lists all." in explained("xyz", code=2)
