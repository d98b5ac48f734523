"""Every finding, verdict, error and warning has an entry, and every entry is of one."""

import ast
import inspect
from pathlib import Path

import pytest
from click.testing import CliRunner

import sklearn_pgnn
from sklearn_pgnn import exceptions
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.explain import KINDS, PARTS, read_codes
from sklearn_pgnn.exceptions import code_of
from sklearn_pgnn.fleet.machine import ORDER
from sklearn_pgnn.record_quality.refits import DRIFT

pytestmark = pytest.mark.core

CODES = read_codes()
FINDINGS = CODES["findings"]


def codes_of(kind):
    """Return the codes of the errors, or of the warnings."""
    classes = (value for _, value in inspect.getmembers(exceptions, inspect.isclass))
    own = [value for value in classes if value.__module__ == exceptions.__name__]
    return {code_of(each) for each in own if issubclass(each, Warning) == (kind == "warnings")}


def kinds_of_findings():
    """Yield the kinds of findings that the package makes, as its source names them."""
    yield DRIFT
    for path in Path(sklearn_pgnn.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "").lower() in MAKERS:
                first = node.args[0]
                if isinstance(first, ast.Constant):
                    yield first.value


MAKERS = ("finding", "finding_of")


def test_every_code_has_an_entry_and_every_entry_a_code():
    assert set(CODES) == set(KINDS)
    assert set(CODES["verdicts"]) == set(ORDER)
    assert set(FINDINGS) == {kind.replace(" ", "_") for kind in kinds_of_findings()}
    assert set(CODES["errors"]) == codes_of("errors")
    assert set(CODES["warnings"]) == codes_of("warnings")


def test_no_code_has_two_entries():
    assert len({code for each in CODES.values() for code in each}) == sum(map(len, CODES.values()))


@pytest.mark.parametrize("kind", KINDS)
def test_an_entry_has_every_part_in_sentences(kind):
    for parts in CODES[kind].values():
        assert list(parts) == [part for part in PARTS if part != "check"]
        assert all(parts[part].endswith(".") for part in ("means", "how", "remedy"))


def explained(*words, code=0):
    result = CliRunner().invoke(main, ["explain", *words])
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


def test_a_code_is_explained_however_it_is_written():
    said = explained("dropped_samples")
    assert said.startswith("dropped_samples Samples are missing")
    assert all(part in said for part in ("How it comes about: ", "Remedy: ", "Example: "))
    assert said == explained("Dropped samples") == explained("dropped-samples")


def test_an_effect_is_explained():
    assert "Check on the rig: Raise the drive slowly" in explained("coulomb_friction")


def test_all_codes_are_listed():
    said = explained()
    assert all(f" {code} " in f" {said} " for each in CODES.values() for code in each)


def test_an_unknown_code_is_answered_with_one_that_is_meant():
    said = explained("droped_samples", code=2)
    assert said == (
        "Error: CODE: expected a known code, got 'droped_samples'; did you mean dropped_samples "
        "or unused_samples?"
    )
    assert "sklearn-pgnn explain lists all." in explained("xyz", code=2)
