"""What the documents show runs, and every public name says what it takes and gives."""

import doctest
import importlib
import inspect
import json
import os
import pkgutil
import re
import subprocess
import sys
import textwrap
import types
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from blocked import run_without
from numpydoc.validate import validate
from snippets import PAGES, blocked, read_needs, read_page

import sklearn_pgnn
from sklearn_pgnn.cli import main

ROOT = Path(__file__).parents[1]
PACKAGES = Path(sklearn_pgnn.__file__).parents[1]
MODULES = [
    module.name
    for module in pkgutil.walk_packages(sklearn_pgnn.__path__, "sklearn_pgnn.")
    if not module.name.endswith("__main__")
]
#: pages with snippets; what public_benchmarks.rst shows downloads, see test_datasets
SNIPPETS = {
    path.name: snippets
    for path in PAGES
    if (snippets := read_page(path)) and path.name != "public_benchmarks.rst"
}
BRIEF = "max_epochs=2, rollout_epochs=1, refine=None"
EXAMPLES = sorted((ROOT / "examples").glob("plot_*.py"))

#: modules whose examples diagnose, fit a network or hide every effect
LONG_DOCTESTS = {
    "sklearn_pgnn.datasets.hidden_effect",
    "sklearn_pgnn.diagnosis.model_diagnosis",
    "sklearn_pgnn.estimators.pgnnl",
    "sklearn_pgnn.fleet.fleet_diagnosis",
    "sklearn_pgnn.grey_box.grey_box_regressor",
    "sklearn_pgnn.inspection.display",
    "sklearn_pgnn.inspection.report.page",
}

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


def public_names():
    """Yield the dotted path of every public function, class, method and property."""
    for module in map(importlib.import_module, MODULES):
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if callable(value) and getattr(value, "__module__", "").startswith("sklearn_pgnn"):
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


