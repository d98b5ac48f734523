"""Two diagnoses side by side: what differs is said, and nothing else."""

import json
import re
from copy import deepcopy

import pytest
from click.testing import CliRunner
from sledge import rough_sledge

from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.output import strict_json
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.inspection import compare
from sklearn_pgnn.inspection.diagnosis_comparison import Quantity

pytestmark = pytest.mark.core


@pytest.fixture
def before():
    return json.loads(strict_json(rough_sledge()[0]))


@pytest.fixture
def after(before):
    """The same, but for half the friction and a worn record."""
    data = deepcopy(before)
    level = data["causes"][0]["parameters"]["level"]
    level.update({key: level[key] / 2 for key in ("value", "low", "high")})
    data["data_quality"] = [{"kind": "outliers", "where": "v"}]
    return data


@pytest.mark.slow
def test_a_diagnosis_does_not_differ_from_itself(before):
    found = compare(rough_sledge()[0], before)
    assert found.differences == ()
    assert found.summary == "A and B agree within their 95 % intervals."


@pytest.mark.slow
def test_machines_that_have_nothing_in_common_are_not_compared(before):
    other = {**before, "gain": {"level": before["gain"]["v"]}, "parameters": {}}
    with pytest.raises(OptionError, match="A has the outputs v and B has the outputs level"):
        compare(before, other)


def test_a_model_file_is_no_diagnosis(before, tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("name: sledge")
    with pytest.raises(OptionError, match=r"got a model file\. Remedy: run sklearn-pgnn diagnose"):
        compare(before, path)


def test_what_differs_is_said(before, after):
    found = compare(before, after, names=("old", "new"))
    size, flaws = found.differences
    assert size.startswith("Coulomb friction on v: level: 0.30")
    assert size.endswith("in new (50 % smaller).")
    assert flaws == "Only the records of new have faults of this kind: outliers."
    assert [q.name for q in found.quantities if q.differs] == ["Coulomb friction on v: level"]
    assert "old and new differ in 2 things." in found.to_text()
    assert repr(found) == "<DiagnosisComparison: old and new differ in 2 things.>"


def test_a_comparison_is_the_other_way_round_from_the_other_side(before, after):
    one, other = compare(before, after), compare(after, before)
    assert [q.differs for q in one.quantities] == [q.differs for q in other.quantities]
    assert "50 % smaller" in one.differences[0]
    assert "100 % larger" in other.differences[0]


def test_a_cause_that_is_gone_is_named_with_what_took_its_place(before):
    gone = {**before, "causes": [], "verdict": "model_adequate"}
    assert compare(before, gone).differences == (
        "A: cause named; B: model adequate.",
        "Coulomb friction on v: named in A, not in B.",
    )
    other = deepcopy(before)
    rival = {"effect": "coulomb_friction", "target": "v", "probability": 0.4, "equivalent": False}
    other["causes"] = [{**other["causes"][0], "effect": "quadratic_drag", "confused_with": [rival]}]
    said = compare(before, other).differences[0]
    assert "not in B, but quadratic drag on v, which it may be confused with." in said


def test_intervals_without_an_end_never_differ():
    assert not Quantity("m", "kg", (1.0, 0.9, float("inf")), (9.0, 8.9, 9.1)).differs
    assert not Quantity("m", "kg", (1.0, 0.9, 1.1), None).differs


def test_the_report_loads_nothing_and_escapes_names(before, after, tmp_path):
    compare(before, after, names=("<script>", "b")).to_html(tmp_path / "c.html")
    text = (tmp_path / "c.html").read_text(encoding="utf-8")
    assert not re.search(r"<script|\b(src|href)=", text)
    assert "<svg" in text
    assert "50 % smaller" in text


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "No such file"),
        ("{", "expected the diagnosis.json of a diagnosis"),
        ("[]", "got something else"),
        ("{}", "got data without 'verdict'"),
    ],
)
def test_what_is_no_diagnosis_is_refused(before, tmp_path, content, said):
    if content is not None:
        (tmp_path / "diagnosis.json").write_text(content)
    with pytest.raises(OptionError, match=said):
        compare(before, tmp_path)


def test_folders_are_compared_on_the_command_line(before, after, tmp_path):
    for name, data in (("old", before), ("new", after)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "diagnosis.json").write_text(json.dumps(data))
    out = tmp_path / "c.html"
    args = ["compare", str(tmp_path / "old"), str(tmp_path / "new" / "diagnosis.json")]
    result = CliRunner().invoke(main, [*args, "--output", str(out)], catch_exceptions=False)
    assert result.stdout.startswith("old and new differ in 2 things.")
    assert "Error on held-out windows" in result.stdout
    assert out.exists()
    assert CliRunner().invoke(main, [*args, "--output", str(out)]).exit_code == 2
    assert "name it (--output)" in CliRunner().invoke(main, [*args, "--open"]).stderr
    data = json.loads(CliRunner().invoke(main, [*args, "--json"]).stdout)
    assert data["names"] == ["old", "new"]
    assert len(data["differences"]) == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("longer", "is_told"), [(1.0, True), (1.02, True), (1.4, False), (12, False)]
)
def test_errors_over_windows_of_different_length_are_not_set_side_by_side(before, longer, is_told):
    other = {**before, "window": longer * before["window"]}
    found = compare(before, other, names=("one", "two"))
    titles = [table.title for table in found.tables]
    free = next(table for table in found.tables if "free run" in table.title)
    assert any("held-out windows" in title for title in titles) == is_told
    assert ("not comparable" in free.title) != is_told
    cell = next(row[1] for row in free.rows if row[0] == "v, extended")
    assert float(cell.split()[0]) == pytest.approx(before["free_run"]["v"]["extended"], rel=0.01)


@pytest.mark.slow
def test_a_formula_is_compared(before):
    part = {"target": "v", "formula": "-38.5*sign(v) - 17.6*cos(x)"}
    with_formula = {**before, "unexplained": part}
    found = compare(before, with_formula)
    assert "Formula: none in A; −38.5·sign(v) − 17.6·cos(x) in v in B." in found.differences
    assert "−38.5·sign(v) − 17.6·cos(x) in v" in found.to_text()
    assert "v, with formula" in found.to_text()
    retuned = {**before, "unexplained": {**part, "formula": "-38.1*sign(v) - 17.9*cos(x)"}}
    assert not any("Formula" in said for said in compare(with_formula, retuned).differences)
