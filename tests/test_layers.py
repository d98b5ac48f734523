"""Imports go down only, and each heavy library stays in its package."""

import ast
import re
from pathlib import Path

import pytest

import sklearn_pgnn

pytestmark = pytest.mark.core

#: from the bottom; a package imports from lower layers only, not from others in its own
LAYERS = (
    {
        "annotations",
        "exceptions",
        "extras",
        "readings",
        "stages",
        "threads",
        "user_line",
        "whole_file",
    },
    {"__init__"},
    {"physics", "progress_display"},
    {"effects", "priors", "systems", "trajectories"},
    {"simulation"},
    {"preprocessing", "estimators", "model_selection"},
    {"network", "pipeline", "prediction"},
    {"estimation"},
    {"record_quality"},
    {"experiment_design"},
    {"diagnosis"},
    {"grey_box", "inspection"},
    {"export", "datasets", "fleet"},
    {"cli"},
    {"__main__"},
)
HEIGHT = {package: height for height, packages in enumerate(LAYERS) for package in packages}

#: packages that may see less than their layer: the integrator behind the records is independent
NARROWER = {"datasets": {"annotations", "exceptions", "extras", "physics", "trajectories"}}

#: where a heavy library may be imported: beginnings of paths inside the package
HOMES = {
    "llvmlite": ("simulation",),
    "numba": ("simulation",),
    "matplotlib": ("inspection",),
    "pysindy": ("estimators/sindyc",),
    "torch": ("estimators/pgnnl", "estimators/network"),
    "skorch": ("estimators/pgnnl", "estimators/network"),
    "pint": ("physics/units",),
    "skopt": ("model_selection/halving_bayes_search", "model_selection/search_space"),
    "starlette": ("cli/app",),
    "uvicorn": ("cli/app",),
    "casadi": ("export/casadi_function", "priors/casadi_program"),
    "onnx": ("export/onnx_",),
    "fmpy": ("priors/fmu_",),
    "mujoco": ("priors/robot",),
    "control": ("export/control_system", "priors/nlsys"),
    "distributed": ("cli/fleet_job",),
    "nonlinear_benchmarks": ("datasets/public",),
}

#: the two files that name packages by text, to import them when they are first used
BY_TEXT = ("__init__.py", "readings.py")

MODULE_NAME = re.compile(r"sklearn_pgnn(\.\w+)+(:\w+)?")


def imported(tree):
    """Yield line and dotted name of everything a module imports, also inside functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def test_the_table_for_contributors_is_this_one():
    text = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \d+ \|(.+?)\|", text, flags=re.MULTILINE)
    told = [set(re.findall(r"`(\w+)`", row)) for row in reversed(rows)]
    assert told == [layer for layer in LAYERS if not layer & {"__init__", "__main__"}]


def named(tree):
    """Yield line and text of every string that is a module of the package."""
    for node in ast.walk(tree):
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(text, str) and MODULE_NAME.fullmatch(text):
            yield node.lineno, text.replace(":", ".")


def objection(path, name):
    """Return what is wrong with a file's import of a name, or None."""
    package = path.split("/")[0].removesuffix(".py")
    library, *rest = name.split(".")
    if name.startswith("."):
        return "relative import"
    if library in HOMES:
        return None if path.startswith(HOMES[library]) else f"{library} has no place here"
    if library != "sklearn_pgnn" or (package in ("cli", "fleet") and rest == ["__version__"]):
        return None
    if not rest or rest[0] not in HEIGHT:
        return f"{name} is not in a layer"
    if rest[0] == package:
        return None
    if HEIGHT[rest[0]] >= HEIGHT[package]:
        return f"{package} is not above {rest[0]}"
    if rest[0] not in NARROWER.get(package, HEIGHT):
        return f"{package} does without {rest[0]}"
    return None


def violations(root):
    """List every import in a package that the rules above forbid."""
    found = []
    for file in sorted(root.rglob("*.py")):
        path = file.relative_to(root).as_posix()
        tree = ast.parse(file.read_text(encoding="utf-8"))
        package = path.split("/")[0].removesuffix(".py")
        if package not in HEIGHT:
            found.append(f"{path}: {package} is not in a layer")
            continue
        names = [*imported(tree), *(() if path in BY_TEXT else named(tree))]
        found += [
            f"{path}:{line}: {what}" for line, name in names if (what := objection(path, name))
        ]
    return found


@pytest.mark.slow
def test_imports_go_down_only():
    assert violations(Path(sklearn_pgnn.__file__).parent) == []


@pytest.mark.parametrize(
    ("path", "source", "what"),
    [
        ("physics/a.py", "from sklearn_pgnn.simulation import b", "not above"),
        ("physics/a.py", "def f():\n    import sklearn_pgnn.diagnosis.b", "not above"),
        ("physics/a.py", "from sklearn_pgnn import diagnosis", "not above"),
        ("physics/a.py", "resolve_name('sklearn_pgnn.simulation:b')", "not above"),
        ("physics/a.py", "from .model import b", "relative"),
        ("physics/a.py", "from . import b", "relative"),
        ("physics/a.py", "import sklearn_pgnn", "not in a layer"),
        ("physics/a.py", "from sklearn_pgnn.effects import b", "not above"),
        ("__init__.py", "from sklearn_pgnn.physics import b", "not above"),
        ("physics/a.py", "from sklearn_pgnn import PhysicsModel", "not in a layer"),
        ("physics/a.py", "from numba import njit", "no place"),
        ("estimators/a.py", "from sklearn_pgnn.preprocessing import b", "not above"),
        ("estimators/a.py", "import torch.nn", "no place"),
        ("estimators/sindyc.py", "import torch", "no place"),
        ("datasets/a.py", "from sklearn_pgnn.simulation import b", "does without"),
        ("diagnosis/a.py", "import matplotlib.pyplot as plt", "no place"),
        ("__init__.py", "import matplotlib", "no place"),
        ("attic/a.py", "", "not in a layer"),
    ],
)
def test_a_violation_is_caught(tmp_path, path, source, what):
    found = violations(write(tmp_path, path, source))
    assert len(found) == 1
    assert found[0].startswith(path)
    assert what in found[0]


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("physics/a.py", "from sklearn_pgnn.physics.b import c"),
        ("simulation/a.py", "import numba\nfrom sklearn_pgnn.trajectories import b"),
        ("inspection/a.py", "import matplotlib.pyplot as plt"),
        ("estimators/sindyc.py", "import pysindy"),
        ("estimators/network/a.py", "import torch\nimport skorch"),
        ("diagnosis/a.py", "from sklearn_pgnn.estimators import b"),
        ("cli.py", "from sklearn_pgnn import __version__, datasets"),
        ("readings.py", "HOMES = {'simulate': 'sklearn_pgnn.simulation:simulate'}"),
        ("__init__.py", "from sklearn_pgnn.extras import b"),
        ("network.py", "from sklearn_pgnn.estimators.network import b"),
        ("__init__.py", "HOMES = {'a': 'sklearn_pgnn.simulation'}"),
    ],
)
def test_what_is_allowed_passes(tmp_path, path, source):
    assert violations(write(tmp_path, path, source)) == []


def write(folder, path, source):
    file = folder / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(source, encoding="utf-8")
    return folder
