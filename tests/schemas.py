"""The JSON schemas that the package ships, and what is checked against them."""

import json
from importlib.resources import files

from jsonschema import Draft202012Validator


def read_schema(name):
    """Return a schema, by the name of what it describes."""
    path = files("sklearn_pgnn").joinpath("schemas", f"{name}.schema.json")
    return json.loads(path.read_text(encoding="utf-8"))


def faults(name, data):
    """Return what a schema objects to, each with its place."""
    schema = read_schema(name)
    Draft202012Validator.check_schema(schema)
    found = Draft202012Validator(schema).iter_errors(data)
    return [f"{'.'.join(map(str, each.absolute_path))}: {each.message}" for each in found]