def run_doctests(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(importlib.import_module(name), optionflags=flags).failed == 0
    plt.close("all")


@pytest.mark.parametrize("name", [name for name in MODULES if name not in LONG_DOCTESTS])
def test_doctests(name, tmp_path, monkeypatch):
    run_doctests(name, tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(LONG_DOCTESTS))
def test_long_doctests(name, tmp_path, monkeypatch):
    run_doctests(name, tmp_path, monkeypatch)


@pytest.mark.parametrize("name", sorted(set(public_names())))
def test_docstring(name):
    found = validate(name)
    short = "\n" not in found["docstring"].strip()
    checks = CHECKS - {"RT01"} if short else CHECKS  # one line says what is returned
    assert [text for code, text in found["errors"] if code in checks] == []


def test_every_public_name_is_in_the_pages_of_the_api():
    listed = {
        line.split(".")[-1].strip()
        for line in (ROOT / "docs" / "api.rst").read_text(encoding="utf-8").splitlines()
    }
    values = {name: getattr(sklearn_pgnn, name) for name in sklearn_pgnn.__all__}
    modules = [value for value in values.values() if inspect.ismodule(value)]
    objects = [name for name, value in values.items() if callable(value)]
    for names in (objects, *(getattr(module, "__all__", ()) for module in modules)):
        assert set(names) <= listed


def listed_names():
    """Return the names on the pages of the API."""
    pages = (ROOT / "docs" / "api.rst").read_text(encoding="utf-8")
    return re.findall(r"^   ([A-Za-z_][\w.]*)$", pages, re.MULTILINE)


@pytest.mark.parametrize("name", listed_names())
def test_every_name_in_the_pages_of_the_api_has_an_example(name):
    module, _, last = f"sklearn_pgnn.{name}".rpartition(".")
    value = getattr(pkgutil.resolve_name(module), last)
    assert ">>> " in inspect.getdoc(value)


#: the same in less time; `docs/run_examples.py NAME` runs an example as it is
SHORTER_EXAMPLES = {
    "ModelDiagnosis(machine.prior)": (
        "ModelDiagnosis(machine.prior, catalogue=['stribeck_friction', 'input_dead_zone'])"
    ),
    "ModelDiagnosis(model)": "ModelDiagnosis(model, catalogue=['coulomb_friction'])",
    "np.arange(0, 30, 0.02)": "np.arange(0, 15, 0.02)",
    "sample_rate=200)": "duration=5, sample_rate=50)",
    "PGNNLRegressor(states=": f"PGNNLRegressor({BRIEF}, states=",
    "make_pgnn_pipeline(golf)": f"make_pgnn_pipeline(golf, {BRIEF})",
    '"max_epochs": 10, "refine_max_iter": 10': '"max_epochs": 2, "refine_max_iter": 2',
    "n_iter=4": "n_iter=1",
    "lambdas=(0.0, 0.03, 0.3, 0.9)": "lambdas=(0.0, 0.3)",
}


def shortened(program, shorter):
    """Return a program with shorter records, fewer effects and fewer rounds."""
    for text, brief in shorter.items():
        program = program.replace(text, brief)
    return program


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_example_runs(path, tmp_path):
    program = shortened(path.read_text(encoding="utf-8"), SHORTER_EXAMPLES)
    result = run("-c", program, folder=tmp_path)
    assert result.returncode == 0, result.stderr


def test_what_makes_examples_shorter_is_in_them():
    programs = "\n".join(path.read_text(encoding="utf-8") for path in EXAMPLES)
    assert [text for text in SHORTER_EXAMPLES if text not in programs] == []


def test_the_model_file_of_the_user_guide_is_one(tmp_path):
    text = (ROOT / "docs" / "user_guide.rst").read_text(encoding="utf-8")
    block = re.search(r"code-block:: yaml\n\n((?:    .*\n|\n)+)", text)[1]
    path = tmp_path / "model.yaml"
    path.write_text(textwrap.dedent(block), encoding="utf-8")
    model = sklearn_pgnn.PhysicsModel.from_yaml(path)
    assert model.name == "pendulum"
    assert model.columns == {"torque": "tau_cmd"}


def test_the_cranes_of_the_user_guide_are_one(tmp_path):
    text = (ROOT / "docs" / "user_guide.rst").read_text(encoding="utf-8")
    blocks = re.findall(r"code-block:: yaml\n\n((?:    .*\n|\n)+)", text)
    path = tmp_path / "model.yaml"
    models = []
    for block in (block for block in blocks if "name: crane" in block):
        path.write_text(textwrap.dedent(block), encoding="utf-8")
        models.append(sklearn_pgnn.PhysicsModel.from_yaml(path))
    by_matrix, by_energies = models
    assert by_matrix.energy == {} != by_energies.energy
    assert by_matrix == by_energies.replace(energy={})


def shown_files(page):
    """Return what a page shows of files, by their names."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    found = re.findall(r":caption: (\w+\.\w+)\n\n((?:    .*\n|\n)+)", text)
    return {name: textwrap.dedent(block).split("\n") for name, block in found}


@pytest.mark.slow
def test_the_first_machine_is_diagnosed_as_the_page_shows(tmp_path):
    text = (ROOT / "docs" / "quickstart.rst").read_text(encoding="utf-8")
    (make_records, *_) = (snippet.code for snippet in SNIPPETS["quickstart.rst"])
    assert run("-c", make_records, folder=tmp_path).returncode == 0
    for command in re.findall(r"code-block:: bash\n\n    sklearn-pgnn (.*)", text):
        arguments = []  # as a shell makes them: of a pattern, the files it matches
        for word in command.split():
            matched = sorted(path.name for path in tmp_path.glob(word)) if "*" in word else [word]
            arguments += matched
        result = run("-c", "from sklearn_pgnn.cli import main; main()", *arguments, folder=tmp_path)
        assert result.returncode == 0, result.stderr
    for name, lines in shown_files("quickstart.rst").items():
        written = (tmp_path / name).read_text(encoding="utf-8").splitlines()
        assert [line for line in lines if line and line not in written] == []
    found = json.loads((tmp_path / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["verdict"] == "cause_named"
    (cause,) = found["causes"]
    assert (cause["effect"], cause["target"]) == ("coulomb_friction", "v")
    assert cause["parameters"]["level"]["value"] == pytest.approx(1.0, abs=0.02)


def test_every_command_is_on_its_page():
    text = (ROOT / "docs" / "command_line.rst").read_text(encoding="utf-8")
    assert [name for name in main.commands if f"\n``{name}``\n" not in text] == []


#: the same in less time: shorter records, fewer effects, fewer rounds; `.ci/run` runs the README's
#: first example as it is
SHORTER = {
    "make_golf_robot(sample_rate=100)": "make_golf_robot(duration=5, sample_rate=40)",
    '"stribeck_friction", sample_rate': '"stribeck_friction", duration=5, n_records=2, sample_rate',
    "effect, random_state=0)": "effect, n_records=3, duration=5, sample_rate=100, random_state=0)",
    "ModelDiagnosis(golf)": "ModelDiagnosis(golf, catalogue=['stribeck_friction'])",
    "ModelDiagnosis(hidden.prior)": "ModelDiagnosis(hidden.prior, catalogue=['coulomb_friction'])",
    'golf, targets=["omega"]': 'golf, catalogue=["coulomb_friction"], targets=["omega"]',
    "n_iter=8": "n_iter=1",
    "TrajectoryKFold(3)": "TrajectoryKFold(2)",
    "make_pgnn_pipeline(golf, ": f"make_pgnn_pipeline(golf, {BRIEF}, ",
    "PGNNLRegressor(golf, ": f"PGNNLRegressor(golf, {BRIEF}, ",
    "verify=True": "effects=[effects.CoulombFriction]",
}
ENVIRONMENTS = sorted(
    {(page, snippet.needs) for page, snippets in SNIPPETS.items() for snippet in snippets},
    key=lambda pair: (pair[0], sorted(pair[1])),
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "needs"), ENVIRONMENTS, ids=[f"{page}-{sorted(needs)}" for page, needs in ENVIRONMENTS]
)
def test_snippets_run_where_only_what_they_name_is_installed(page, needs, tmp_path):
    shown = [snippet.code for snippet in SNIPPETS[page] if snippet.needs <= needs]
    program = shortened("\n".join(shown), SHORTER)
    result = run_without(blocked(needs), program, tmp_path)
    assert result.returncode == 0, result.stderr


def test_what_makes_snippets_shorter_is_in_them():
    program = "\n".join(snippet.code for page in SNIPPETS.values() for snippet in page)
    assert [text for text in SHORTER if text not in program] == []


@pytest.mark.parametrize("text", ["Then:", None])
def test_a_snippet_that_does_not_say_what_it_needs_is_found(text):
    with pytest.raises(AssertionError, match=r"README\.md does not say what it needs"):
        read_needs(text, "README.md")
