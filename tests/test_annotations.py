"""Every public name says the types of what it takes and returns; type checkers find them."""

import inspect
import re
from importlib import import_module
from importlib.resources import files
from pathlib import Path

import pytest

API = Path(__file__).parents[1] / "docs" / "api.rst"


def public_names():
    """Return the names in docs/api.rst, with the module before those that its tables shorten."""
    names, module = [], ""
    for line in API.read_text(encoding="utf-8").splitlines():
        if found := re.match(r"\.\. currentmodule:: (\S+)", line):
            module = found[1]
        elif found := re.fullmatch(r"   ([A-Za-z_][\w.]*)", line):
            names.append(f"{module}.{found[1]}")
    return names


def resolved(name):
    parts = name.split(".")
    for at in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:at]))
        except ModuleNotFoundError as error:
            if error.name is not None and not error.name.startswith("sklearn_pgnn"):
                pytest.skip(str(error))
            continue
        for part in parts[at:]:
            found = getattr(found, part)
        return found
    raise AssertionError(name)


def callables(found):
    """Yield a function, or the methods and properties of a class that this package defines."""
    if not inspect.isclass(found):
        yield found.__name__, found
        return
    for name, _ in inspect.getmembers(found):
        part = inspect.getattr_static(found, name)
        part = getattr(part, "__func__", getattr(part, "fget", getattr(part, "func", part)))
        part = inspect.unwrap(part) if callable(part) else part
        is_ours = inspect.isfunction(part) and part.__module__.startswith("sklearn_pgnn")
        if is_ours and (name == "__init__" or not name.startswith("_")):
            yield f"{found.__name__}.{name}", part


def missing(name, function):
    """Return what has no type: parameters, and the result."""
    signature = inspect.signature(function)
    bare = [p for p in signature.parameters.values() if p.annotation is p.empty]
    lacks = [p.name for p in bare if p.name not in ("self", "cls")]
    if signature.return_annotation is signature.empty and not name.endswith(".__init__"):
        lacks.append("return")
    return [f"{name}: {', '.join(lacks)}"] if lacks else []


NAMES = public_names()


def test_the_names_are_found():
    assert len(NAMES) > 100
    assert {"sklearn_pgnn.PhysicsModel", "sklearn_pgnn.simulation.simulate"} <= {*NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_is_annotated(name):
    found = resolved(name)
    if inspect.isclass(found) or callable(found):
        assert [gap for pair in callables(found) for gap in missing(*pair)] == []


def test_type_checkers_are_told_that_there_are_types():
    assert files("sklearn_pgnn").joinpath("py.typed").is_file()
