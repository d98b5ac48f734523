"""The page by plain HTTP: who may ask, what is taken, and the way from files to a report."""

import os
import time

import numpy as np
import pytest

pytest.importorskip("uvicorn")
pytest.importorskip("starlette")

from click.testing import CliRunner
from served import Client, served

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.app import server, visitors

MODEL = """\
name: sledge
states: {v: m/s}
inputs: {F: N}
outputs: {speed: v}
parameters:
  m: {value: 2.0, unit: kg}
  d: {value: 0.5, unit: N s/m}
equations: {v: "(F - d*v)/m"}
inertia: {v: m}
"""
SLEDGE = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}, inertia={"v": "m"}
)


@pytest.fixture(scope="module")
def port():
    with served() as port:
        yield port


@pytest.fixture(scope="module")
def done(port):
    """A visitor who had the example diagnosed."""
    client = Client(port)
    assert client.post("/example").status == 200
    assert client.ask("/look", mapping=EXAMPLE).status == 200
    assert client.wait()["message"] == ""
    assert client.ask("/diagnosis", mapping=EXAMPLE, options={}).status == 200
    client.wait()
    return client


EXAMPLE = {
    "t": {"column": "t [s]", "unit": "s"},
    "force": {"column": "force [N]", "unit": "N"},
    "position": {"column": "position [m]", "unit": "m"},
}


