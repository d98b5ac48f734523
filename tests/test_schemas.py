"""The schemas and the classes have the same keys, and a schema refuses what is not known."""

from dataclasses import fields
from importlib.resources import files

import pytest
from ruamel.yaml import YAML
from schemas import faults, read_schema
from test_codes import FINDINGS, codes_of

from sklearn_pgnn.cli.options import SYSTEMS, make_system
from sklearn_pgnn.diagnosis import FreeRunError, Gain, Remaining, RetunedParameter, Rival
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.estimation.unusable import Unusable
from sklearn_pgnn.experiment_design.separation import Experiment, Wave
from sklearn_pgnn.fleet.changes import Change
from sklearn_pgnn.fleet.machine import ORDER, FleetCause
from sklearn_pgnn.inspection.first_look import FirstFit, SeenQuantity, SeenRecord
from sklearn_pgnn.physics.model_file import _PARAMETER, _ROBOT, _SECTIONS
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.simulation.uncertainty import Estimate

pytestmark = pytest.mark.core

#: by the name of a definition the class that it describes, and keys that are not of the class
DEFINED = {
    "finding": (Finding, {"code"}),
    "candidate": (Candidate, set()),
    "estimate": (Estimate, set()),
    "rival": (Rival, {"equivalent"}),
    "parameter": (RetunedParameter, set()),
    "gain": (Gain, set()),
    "free_run": (FreeRunError, set()),
    "law": (Structure, set()),
    "remaining": (Remaining, set()),
    "wave": (Wave, set()),
    "experiment": (Experiment, set()),
    "unusable": (Unusable, set()),
}
LISTED = {
    ("check", "records"): SeenRecord,
    ("check", "quantities"): SeenQuantity,
    ("check", "outputs"): FirstFit,
    ("fleet", "causes"): FleetCause,
    ("fleet", "changes"): Change,
}


def names_of(kind):
    return set(getattr(kind, "_fields", ()) or (field.name for field in fields(kind)))


@pytest.mark.parametrize("name", DEFINED)
def test_a_definition_has_the_keys_of_its_class(name):
    kind, more = DEFINED[name]
    defined = read_schema("diagnosis")["$defs"][name]
    assert set(defined["properties"]) == set(defined["required"]) == names_of(kind) | more


@pytest.mark.parametrize(("schema", "table"), LISTED)
def test_a_row_has_the_keys_of_its_class(schema, table):
    row = read_schema(schema)["properties"][table]["items"]
    assert set(row["properties"]) == set(row["required"]) == names_of(LISTED[schema, table])


def test_verdicts_and_codes_are_those_of_the_package():
    diagnosis, fleet, check = map(read_schema, ("diagnosis", "fleet", "check"))
    machine = fleet["properties"]["machines"]["items"]["properties"]
    of_check = {*FINDINGS, *codes_of("warnings")}
    assert diagnosis["properties"]["verdict"]["enum"] == list(VERDICTS)
    assert set(machine["verdict"]["enum"]) == set(ORDER)
    assert set(check["$defs"]["finding"]["properties"]["code"]["enum"]) == of_check
    found = diagnosis["$defs"]["finding"]["properties"]["code"]["enum"]
    assert set(found) == set(FINDINGS) - {"poor_fit"}


def test_a_model_file_has_the_keys_that_are_read():
    schema = read_schema("model")["properties"]
    assert set(schema) == set(_SECTIONS)
    assert set(schema["robot"]["properties"]) == set(_ROBOT)
    one = schema["parameters"]["additionalProperties"]["anyOf"][1]
    assert set(one["properties"]) == set(_PARAMETER)


@pytest.mark.parametrize("like", SYSTEMS)
def test_a_written_model_file_is_one_by_its_schema(like):
    data = YAML(typ="safe").load(make_system(like).to_yaml())
    assert faults("model", data) == []
    assert faults("model", {**data, "state": {}})
    assert faults("model", {"name": "a model without states"})


def test_every_schema_is_one():
    shipped = sorted(file.name for file in files("sklearn_pgnn").joinpath("schemas").iterdir())
    names = [name.removesuffix(".schema.json") for name in shipped]
    assert names == ["check", "diagnosis", "fleet", "model"]
    assert all(faults(name, {}) for name in names)
