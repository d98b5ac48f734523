"""``sklearn-pgnn fleet`` from the files of many machines to the report."""

import json
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
from click.testing import CliRunner
from schemas import faults
from sledge import SLEDGE, drive

from sklearn_pgnn import FleetDiagnosis, effects
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.fleet_job import machine_files, on_cluster
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.fleet.content_key import files_key

RIGS = {"a": SLEDGE, "b": SLEDGE + effects.CoulombFriction("v", level=0.4)}
QUICK = ("--catalogue", "coulomb_friction", "--window", "1", "--jobs", "1")


def write(folder, seed=0):
    """Write two files of each machine, and the model."""
    folder.mkdir()
    SLEDGE.to_yaml(folder.parent / "sledge.yaml")
    for name, rig in RIGS.items():
        for run in range(2):
            X, y = drive(rig, n_records=1, samples=300, seed=seed + run)
            X.drop(columns="trajectory").join(y).to_csv(folder / f"{name}_{run}.csv", index=False)


def call(*args):
    return CliRunner().invoke(main, ["fleet", *map(str, args)])


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigs")
    write(folder / "march")
    named = ("--model", folder / "sledge.yaml", "--pattern", "{machine}_*.csv")
    return folder, call(folder / "march", *named, "--output", folder / "result", *QUICK)


@pytest.mark.slow
@pytest.mark.core
def test_the_results_are_written_and_told(done):
    folder, result = done
    assert result.exit_code == 0, result.output
    assert "2 machines: cause named 1, model adequate 1." in result.output
    assert "Coulomb friction on v" in result.output
    assert "machines: 2 of 2" in result.output or "machines: 0 of 2" in result.output
    written = {path.name for path in (folder / "result" / "machines" / "b").iterdir()}
    assert {"diagnosis.json", "extended_model.yaml", "report.html"} < written
    assert (folder / "result" / "index.html").exists()
    data = json.loads((folder / "result" / "fleet.json").read_text())
    assert faults("fleet", data) == []


@pytest.mark.slow
@pytest.mark.core
def test_a_second_call_takes_over_what_is_finished(done):
    folder, _ = done
    named = ("--model", folder / "sledge.yaml", "--pattern", "{machine}_*.csv", "--json")
    result = call(folder / "march", *named, "--output", folder / "result", *QUICK)
    assert result.exit_code == 0, result.output
    assert "machines: 0 of 2" not in result.stderr
    assert [m["machine"] for m in json.loads(result.stdout)["machines"]] == ["b", "a"]


@pytest.mark.slow
@pytest.mark.core
def test_what_changed_is_told(done):
    folder, _ = done
    RIGS["a"], before = RIGS["b"], RIGS["a"]
    try:
        write(folder / "april", seed=5)
    finally:
        RIGS["a"] = before
    named = ("--model", folder / "sledge.yaml", "--pattern", "{machine}_*.csv")
    then = ("--output", folder / "april_result", "--earlier", folder / "result")
    result = call(folder / "april", *named, *then, *QUICK)
    assert result.exit_code == 0, result.output
    assert "a: Coulomb friction on v is newly named" in result.output
    assert faults("fleet", json.loads((folder / "april_result" / "fleet.json").read_text())) == []


@pytest.mark.slow
@pytest.mark.core
def test_a_worker_that_was_ended_is_told_in_words(done, monkeypatch):
    def fit(self, records):
        raise BrokenProcessPool

    folder, _ = done
    monkeypatch.setattr(FleetDiagnosis, "fit", fit)
    named = ("--model", folder / "sledge.yaml", "--output", folder / "other")
    result = call(folder / "march", *named)
    assert result.exit_code == 1
    assert "Finished machines are kept in" in result.output


@pytest.mark.core
@pytest.mark.parametrize(
    ("files", "pattern", "found"),
    [
        (["a/x.csv", "a/y.csv", "b.csv"], None, {"a": ["a/x.csv", "a/y.csv"], "b": ["b.csv"]}),
        (["a_1.csv", "a_2.csv", "b_1.mat", "note.md"], "{machine}_*.csv", {"a": 2}),
        (["x/pump 1/r.csv", "y/pump 1/r.csv"], "*/{machine}/*.csv", {"pump 1": 2}),
        (["a.csv", ".hidden.csv", ".git/b.csv"], None, {"a": 1}),
        (["a+b.csv", "aab.csv"], "{machine}+b.csv", {"a": ["a+b.csv"]}),
    ],
)
def test_the_files_of_the_machines_are_found(tmp_path, files, pattern, found):
    for name in files:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    machines = machine_files(tmp_path, pattern)
    assert set(machines) == set(found)
    for name, wanted in found.items():
        places = [Path(file).relative_to(tmp_path).as_posix() for file in machines[name]]
        assert wanted in (places, len(places))


@pytest.mark.core
def test_a_folder_without_records_is_refused(tmp_path):
    with pytest.raises(RecordError, match="expected a folder"):
        machine_files(tmp_path / "none")
    with pytest.raises(RecordError, match="got none"):
        machine_files(tmp_path)
    with pytest.raises(OptionError, match=r"expected \{machine\} once"):
        machine_files(tmp_path, "*.csv")


@pytest.mark.slow
def test_a_cluster_of_dask_does_the_work():
    from distributed import LocalCluster

    records = {name: drive(rig, n_records=2, samples=300) for name, rig in RIGS.items()}
    fleet = FleetDiagnosis(SLEDGE, options={"catalogue": ["coulomb_friction"]})
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
        ) as cluster,
        on_cluster(cluster.scheduler_address),
    ):
        fleet.fit(records)
    assert [machine.verdict for machine in fleet.machines_.values()] == [
        *("cause_named", "model_adequate")
    ]


def test_the_folder_of_a_bag_is_one_record(tmp_path):
    for place in ("a/run_1", "a/run_2", "b"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "metadata.yaml").write_text("")
        (tmp_path / place / "data.mcap").write_text(place)
    found = machine_files(tmp_path)
    assert found == {
        "a": [str(tmp_path / "a" / "run_1"), str(tmp_path / "a" / "run_2")],
        "b": [str(tmp_path / "b")],
    }
    before = files_key(found["b"], None)
    (tmp_path / "b" / "data.mcap").write_text("another")
    assert files_key(found["b"], None) != before
