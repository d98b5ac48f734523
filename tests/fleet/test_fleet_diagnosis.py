"""A fleet is its machines, whatever happens on the way."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sledge import SLEDGE, drive

import sklearn_pgnn
from sklearn_pgnn import FleetDiagnosis, ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.estimation.plain_data import finite
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.fleet.fleet_diagnosis import REPORT, SUMMARY
from sklearn_pgnn.fleet.machine import Machine
from sklearn_pgnn.fleet.one_machine import Store
from sklearn_pgnn.fleet.report import render_fleet
from sklearn_pgnn.fleet.spread import spread_of
from sklearn_pgnn.inspection.report.page import digest

pytestmark = pytest.mark.core

OPTIONS = {"catalogue": ("coulomb_friction", "quadratic_drag"), "window_length": 1.0}
RUBBING = SLEDGE + effects.CoulombFriction("v", level=0.4)


def sledge(seed, rig=SLEDGE):
    return drive(rig, n_records=2, samples=300, seed=seed)


@pytest.fixture(scope="module")
def records():
    return {
        "a": sledge(0),
        "b": sledge(1, RUBBING),
        "c/1": sledge(2),
        "none": (pd.DataFrame({"t": [0.0], "F": [1.0]}), [1.0]),
    }


@pytest.fixture(scope="module")
def whole(records, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    return FleetDiagnosis(SLEDGE, options=OPTIONS, folder=folder).fit(records)


@pytest.mark.slow
def test_a_fleet_survives_joblib(whole, tmp_path):
    joblib.dump(whole, tmp_path / "fleet.joblib")
    assert joblib.load(tmp_path / "fleet.joblib").to_dict() == whole.to_dict()


def without_seconds(fleet):
    said = fleet.to_dict()
    for machine in said["machines"]:
        del machine["seconds"]
    return said


@pytest.mark.slow
def test_every_machine_is_diagnosed_as_it_would_be_alone(records, whole):
    for name in ("a", "b"):
        alone = ModelDiagnosis(SLEDGE, **OPTIONS).fit(*records[name])
        found = dict(whole.machines_[name].found)
        del found["version"]
        assert found == finite(alone.to_dict())


@pytest.mark.slow
def test_the_surest_come_first_and_the_unusable_last(whole):
    first, *_, last = whole.machines_
    assert (first, last) == ("b", "none")
    assert whole.machines_["b"].verdict == "cause_named"
    assert whole.machines_["none"].verdict == "failed"
    assert re.search(r"expected at least 4", whole.machines_["none"].failed)
    (cause,) = whole.causes_
    assert (cause.effect, cause.machines) == ("coulomb_friction", ("b",))
    assert not cause.is_of_the_model


def test_what_is_finished_is_not_computed_again(records, whole):
    again = clone(whole).fit(records)
    assert again.computed_ == ()
    assert without_seconds(again) == without_seconds(whole)


@pytest.mark.slow
def test_a_fit_that_was_ended_goes_on(records, whole, tmp_path):
    computed = []

    def stop(stage, done, total):
        if done == 2:
            raise KeyboardInterrupt

    fleet = FleetDiagnosis(SLEDGE, options=OPTIONS, folder=tmp_path, progress=stop)
    with pytest.raises(KeyboardInterrupt):
        fleet.fit(records)
    kept = Store(tmp_path).names()
    assert len(kept) == 2
    fleet.set_params(progress=lambda stage, done, total: computed.append(done)).fit(records)
    assert set(fleet.computed_) == set(records) - set(kept)
    assert computed == [2, 3, 4]
    assert without_seconds(fleet) == without_seconds(whole)


@pytest.mark.slow
def test_another_record_or_option_is_computed_anew(records, tmp_path):
    few = {"a": records["a"], "b": records["b"]}
    fleet = FleetDiagnosis(SLEDGE, options=OPTIONS, folder=tmp_path).fit(few)
    X, y = few["a"]
    fleet.fit({**few, "a": (X, y + 1e-6)})
    assert fleet.computed_ == ("a",)
    fleet.set_params(options={**OPTIONS, "alpha": 0.02}).fit(few)
    assert fleet.computed_ == ("a", "b")
    fleet.set_params(model=SLEDGE.with_parameters(m=2.01)).fit(few)
    assert fleet.computed_ == ("a", "b")


@pytest.mark.slow
def test_a_machine_without_its_last_file_is_not_finished(records, tmp_path):
    few = {"a": records["a"]}
    fleet = FleetDiagnosis(SLEDGE, options=OPTIONS, folder=tmp_path).fit(few)
    (Store(tmp_path).place("a") / "finished.json").unlink()
    assert fleet.fit(few).computed_ == ("a",)


@pytest.mark.slow
def test_a_bug_ends_its_machine_only_and_is_tried_again(records, tmp_path, monkeypatch):
    def fit(self, X, y):
        raise ZeroDivisionError("by nothing")

    few = {"a": records["a"]}
    fleet = FleetDiagnosis(SLEDGE, options=OPTIONS, folder=tmp_path)
    with monkeypatch.context() as broken:
        broken.setattr(ModelDiagnosis, "fit", fit)
        fleet.fit(few)
    assert "ZeroDivisionError: by nothing" in fleet.machines_["a"].failed
    assert fleet.fit(few).computed_ == ("a",)
    assert fleet.machines_["a"].verdict == "model_adequate"


@pytest.mark.slow
def test_files_are_read_where_they_are_needed(tmp_path):
    X, y = sledge(0)
    X.join(y).to_csv(tmp_path / "run.csv", index=False)
    fleet = FleetDiagnosis(SLEDGE, options=OPTIONS)
    by_file = fleet.fit({"a": tmp_path / "run.csv"}).machines_["a"]
    by_files = fleet.fit({"a": [str(tmp_path / "run.csv")]}).machines_["a"]
    assert by_file.verdict == by_files.verdict == "model_adequate"


@pytest.mark.parametrize(
    ("records", "why"),
    [
        ({}, "expected a mapping"),
        ([1, 2], "expected a mapping"),
        ({"a": 3}, r"machine 'a': expected a pair"),
        ({"a": "no_such_file.csv"}, r"machine 'a': no_such_file.csv: No such file"),
    ],
)
def test_what_are_no_records_of_machines_is_refused(records, why):
    with pytest.raises(RecordError, match=why):
        FleetDiagnosis(SLEDGE).fit(records)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"options": {"alfa": 1}}, "alfa"),
        ({"options": {"progress": print}}, "progress of FleetDiagnosis"),
        ({"rate": 2.0}, "rate: expected a number between 0 and 1"),
    ],
)
def test_what_is_no_option_is_refused(options, why, records):
    with pytest.raises(OptionError, match=why):
        FleetDiagnosis(SLEDGE, **options).fit(records)


def test_the_report_leads_to_the_page_of_every_machine(whole):
    folder = Path(whole.folder)
    page = (folder / REPORT).read_text(encoding="utf-8")
    links = re.findall(r'href="(machines/[^"]*)"', page)
    assert len(links) == 3
    for link in links:
        assert (folder / unquote(link)).exists()
    assert "<script" not in page
    assert json.loads((folder / SUMMARY).read_text())["machines"][0]["machine"] == "b"


@pytest.mark.slow
def test_what_changed_since_an_earlier_time_is_told(records, whole, tmp_path):
    now = {"a": sledge(5, RUBBING), "b": records["b"], "new": records["a"]}
    fleet = FleetDiagnosis(SLEDGE, options=OPTIONS, earlier=whole.folder, folder=tmp_path).fit(now)
    assert ("a", "cause") in [(change.machine, change.kind) for change in fleet.changes_]
    assert not any(change.machine == "b" for change in fleet.changes_)
    assert fleet.new_ == ("new",)
    assert set(fleet.missing_) == {"c/1", "none"}
    by_object = clone(fleet).set_params(earlier=whole, folder=None).fit(now)
    assert by_object.changes_ == fleet.changes_
    assert list(fleet.changes_frame()["machine"]) == [c.machine for c in fleet.changes_]


def test_the_earlier_time_is_another_folder(records, whole, tmp_path):
    with pytest.raises(OptionError, match="expected another folder"):
        FleetDiagnosis(SLEDGE, folder=whole.folder, earlier=whole.folder).fit(records)
    with pytest.raises(OptionError, match="without a finished machine"):
        FleetDiagnosis(SLEDGE, earlier=tmp_path).fit(records)


def test_the_usual_parameters_are_a_model_for_one_more_machine(whole):
    m = whole.parameters_["m"]
    assert whole.typical_model_.parameters["m"].value == m.usual
    frame = whole.parameters_frame()
    assert m.usual == np.median(frame[frame["parameter"] == "m"]["value"])


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["threading", "multiprocessing"])
def test_any_backend_of_joblib_gives_the_same(backend, records, whole):
    with joblib.parallel_config(backend, n_jobs=2):
        spread = FleetDiagnosis(SLEDGE, options=OPTIONS).fit(records)
    assert without_seconds(spread) == without_seconds(whole)


KILLED = """
import sys
sys.path[:0] = sys.argv[2:]
from test_fleet_diagnosis import OPTIONS, SLEDGE, sledge
from sklearn_pgnn import FleetDiagnosis
many = {str(k): sledge(k) for k in range(6)}
FleetDiagnosis(SLEDGE, options=OPTIONS, folder=sys.argv[1]).fit(many)
"""


@pytest.mark.slow
def test_a_fit_that_was_killed_goes_on(tmp_path):
    here = Path(__file__).resolve().parent
    package = Path(sklearn_pgnn.__file__).parents[1]
    folders = [str(tmp_path), str(here), str(here.parent), str(package)]
    child = subprocess.Popen([sys.executable, "-c", KILLED, *folders], start_new_session=True)
    store, end = Store(tmp_path), time.monotonic() + 120
    while len(store.names()) < 2 and time.monotonic() < end:
        time.sleep(0.02)
    os.killpg(child.pid, signal.SIGKILL)
    child.wait()
    kept = store.names()
    fleet = FleetDiagnosis(SLEDGE, options=OPTIONS, folder=tmp_path)
    fleet.fit({str(k): sledge(k) for k in range(6)})
    assert len(kept) >= 2
    assert set(fleet.computed_) == {str(k) for k in range(6)} - set(kept)
    assert [*map(str, range(6))] == sorted(fleet.machines_)


@pytest.mark.slow
def test_a_machine_with_a_cause_is_told_when_its_parameter_is_unlike_the_others(tmp_path):
    rng = np.random.default_rng(3)
    fan = PhysicsModel(
        {"v": "m/s"},
        {"v": "(K*u - d*v)/m"},
        {
            "m": {"value": 2.0, "unit": "kg", "fixed": True},
            "d": {"value": 0.5, "unit": "N s/m"},
            "K": {"value": 1.0, "unit": "N/V"},
        },
        {"u": "V"},
        inertia={"v": "m"},
    )
    t = np.arange(0, 30, 0.02)
    u = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    rigs = dict.fromkeys("abd", fan)
    rigs["c"] = fan.with_parameters(K=1.54) + effects.CoulombFriction("v", level=0.3)

    def records(rig):
        v = rig.simulate(t, u, substeps=5).y
        return np.column_stack([t, u]), v + 1e-3 * rng.normal(size=v.shape)

    options = {"catalogue": ["coulomb_friction", "wrong_parameter"], "window_length": 1.0}
    fleet = FleetDiagnosis(fan, options=options).fit({n: records(r) for n, r in rigs.items()})
    assert "Coulomb friction on v" in fleet.to_frame().set_index("machine").loc["c", "causes"]
    assert list(fleet.parameters_["K"].odd) == ["c"]
    assert fleet.parameters_["d"].odd == {}
    fleet.to_html(tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert "usually 1" in page
    assert "the same on all but c" in page


EVIL = "<script>pump</script> -1"


def machine(name, value, verdict="model_adequate"):
    mass = {"value": value, "low": value - 0.1, "high": value + 0.1, "prior": 2.0, "unit": "kg"}
    found = {"verdict": verdict, "causes": [], "gain": {}, "stopped": None}
    found["remaining"] = {"kind": "noise", "times_noise": {"v": 1.0}}
    return Machine(name, found | {"parameters": {"m": mass}, "data_quality": []})


def page(tmp_path, **more):
    told = [machine(f"pump {k}", 2.0 + 0.001 * k) for k in range(8)]
    machines = [*told, machine("heavy", 3.0), Machine(EVIL, None, "no time in the file")]
    found = {m.name: m.found["parameters"]["m"] for m in machines if m.found}
    fleet = SimpleNamespace(
        model=SimpleNamespace(name="pumps"), machines_={m.name: m for m in machines}, causes_=(),
        parameters_={"m": spread_of("m", found, 0.01)}, earlier=None, changes_=(), new_=(),
        missing_=(), rate=0.01,
    )  # fmt: skip
    vars(fleet).update(more)
    return render_fleet(fleet, tmp_path)


def test_its_policy_allows_its_own_style_and_nothing_else(tmp_path):
    text = page(tmp_path)
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)[1]
    assert f"default-src 'none'; style-src 'sha256-{digest(style)}'" in text
    assert " style=" not in text
    assert "<script" not in text


def test_names_are_text_and_machines_without_a_page_are_told(tmp_path):
    text = page(tmp_path)
    assert "&lt;script&gt;pump&lt;/script&gt;" in text
    assert "no time in the file" in text
    assert "<a " not in text  # no machine has a page here


def test_who_is_unlike_the_others_is_said_in_its_row_and_marked_in_the_strip(tmp_path):
    text = page(tmp_path)
    assert re.search(r'data-of="Unlike the others">m 3.*usually 2', text)
    assert text.count('class="odd"') == 1


def test_what_changed_is_told_only_beside_an_earlier_time(tmp_path):
    assert "What changed" not in page(tmp_path)
    assert "No significant change" in page(tmp_path, earlier="march")
    assert "is no longer among the records" in page(tmp_path, earlier="march", missing_=("gone",))


def test_a_machine_that_leaves_much_is_not_shown_as_adequate(tmp_path):
    left = machine("window open", 2.0, "nothing_found")
    assert left.said == "No cause found"
    assert machine("pump", 2.0).said == "Model adequate"
    text = page(tmp_path, machines_={m.name: m for m in (left, machine("pump", 2.0))})
    assert "No cause found" in text
