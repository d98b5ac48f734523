"""The page by plain HTTP: who may ask, what is taken, and the way from files to a report."""

import os
import stat
import tempfile
import time
from io import BytesIO
from pathlib import Path
from urllib.parse import quote
from zipfile import ZipFile

import numpy as np
import pytest

pytest.importorskip("uvicorn")
pytest.importorskip("starlette")

from click.testing import CliRunner
from served import Client, served
from sledge import SLEDGE

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.app import serve, server

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


@pytest.fixture
def port():
    with served() as address:
        yield address


@pytest.fixture
def client(port):
    """A session with a model."""
    client = Client(port)
    client.bring("model", "sledge.yaml", MODEL)
    return client


def looked(client, mapping):
    """Return the state after a look at the records."""
    client.ask("/look", mapping=mapping)
    return client.wait()


def by_column(*columns):
    """Return a mapping of time, force and speed to columns and units."""
    told = zip(("t", "F", "speed"), columns, strict=True)
    return {name: {"column": column, "unit": unit} for name, (column, unit) in told}


@pytest.fixture(scope="module")
def done():
    """A session in which the example was diagnosed."""
    with served() as address:
        client = Client(address)
        assert client.post("/example").status == 200
        assert looked(client, EXAMPLE)["message"] == ""
        assert client.ask("/diagnosis", mapping=EXAMPLE, options={}).status == 200
        client.wait()
        yield client


EXAMPLE = {
    "t": {"column": "t [s]", "unit": "s"},
    "force": {"column": "force [N]", "unit": "N"},
    "position": {"column": "position [m]", "unit": "m", "kind": "distance_sensor"},
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
    assert Client(port).get("/", Host=f"localhost:{port.port}").status == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": None},
        {"Origin": "null"},
        {"Origin": "http://example.org"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
def test_a_change_that_another_page_asks_for_is_refused(port, headers):
    client = Client(port)
    assert client.post("/example", **headers).status == 403
    assert "Drop a model file" in client.get("/sections").sections["model"]


ROUTES = [
    *(("GET", path) for path in ("/", "/style.css", "/app.js", "/zoom.js", "/favicon.ico")),
    *(("GET", path) for path in ("/sections", "/model.yaml", "/result/report.html", "/none")),
    *(("POST", path) for path in ("/start", "/model", "/system", "/example", "/records", "/look")),
    *(("POST", "/diagnosis"), ("DELETE", "/work"), ("DELETE", "/records/1")),
]


@pytest.mark.slow
@pytest.mark.parametrize("secret", ["", "/guessed", "//", "/./"])
def test_without_the_secret_every_route_says_where_the_address_is(done, secret):
    told = [done.send_to(method, secret + path) for method, path in ROUTES]
    assert {answer.status for answer in told} == {403}
    assert all("printed in the terminal" in answer.text for answer in told)
    assert not any(done.secret in answer.text + str(answer.headers) for answer in told)
    assert done.get("/result/report.html").status == 200


def test_the_secret_is_whole_and_as_it_was_written(port):
    client = Client(port)
    changed = [client.secret[:-1], client.secret + "A", client.secret.swapcase(), "é", "%00"]
    assert {client.send_to("GET", f"/{quote(each)}/").status for each in changed} == {403}
    assert client.send_to("GET", f"/{client.secret}").status == 403  # not the page's address
    assert client.get("/").status == 200


def test_two_starts_have_different_secrets():
    secrets = {server.new_secret() for _ in range(100)}
    assert len(secrets) == 100
    assert min(map(len, secrets)) >= 32


@pytest.mark.slow
def test_nothing_of_the_page_tells_its_address_to_others(done):
    for path in ("/", "/result/report.html", "/style.css", "/sections"):
        answer = done.get(path)
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert "set-cookie" not in answer.headers
        assert done.secret not in answer.text


def test_the_page_may_load_nothing_from_elsewhere_and_no_inline_script(port):
    page = Client(port).get("/")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert page.headers["x-content-type-options"] == "nosniff"
    assert "http://" not in page.text.replace("http://www.w3.org", "")
    assert "https://" not in page.text


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
def test_a_model_file_that_is_none_says_where_and_leaves_the_old_one(client):
    broken = MODEL.replace("F - d*v", "F - q*v")
    answer = client.bring("model", "broken.yaml", broken)
    assert answer.status == 400
    assert answer.message.startswith("broken.yaml:8:")
    assert "'q'" in answer.message
    assert "sledge.yaml" in answer.sections["model"]
    tagged = client.bring("model", "tag.yaml", "name: !!python/object/apply:os.getcwd []")
    assert tagged.status == 400


@pytest.mark.slow
def test_a_file_that_is_no_record_says_so_under_its_own_name(client):
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
        ({"mapping": {"position": {"kind": "measured"}}}, "Expected a kind of channel"),
        ({"mapping": {}, "options": {"hold": "tight"}}, "Expected inputs that are held"),
        ({"mapping": {}, "options": {"minutes": "-1"}}, "Expected a time limit"),
    ],
)
def test_a_form_that_is_filled_in_otherwise_is_refused(done, form, said):
    answer = done.ask("/diagnosis", **form)
    assert answer.status == 400
    assert answer.message.startswith(said)


