"""Loaders of public benchmarks, on small files in the benchmarks' own format."""

import re
import sys

import numpy as np
import pytest
from blocked import run_without
from scipy.io import savemat
from snippets import ROOT, blocked, read_page

from sklearn_pgnn import PhysicsModelRegressor
from sklearn_pgnn.datasets import (
    load_cascaded_tanks,
    load_coupled_drives,
    load_emps,
    load_silverbox,
)

RNG = np.random.default_rng(0)
EMPS = {
    name: {key: RNG.normal(size=(n, 1)) for key in ("vir", "qm", "qg")}
    | {"t": 1e-3 * np.arange(n)[:, None]}
    for name, n in (("DATA_EMPS.mat", 60), ("DATA_EMPS_PULSES.mat", 50))
}
TANKS = {key: RNG.normal(size=(70, 1)) for key in ("uEst", "yEst", "uVal", "yVal")} | {"Ts": 4.0}
SILVERBOX = {key: RNG.normal(size=(1, 127_500)) for key in ("V1", "V2")}
DRIVES = {key: RNG.normal(size=(500, 1)) for key in ("u11", "z11", "u12", "z12")}
LOADERS = [load_emps, load_cascaded_tanks, load_coupled_drives, load_silverbox]


@pytest.fixture
def home(tmp_path):
    """Lay the files where `nonlinear_benchmarks` keeps them."""
    places = {
        "EMPS": EMPS,
        "Cascaded_Tanks/CascadedTanksFiles": {"dataBenchmark.mat": TANKS},
        "CED": {"DATAUNIF.MAT": DRIVES},
        "Silverbox/SilverboxFiles": {"SNLS80mV.mat": SILVERBOX},
    }
    for folder, files in places.items():
        (tmp_path / folder).mkdir(parents=True)
        for name, variables in files.items():
            savemat(tmp_path / folder / name, variables, appendmat=False)
    # the package takes files for downloaded where it sees the archive they came in
    for archive in (
        "EMPS/EMPS.zip",
        "Cascaded_Tanks/CascadedTanksFiles.zip",
        "CED/FULLTEXT01.zip",
        "Silverbox/SilverboxFiles.zip",
    ):
        (tmp_path / archive).touch()
    return tmp_path


def test_emps_is_in_newtons_and_metres(home):
    emps = load_emps(data_home=home)
    np.testing.assert_allclose(
        emps.X_train["force"], 35.15065188 * EMPS["DATA_EMPS.mat"]["vir"].T[0]
    )
    np.testing.assert_array_equal(emps.y_train["position"], EMPS["DATA_EMPS.mat"]["qm"][:, 0])
    test = EMPS["DATA_EMPS_PULSES.mat"]
    np.testing.assert_array_equal(emps.X_test["t"], test["t"][:, 0])
    np.testing.assert_allclose(emps.X_test["force"], 35.15065188 * test["vir"][:, 0])
    np.testing.assert_array_equal(emps.y_test["position"], test["qm"][:, 0])


def test_tanks_have_a_file_for_both_records(home):
    tanks = load_cascaded_tanks(data_home=home)
    for X, y, name in (
        (tanks.X_train, tanks.y_train, "Est"),
        (tanks.X_test, tanks.y_test, "Val"),
    ):
        np.testing.assert_array_equal(X["t"], 4.0 * np.arange(70))
        np.testing.assert_array_equal(X["pump"], TANKS[f"u{name}"][:, 0])
        np.testing.assert_array_equal(y["level"], TANKS[f"y{name}"][:, 0])


def test_the_silverbox_is_learned_from_multisines_and_judged_beyond_them(home):
    box = load_silverbox(data_home=home)
    u, y = SILVERBOX["V1"][0], SILVERBOX["V2"][0]
    np.testing.assert_array_equal(box.X_train["drive"], u[40_650 : 40_650 + 65_062])
    for name, rows in {
        "multisine": slice(40_650 + 65_062, 127_400),
        "arrow": slice(100, 40_575),
        "arrow_within": slice(100, 32_100),
    }.items():
        mine = (box.X_test["trajectory"] == name).to_numpy()
        np.testing.assert_array_equal(box.X_test["drive"][mine], u[rows])
        np.testing.assert_array_equal(box.y_test["response"][mine], y[rows])


