"""Every finding, verdict, error, warning and effect has an entry; schemas name them all."""

import ast
import inspect
import re
from pathlib import Path

import pytest
from click.testing import CliRunner
from ruamel.yaml import YAML
from schemas import faults, read_schema

import sklearn_pgnn
from sklearn_pgnn import effects, exceptions
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.explain import PARTS, read_codes
from sklearn_pgnn.cli.options import SYSTEMS, make_system
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.exceptions import code_of
from sklearn_pgnn.fleet.machine import ORDER
from sklearn_pgnn.physics.model_file import _PARAMETER, _ROBOT, _SECTIONS
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


def codes_in(name):
    """Return the codes that findings have by a schema."""
    return set(read_schema(name)["$defs"]["finding"]["properties"]["code"]["enum"])


def test_verdicts_and_codes_are_those_of_the_package():
    machine = read_schema("fleet")["properties"]["machines"]["items"]["properties"]
    assert set(machine["verdict"]["enum"]) == set(ORDER)
    assert read_schema("diagnosis")["properties"]["verdict"]["enum"] == list(VERDICTS)
    assert codes_in("diagnosis") == set(CODES["findings"]) - {"poor_fit"}
    assert codes_in("check") == {*CODES["findings"], *CODES["warnings"]}


def test_a_model_file_has_the_keys_that_are_read():
    schema = read_schema("model")["properties"]
    one = schema["parameters"]["additionalProperties"]["anyOf"][1]
    for read, told in ((_SECTIONS, schema), (_ROBOT, schema["robot"]), (_PARAMETER, one)):
        assert set(read) == set(told.get("properties", told))


@pytest.mark.parametrize("like", SYSTEMS)
def test_a_written_model_file_is_one_by_its_schema(like):
    data = YAML(typ="safe").load(make_system(like).to_yaml())
    assert faults("model", data) == []
    assert faults("model", {**data, "state": {}})
    assert faults("model", {"name": "a model without states"})


DOCS = Path(__file__).parents[1] / "docs"


def test_every_effect_is_on_the_page_and_every_picture_is_there():
    text = (DOCS / "catalogue.rst").read_text(encoding="utf-8")
    assert set(re.findall(r"^   \* - ``(\w+)``", text, re.MULTILINE)) == {
        effect.id for effect in effects.CATALOGUE
    }
    shown = re.findall(r"image:: (\S+)", text)
    assert [name for name in shown if not (DOCS / name).is_file()] == []
    assert len(shown) == len(effects.CATALOGUE)