def run(seed=0, header="t,F,speed", scales=(1, 1, 1)):
    """Return a CSV file of a sledge that rubs."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 15, 0.05)
    force = 2 * np.sin((0.7 + 0.2 * seed) * t) + np.sin(1.9 * t)
    rig = SLEDGE + effects.CoulombFriction("v", level=0.4)
    v = rig.simulate(t, force, substeps=5).y[:, 0] + 1e-3 * rng.standard_normal(t.size)
    rows = np.column_stack([t, force, v]) * scales
    return header + "\n" + "\n".join(",".join(f"{x:.6g}" for x in row) for row in rows)


# -- who may ask -----------------------------------------------------------------------------------


@pytest.mark.parametrize("host", ["example.org", "127.0.0.1", "127.0.0.1:1", "", "localhost.evil"])
def test_another_host_is_refused(port, host):
    assert Client(port).get("/", Host=host).status in (400, 421)


def test_localhost_is_the_same_host(port):
    assert Client(port).get("/", Host=f"localhost:{port}").status == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": None},
        {"Origin": "null"},
        {"Origin": "http://example.org"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
        {"X_Token": None},
        {"X_Token": "guessed"},
    ],
)
def test_a_change_that_another_page_asks_for_is_refused(port, headers):
    client = Client(port)
    assert client.post("/example", **headers).status == 403
    assert "Drop a model file" in client.get("/sections").sections["model"]


@pytest.mark.slow
def test_who_has_no_cookie_is_nobody(port, done):
    for path in ("/sections", "/model.yaml", "/result/report.html"):
        assert done.get(path).status == 200
        assert done.get(path, Cookie=None).status == 404
    assert done.post("/example", Cookie=None).status == 404


def test_the_page_may_load_nothing_from_elsewhere_and_no_inline_script(port):
    page = Client(port).get("/")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert page.headers["x-content-type-options"] == "nosniff"
    assert "http://" not in page.text.replace("http://www.w3.org", "")
    assert "https://" not in page.text
    cookie = page.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie


@pytest.mark.slow
def test_two_visitors_do_not_see_each_other(port, done):
    other = Client(port)
    assert other.cookie != done.cookie
    assert other.get("/result/report.html").status == 404
    assert "cart" not in other.get("/sections").sections["records"]
    assert other.post("/example", Cookie=done.cookie).status == 403


@pytest.mark.slow
def test_there_are_only_so_many_visitors(monkeypatch):
    monkeypatch.setattr(visitors, "VISITORS", 1)
    with served() as port:
        first = Client(port)
        Client(port)  # takes the place of the first, who brought nothing
        assert first.get("/sections").status == 404
        second = Client(port)
        second.ask("/system", system="two-tanks")
        assert second.get("/", Cookie=None).status == 503
        assert second.get("/sections").status == 200


# -- what is taken ---------------------------------------------------------------------------------


def test_what_is_too_large_is_refused_before_it_is_read(port, monkeypatch):
    monkeypatch.setattr(server, "RECORD_BYTES", 1000)
    monkeypatch.setattr(server, "MODEL_BYTES", 1000)
    client = Client(port)
    for path in ("/model?name=a.yaml", "/records?name=a.csv"):
        assert client.post(path, b"x" * 1001).status == 413
        pieces = iter([b"x" * 600, b"x" * 600])  # of a length that is not told
        assert client.post(path, pieces).status == 413


def test_there_are_only_so_many_files(port, monkeypatch):
    monkeypatch.setattr("sklearn_pgnn.cli.app.visitor.RECORDS", 1)
    client = Client(port)
    assert client.bring("records", "a.csv", run(0)).status == 200
    answer = client.bring("records", "b.csv", run(1))
    assert answer.status == 400
    assert answer.message == "Expected at most 1 files of records."


@pytest.mark.slow
def test_a_name_is_shown_and_never_a_path(port, done):
    client = Client(port)
    client.bring("model", "../../<b>m.yaml", MODEL)
    answer = client.bring("records", "..\\..\\<i>run.csv", run())
    assert "&lt;i&gt;run.csv" in answer.sections["records"]
    assert "<i>" not in answer.sections["records"]
    assert "&lt;b&gt;m.yaml" in answer.sections["model"]
    for name in ("..%2Fmodel.yaml", "../model.yaml", "..", "model.yaml", "%2Fetc%2Fpasswd"):
        assert done.get(f"/result/{name}").status == 404


@pytest.mark.slow
def test_a_model_file_that_is_none_says_where_and_leaves_the_old_one(port):
    client = Client(port)
    client.bring("model", "sledge.yaml", MODEL)
    broken = MODEL.replace("F - d*v", "F - q*v")
    answer = client.bring("model", "broken.yaml", broken)
    assert answer.status == 400
    assert answer.message.startswith("broken.yaml:8:")
    assert "'q'" in answer.message
    assert "sledge.yaml" in answer.sections["model"]
    tagged = client.bring("model", "tag.yaml", "name: !!python/object/apply:os.getcwd []")
    assert tagged.status == 400


@pytest.mark.slow
def test_a_file_that_is_no_record_says_so_under_its_own_name(port):
    client = Client(port)
    client.bring("model", "sledge.yaml", MODEL)
    answer = client.bring("records", "noise.csv", "\x00\x01")
    assert answer.status == 400
    assert answer.message.startswith("noise.csv:1: expected a CSV file")
    assert "noise.csv" not in answer.sections["records"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "said"),
    [
        (
            {"mapping": {"force": {"column": "nowhere"}}},
            "Expected a column of the files for 'force'",
        ),
        ({"mapping": {"force": {"column": 3}}}, "Expected a text"),
        ({"mapping": {}, "options": {"hold": "tight"}}, "Expected inputs that are held"),
        ({"mapping": {}, "options": {"minutes": "-1"}}, "Expected a time limit"),
    ],
)
def test_a_form_that_is_filled_in_otherwise_is_refused(done, form, said):
    answer = done.ask("/diagnosis", **form)
    assert answer.status == 400
    assert answer.message.startswith(said)


def test_a_port_that_is_taken_is_refused(port):
    result = CliRunner().invoke(main, ["app", "--port", str(port)])
    assert result.exit_code == 2
    assert "Remedy: --port 0 selects a free one" in result.output


# -- from files to a report ------------------------------------------------------------------------


@pytest.mark.slow
def test_the_example_is_diagnosed_and_its_files_are_there(done, tmp_path):
    result = done.get("/sections").sections["result"]
    assert "lacks Coulomb friction on v" in result
    report = done.get("/result/report.html")
    assert "Coulomb friction on v" in report.text
    assert "cart_1.csv" in report.text
    assert "cart-on-spring.yaml" in report.text
    assert report.headers["content-security-policy"].startswith("sandbox")
    (tmp_path / "model.yaml").write_text(done.get("/result/extended_model.yaml").text)
    assert "v" in PhysicsModel.from_yaml(tmp_path / "model.yaml").states
    assert "attachment" in done.get("/result/diagnosis.json").headers["content-disposition"]


@pytest.mark.slow
def test_columns_of_other_names_and_units_are_mapped(port):
    client = Client(port)
    client.bring("model", "sledge.yaml", MODEL)
    text = run(header="Zeit,Kraft,Tempo (km/h)", scales=(1e3, 1e-3, 3.6))
    assert "Kraft" in client.bring("records", "fahrt.csv", text).sections["columns"]
    mapping = {
        "t": {"column": "Zeit", "unit": "ms"},
        "F": {"column": "Kraft", "unit": "kN"},
        "speed": {"column": "Tempo (km/h)", "unit": "km/h"},
    }
    client.ask("/look", mapping=mapping)
    state = client.wait()
    assert state["message"] == ""
    assert "15 s" in state["sections"]["seen"].replace("14.9 s", "15 s")
    assert "fahrt" in state["sections"]["seen"]
    mapping["F"]["unit"] = "V"
    client.ask("/look", mapping=mapping)
    assert "expected the unit 'N'" in client.wait()["message"]
    mapping["F"]["column"] = "Zeit"
    client.ask("/look", mapping=mapping)
    assert "'Zeit', which is already used for 't'" in client.wait()["message"]


@pytest.mark.slow
def test_what_was_chosen_outlives_a_file_that_cannot_be_used(port):
    client = Client(port)
    client.bring("model", "sledge.yaml", MODEL)
    client.bring("records", "fahrt.csv", run(header="Zeit,Kraft,Tempo", scales=(1, 1, 3.6)))
    mapping = {
        "t": {"column": "Zeit", "unit": "s"},
        "F": {"column": "Kraft", "unit": "N"},
        "speed": {"column": "Tempo", "unit": "km/h"},
    }
    client.ask("/look", mapping=mapping)
    client.wait()
    assert "noise.csv:1:" in client.bring("records", "noise.csv", "\x00\x01").message
    other = client.bring("records", "other.csv", run(header="a,b,c"))
    assert other.message.startswith("other.csv: expected columns as in fahrt.csv, Zeit, Kraft")
    columns = other.sections["columns"]
    assert 'value="km/h"' in columns
    for title in ("Zeit", "Kraft", "Tempo"):
        assert f"<option selected>{title}</option>" in columns


@pytest.mark.slow
def test_files_without_a_time_have_a_sample_time(port):
    client = Client(port)
    client.bring("model", "sledge.yaml", MODEL)
    client.bring("records", "run.csv", run(header="n,F,speed"))
    mapping = {
        "t": {"column": "", "unit": "s"},
        "F": {"column": "F", "unit": "N"},
        "speed": {"column": "speed", "unit": "m/s"},
    }
    client.ask("/look", mapping=mapping)
    assert "or state the sample time" in client.wait()["message"]
    client.ask("/look", mapping={**mapping, "sample_time": "0.05"})
    state = client.wait()
    assert state["message"] == ""
    assert "300 samples" in state["sections"]["seen"]


@pytest.mark.slow
def test_a_diagnosis_that_is_stopped_stops_and_another_may_begin(port):
    client = Client(port)
    client.post("/example")
    client.ask("/diagnosis", mapping=EXAMPLE, options={})
    until = time.monotonic() + 60
    while "<progress max" not in client.get("/sections").sections["work"]:
        assert time.monotonic() < until
        time.sleep(0.05)
    assert "A diagnosis is running" in client.post("/example").message
    answer = client.send("DELETE", "/work")
    assert not answer.json["busy"]
    assert client.get("/sections").message == "Stopped."
    assert client.ask("/look", mapping=EXAMPLE).status == 200
    assert client.wait()["message"] == ""


@pytest.mark.slow
def test_processes_and_folders_go_with_the_server(monkeypatch):
    known = []
    welcome = visitors.Visitors.welcome

    async def noted(self):
        key, visitor = await welcome(self)
        known.append(visitor)
        return key, visitor

    monkeypatch.setattr(visitors.Visitors, "welcome", noted)
    with served() as port:
        client = Client(port)
        client.ask("/system", system="two-tanks")
        (visitor,) = known
        process = visitor.worker._process.pid
        assert (visitor.folder / "model.yaml").exists()
        os.kill(process, 0)
    assert not visitor.folder.exists()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