def test_nobody_claims_to_know_the_flows_of_the_tanks(home):
    prior = load_cascaded_tanks(data_home=home).prior
    assert {parameter.spread for parameter in prior.parameters.values()} == {np.inf}


def test_the_drives_test_goes_on_where_training_ends(home):
    drives = load_coupled_drives(data_home=home)
    for X, y, rows in (
        (drives.X_train, drives.y_train, slice(0, 400)),
        (drives.X_test, drives.y_test, slice(400, 500)),
    ):
        for name, u, z in (("low", "u11", "z11"), ("high", "u12", "z12")):
            mine = (X["trajectory"] == name).to_numpy()
            np.testing.assert_allclose(X["t"][mine], 0.02 * np.arange(500)[rows])
            np.testing.assert_array_equal(X["voltage"][mine], DRIVES[u][rows, 0])
            np.testing.assert_array_equal(y["pulses"][mine], DRIVES[z][rows, 0])


def gain(name):
    return 35.15065188 if name == "EMPS" else 1.0


@pytest.mark.parametrize(
    ("name", "load"),
    [
        ("EMPS", load_emps),
        ("Cascaded_Tanks", load_cascaded_tanks),
        ("CED", load_coupled_drives),
        ("Silverbox", load_silverbox),
    ],
)
def test_records_splits_and_windows_are_those_of_the_package(home, name, load):
    package = pytest.importorskip("nonlinear_benchmarks")
    theirs = getattr(package, name)(dir_placement=home, always_return_tuples_of_datasets=True)
    ours = load(data_home=home)
    for X, y, records in (
        (ours.X_train, ours.y_train, theirs[0]),
        (ours.X_test, ours.y_test, theirs[1]),
    ):
        assert X["trajectory"].nunique() == len(records)
        u, z = (np.concatenate([getattr(r, key) for r in records]) for key in "uy")
        np.testing.assert_allclose(X.iloc[:, 2], gain(name) * u)
        np.testing.assert_array_equal(y.iloc[:, 0], z)
        assert X["t"].diff()[1] == pytest.approx(records[0].sampling_time)
    assert {r.state_initialization_window_length for r in theirs[1]} == {ours.initial_window}


def test_files_may_lie_in_the_folder_itself(home):
    assert len(load_emps(data_home=home / "EMPS").X_test) == 50


@pytest.mark.parametrize("load", LOADERS)
def test_a_missing_file_is_named_with_its_folder(load, tmp_path):
    with pytest.raises(
        FileNotFoundError, match=rf"expected \w+\.(mat|MAT) in {re.escape(str(tmp_path))}.*Remedy"
    ):
        load(data_home=tmp_path)


def test_a_strange_file_is_refused(tmp_path):
    savemat(tmp_path / "dataBenchmark.mat", {"Ts": 4.0, "uEst": np.ones((5, 1))})
    with pytest.raises(ValueError, match=r"'yEst' is missing.*Remedy"):
        load_cascaded_tanks(data_home=tmp_path)


def test_without_folder_and_package_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", None)
    with pytest.raises(ImportError, match=r"sklearn-pgnn\[benchmarks\]"):
        load_emps()


@pytest.mark.slow
def test_the_snippet_of_the_documentation_runs(home, tmp_path):
    (snippet,) = read_page(ROOT / "docs" / "public_benchmarks.rst")
    assert snippet.needs == {"benchmarks"}
    assert "load_emps()" in snippet.code
    program = snippet.code.replace("load_emps()", f"load_emps(data_home={str(home)!r})")
    result = run_without(blocked(snippet.needs), program, tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("load", LOADERS)
def test_the_prior_reads_the_tables(load, home):
    data = load(data_home=home)
    regressor = PhysicsModelRegressor(data.prior, free=(), search="local")
    assert regressor.fit(data.X_train, data.y_train).predict(data.X_test).shape == data.y_test.shape
