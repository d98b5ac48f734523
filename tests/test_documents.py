"""What the documents show runs, and every public name says what it takes and gives."""

import doctest
import importlib
import inspect
import os
import pkgutil
import re
import subprocess
import sys
import textwrap
import types
from pathlib import Path

import pytest
from numpydoc.validate import validate

import sklearn_pgnn

ROOT = Path(__file__).parents[1]
PACKAGES = Path(sklearn_pgnn.__file__).parents[1]
MODULES = [
    module.name
    for module in pkgutil.walk_packages(sklearn_pgnn.__path__, "sklearn_pgnn.")
    if not module.name.endswith("__main__")
]
EXAMPLES = sorted((ROOT / "examples").glob("plot_*.py"))

CHECKS = {
    "GL03",  # no double blank lines
    "GL06",  # no unknown section
    "GL07",  # sections in order
    "GL08",  # there is a docstring
    "SS01",  # it begins with a summary
    "SS02",  # that begins with a capital letter,
    "SS03",  # ends with a full stop,
    "SS05",  # begins with an imperative
    "SS06",  # and fits one line
    "PR01",  # every parameter is described,
    "PR02",  # under its own name,
    "PR03",  # in the signature's order,
    "PR04",  # with a type
    "PR07",  # and a text
    "PR10",  # a space stands before the colon
    "RT01",  # what is returned is described,
    "RT03",  # with a text
    "YD01",  # and so is what is yielded
}


def in_package(value):
    return getattr(value, "__module__", "").startswith("sklearn_pgnn")


def public_names():
    """Yield the dotted path of every public function, class, method and property."""
    for module in map(importlib.import_module, MODULES):
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if callable(value) and in_package(value):
                path = f"{value.__module__}.{value.__name__}"
                yield path
                yield from (f"{path}.{method}" for method in methods(value))


def methods(value):
    """Yield the public methods and properties that a class adds to its bases."""
    kinds = (types.FunctionType, property, classmethod, staticmethod)
    for name, member in vars(value).items() if inspect.isclass(value) else ():
        inherited = any(hasattr(base, name) for base in value.__bases__)
        if isinstance(member, kinds) and not name.startswith("_") and not inherited:
            yield name


def run(*command, folder):
    """Run Python in a folder, without a display, with the package under test; give its result."""
    return subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": str(PACKAGES)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=600,
    )


@pytest.mark.parametrize("name", MODULES)
def test_doctests(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(importlib.import_module(name), optionflags=flags).failed == 0


@pytest.mark.parametrize("name", sorted(set(public_names())))
def test_docstring(name):
    found = validate(name)
    short = "\n" not in found["docstring"].strip()
    checks = CHECKS - {"RT01"} if short else CHECKS  # one line says what is returned
    assert [text for code, text in found["errors"] if code in checks] == []


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_example_runs(path, tmp_path):
    result = run(path, folder=tmp_path)
    assert result.returncode == 0, result.stderr


def test_the_model_file_of_the_user_guide_is_one(tmp_path):
    text = (ROOT / "docs" / "user_guide.rst").read_text(encoding="utf-8")
    block = re.search(r"code-block:: yaml\n\n((?:    .*\n|\n)+)", text)[1]
    path = tmp_path / "model.yaml"
    path.write_text(textwrap.dedent(block), encoding="utf-8")
    model = sklearn_pgnn.PhysicsModel.from_yaml(path)
    assert model.name == "pendulum"
    assert model.columns == {"torque": "tau_cmd"}


def test_the_example_of_the_readme_runs(tmp_path):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    result = run("-c", re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], folder=tmp_path)
    assert result.returncode == 0, result.stderr
