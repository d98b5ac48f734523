"""The schemas name the verdicts, codes and keys of the package, and refuse what is not known."""

import pytest
from ruamel.yaml import YAML
from schemas import faults, read_schema
from test_codes import CODES

from sklearn_pgnn.cli.options import SYSTEMS, make_system
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.fleet.machine import ORDER
from sklearn_pgnn.physics.model_file import _PARAMETER, _ROBOT, _SECTIONS

pytestmark = pytest.mark.core


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