def test_a_port_that_is_taken_is_refused(port):
    result = CliRunner().invoke(main, ["app", "--port", str(port.port)])
    assert result.exit_code == 2
    assert "Remedy: --port 0 selects a free one" in result.output


def test_what_is_known_of_a_channel_is_asked_with_what_is_usual(port):
    client = Client(port)
    client.bring("model", "motor.yaml", MODEL.replace("m/s", "rpm") + "channels: {F: measured}\n")
    asked = client.bring("records", "run.csv", run()).sections["columns"]
    assert '<option value="measured" selected>measured</option>' in asked
    assert '<option value="tachometer" selected>tachometer</option>' in asked
    assert asked.count('<option value="commanded">') == 1  # no output is


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
    extended = PhysicsModel.from_yaml(tmp_path / "model.yaml")
    assert "v" in extended.states
    assert dict(extended.channels) == {"position": "distance_sensor"}
    assert "attachment" in done.get("/result/diagnosis.json").headers["content-disposition"]


@pytest.mark.slow
def test_model_records_and_results_come_in_one_archive(done):
    with ZipFile(BytesIO(done.get("/diagnosis.zip").content)) as archive:
        assert archive.testzip() is None
        assert archive.read("result/report.html") == done.get("/result/report.html").content
        expected = {"model.yaml", "records/cart_4.csv", "result/extended_model.yaml"}
        assert expected < set(archive.namelist())


def test_without_an_extended_model_nothing_goes_on_from_it(client):
    refused = client.post("/go_on")
    assert refused.status == 400
    assert refused.message == "Expected a diagnosis with an extended model first."


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"exclude": "leak, nothing"}, "expected the id of an effect, got 'nothing'"),
        ({"targets": "speed, w"}, "got 'w'; one of v, F"),
    ],
)
def test_effects_and_places_that_are_not_there_are_told(client, options, said):
    client.bring("records", "run.csv", run())
    mapping = by_column(("t", "s"), ("F", "N"), ("speed", "m/s"))
    looked(client, mapping)
    client.ask("/diagnosis", mapping=mapping, options=options)
    assert said in client.wait()["message"]


@pytest.mark.slow
def test_columns_of_other_names_and_units_are_mapped(client):
    text = run(header="Zeit,Kraft,Tempo (km/h)", scales=(1e3, 1e-3, 3.6))
    assert "Kraft" in client.bring("records", "fahrt.csv", text).sections["columns"]
    mapping = by_column(("Zeit", "ms"), ("Kraft", "kN"), ("Tempo (km/h)", "km/h"))
    state = looked(client, mapping)
    assert state["message"] == ""
    assert "15 s" in state["sections"]["seen"].replace("14.9 s", "15 s")
    assert "fahrt" in state["sections"]["seen"]
    mapping["F"]["unit"] = "V"
    assert "expected the unit 'N'" in looked(client, mapping)["message"]
    mapping["F"]["column"] = "Zeit"
    assert "'Zeit', which is already used for 't'" in looked(client, mapping)["message"]


