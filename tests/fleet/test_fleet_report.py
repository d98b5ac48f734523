"""The fleet's page: nothing is loaded, names are text, and what was found stands in it."""

import re
from types import SimpleNamespace

import pytest

from sklearn_pgnn.fleet.machine import Machine
from sklearn_pgnn.fleet.report import render_fleet
from sklearn_pgnn.fleet.spread import spread_of
from sklearn_pgnn.inspection.report.page import digest

pytestmark = pytest.mark.core

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
