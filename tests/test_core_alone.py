"""The core works without any extra, and what needs one says which."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from blocked import run_without

from sklearn_pgnn.extras import EXTRA_OF, EXTRAS

pytestmark = pytest.mark.core

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
#: what is installed to build and test, and what takes in all others
OTHERS = {"all", "docs", "test"}

#: by extra, what needs it
USES = {
    "network": [
        "sklearn_pgnn.PGNNLRegressor",
        "sklearn_pgnn.make_pgnn_pipeline",
        "sklearn_pgnn.network",
        "import sklearn_pgnn.network",
        "from sklearn_pgnn import PGNNLRegressor",
        "from sklearn_pgnn.network import EnergyBalance",
        "from sklearn_pgnn.estimators.pgnnl import PGNNLRegressor",
    ],
    "sindy": ["sklearn_pgnn.SINDYcRegressor().fit([[0.0], [1.0], [2.0], [3.0]], [0, 1, 2, 3])"],
    "fmu": ["from sklearn_pgnn.priors import from_fmu; from_fmu('a.fmu')"],
    "tuning": [
        "sklearn_pgnn.model_selection.search_space(sklearn_pgnn.SINDYcRegressor())",
    ],
    "app": ["import sklearn_pgnn.cli.app.serve"],
    "benchmarks": [
        "sklearn_pgnn.datasets.load_emps()",
        "sklearn_pgnn.datasets.load_cascaded_tanks()",
        "sklearn_pgnn.datasets.load_coupled_drives()",
        "sklearn_pgnn.datasets.load_silverbox()",
    ],
    "dask": [
        "from sklearn_pgnn.cli.fleet_job import on_cluster\nwith on_cluster('tcp://x'): pass",
    ],
    "control": [
        "sklearn_pgnn.export.to_control(sklearn_pgnn.systems.two_tanks())",
        "sklearn_pgnn.priors.from_control(None)",
    ],
    "export": [
        "sklearn_pgnn.export.to_casadi(sklearn_pgnn.systems.two_tanks())",
        "sklearn_pgnn.priors.from_casadi(None, {})",
    ],
    "robots": [
        "from sklearn_pgnn.priors import from_urdf; from_urdf('arm.urdf')",
        "from sklearn_pgnn.priors import from_mjcf; from_mjcf('arm.xml')",
    ],
    "mdf": ["from sklearn_pgnn.trajectories import read_file; read_file('run.mf4', None)"],
    "ros": ["from sklearn_pgnn.trajectories import read_file; read_file('run.bag', None)"],
    "files": [
        "from sklearn_pgnn.trajectories import read_file; read_file('run.xlsx', None)",
        "from sklearn_pgnn.trajectories import read_file; read_file('run.parquet', None)",
        "from sklearn_pgnn.trajectories import read_file; read_file('run.mat', None)",
    ],
}


def run(program, folder):
    """Run a program without any library of an extra."""
    return run_without(EXTRA_OF, program, folder)


@pytest.mark.slow
def test_a_cause_outside_the_catalogue_is_described_plotted_and_reported(tmp_path):
    program = """
import sklearn_pgnn.systems
from sklearn_pgnn import ModelDiagnosis, datasets
from sklearn_pgnn.effects import CoulombFriction, Formula

hidden = datasets.make_hidden_effect(
    sklearn_pgnn.systems.cart_on_spring(),
    Formula("v", ("v*x**2",), (-24.0,)),
    random_state=1,
    n_records=5,
    sample_rate=100.0,
)
diagnosis = ModelDiagnosis(hidden.prior, catalogue=(CoulombFriction,)).fit(hidden.X, hidden.y)
diagnosis.extended_model_.to_yaml("model.yaml")
diagnosis.to_html("report.html")
diagnosis.plot().figure_.savefig("picture.png")
print(diagnosis.verdict_, *diagnosis.discrepancy_.effect.terms)
"""
    result = run(program, tmp_path)
    assert result.returncode == 0, result.stderr
    assert result.stdout.split() == ["unexplained", "v*x**2"]
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {"model.yaml", "picture.png", "report.html"}


@pytest.mark.slow
def test_help_and_listings_work_and_hold_what_is_there(tmp_path):
    program = """
import inspect, pydoc, sklearn_pgnn
from sklearn_pgnn import *

names = {name for name, _ in inspect.getmembers(sklearn_pgnn)}
assert names == set(dir(sklearn_pgnn)) == set(sklearn_pgnn.__all__)
assert names.isdisjoint({"PGNNLRegressor", "make_pgnn_pipeline", "network"})
assert ModelDiagnosis and SINDYcRegressor and PhysicsModelRegressor and effects.CATALOGUE
help(sklearn_pgnn)
"""
    result = run(program, tmp_path)
    assert result.returncode == 0, result.stderr
    assert "class ModelDiagnosis" in result.stdout
    assert "need the extra ``network``" in result.stdout


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What is said, extra by extra, to whoever uses what needs it; one process tries all."""
    folder = tmp_path_factory.mktemp("extras")
    (folder / "arm.urdf").write_text("<robot/>")
    (folder / "arm.xml").write_text("<mujoco/>")
    (folder / "run.mat").write_bytes(b"\x89HDF\r\n\x1a\n")  # as version 7.3 begins
    program = f"""
import json, sklearn_pgnn
said = {{}}
for extra, uses in {USES!r}.items():
    said[extra] = []
    for use in uses:
        try:
            exec(use)
        except ModuleNotFoundError as error:
            said[extra].append(str(error))
print(json.dumps(said))
"""
    result = run(program, folder)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("extra", EXTRAS)
def test_what_needs_an_extra_says_which(said, extra):
    assert len(said[extra]) == len(USES[extra])
    remedy = f'which is not installed. Remedy: pip install "sklearn-pgnn[{extra}]".'
    assert [line for line in said[extra] if not line.endswith(remedy)] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "inside", ["raise ImportError('a shared object is missing')", "import its_own_need"]
)
def test_a_library_that_is_there_and_broken_says_so_itself(tmp_path, inside):
    uses = {
        "torch": "import sklearn_pgnn.network",
        "pysindy": "sklearn_pgnn.SINDYcRegressor().fit([[0.0], [1.0], [2.0], [3.0]], range(4))",
        "skopt": "sklearn_pgnn.model_selection.search_space(sklearn_pgnn.SINDYcRegressor())",
        "nonlinear_benchmarks": "sklearn_pgnn.datasets.load_emps()",
    }
    for library in uses:
        (tmp_path / f"{library}.py").write_text(inside, encoding="utf-8")
    program = f"""
import sklearn_pgnn
for use in {list(uses.values())}:
    try:
        exec(use)
    except ImportError as error:
        print(error)
"""
    result = run_without((), program, tmp_path, tmp_path)
    assert result.returncode == 0, result.stderr
    said = "a shared object is missing" if "raise" in inside else "No module named 'its_own_need'"
    assert result.stdout.splitlines() == [said] * len(uses)


def test_every_extra_can_be_installed_and_all_takes_them_in():
    offered = PROJECT["project"]["optional-dependencies"]
    assert set(offered) - OTHERS == set(EXTRAS)
    (every,) = offered["all"]
    assert set(re.search(r"\[(.*)\]", every)[1].split(",")) == set(EXTRAS)