@pytest.mark.slow
def test_what_was_chosen_outlives_a_file_that_cannot_be_used(client):
    client.bring("records", "fahrt.csv", run(header="Zeit,Kraft,Tempo", scales=(1, 1, 3.6)))
    looked(client, by_column(("Zeit", "s"), ("Kraft", "N"), ("Tempo", "km/h")))
    assert "noise.csv:1:" in client.bring("records", "noise.csv", "\x00\x01").message
    other = client.bring("records", "other.csv", run(header="a,b,c"))
    assert other.message.startswith("other.csv: expected columns as in fahrt.csv, Zeit, Kraft")
    columns = other.sections["columns"]
    assert 'value="km/h"' in columns
    for title in ("Zeit", "Kraft", "Tempo"):
        assert f"<option selected>{title}</option>" in columns


@pytest.mark.slow
def test_files_without_a_time_have_a_sample_time(client):
    client.bring("records", "run.csv", run(header="n,F,speed"))
    mapping = by_column(("", "s"), ("F", "N"), ("speed", "m/s"))
    assert "or state the sample time" in looked(client, mapping)["message"]
    state = looked(client, {**mapping, "sample_time": "0.05"})
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
    assert looked(client, EXAMPLE)["message"] == ""


@pytest.mark.slow
def test_records_that_come_first_are_kept_until_a_model_comes(port):
    client = Client(port)
    assert "run.csv" in client.bring("records", "run.csv", run()).sections["records"]
    answer = client.bring("model", "sledge.yaml", MODEL)
    assert "run.csv" in answer.sections["records"]
    assert "<option selected>speed</option>" in answer.sections["columns"]


@pytest.mark.slow
def test_a_header_with_and_one_without_its_unit_are_one_column(client):
    client.bring("records", "a.csv", run(0, "t [s],F [N],speed [m/s]"))
    client.bring("records", "b.csv", run(1))
    answer = client.bring("records", "c.csv", run(2, "t [ms],F [kN],speed", (1e3, 1e-3, 1)))
    assert answer.status == 200
    state = looked(client, by_column(("t [s]", "s"), ("F [N]", "N"), ("speed [m/s]", "m/s")))
    assert state["message"] == ""
    seen = state["sections"]["seen"].replace("14.9 s", "15 s")
    assert seen.count("300 samples, 15 s") == 3


@pytest.mark.slow
def test_the_process_ends_with_the_server():
    before = {*children()}
    with served() as address:
        client = Client(address)
        client.ask("/system", system="two-tanks")
        assert (address.folder / "model.yaml").exists()
        new = {pid: Path(f"/proc/{pid}/cmdline").read_bytes() for pid in {*children()} - before}
        workers = [pid for pid, command in new.items() if b"app.worker" in command]
        assert workers
    assert not {*workers} & {*children()}


def children():
    told = (f"/proc/self/task/{task}/children" for task in os.listdir("/proc/self/task"))
    return [pid for path in told for pid in Path(path).read_text().split()]


# -- where it is -----------------------------------------------------------------------------------


class Server:
    def run(self, sockets):
        for each in sockets:
            each.close()


def test_the_address_is_printed_and_opened_without_telling_it_to_others(
    tmp_path, monkeypatch, capsys
):
    opened = []

    def launch(path):
        opened.append((path, Path(path).read_text(), Path(path).parent.stat().st_mode))

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(serve.click, "launch", launch)
    monkeypatch.setattr(serve, "make_server", lambda *_: Server())
    serve.serve(0, opens=True, quiet=True)
    url = capsys.readouterr().out.strip()
    assert url.startswith("http://127.0.0.1:")
    secret = url.split("/")[3]
    assert len(secret) >= 32
    ((path, page, mode),) = opened
    assert secret not in path
    assert f"url={url}" in page
    assert os.name == "nt" or not mode & (stat.S_IRWXG | stat.S_IRWXO)
    assert list(tmp_path.iterdir()) == []


def test_who_it_is_for_is_said(monkeypatch, capsys):
    monkeypatch.setattr(serve, "make_server", lambda *_: Server())
    serve.serve(0, opens=False, quiet=False)
    assert "whoever has this address has the session" in capsys.readouterr().out
