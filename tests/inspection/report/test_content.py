"""The content of a report: its numbers agree, every verdict has its story, its source is told."""

import copy
import hashlib
import math
import re
from dataclasses import replace
from functools import cache
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest
from schemas import faults
from situations import HIDDEN, situation

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.inspection.numbers import measured, number, sized, times
from sklearn_pgnn.inspection.report import Provenance, render_report
from sklearn_pgnn.inspection.report.causes import members_of
from sklearn_pgnn.inspection.report.evidence_section import residual_maps, telling_quantities
from sklearn_pgnn.inspection.report.formula import FoundFormula
from sklearn_pgnn.inspection.report.parameters import correlation
from sklearn_pgnn.inspection.report.provenance import method
from sklearn_pgnn.inspection.runs import run_estimators
from sklearn_pgnn.inspection.words import dependence, lacks

pytestmark = [pytest.mark.core, pytest.mark.filterwarnings("ignore:.*the term:UserWarning")]


def test_an_interval_with_one_end_says_it():
    assert measured(0.5, 0.4, math.inf, "V") == "0.50 (at least 0.40) V"
    assert measured(-0.26, -math.inf, -0.22) == "-0.26 (at most -0.22)"
    assert measured(0.5, -math.inf, math.inf, "V") == measured(0.5, 0.5, math.inf, "V") == "0.5 V"
    assert sized(-0.26, -math.inf, -0.22, "1/(m s)") == "-0.26 1/(m s)"


def plain(html):
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", html)).split())


def part(html, begin, end):
    """Return the text between two marks of the HTML."""
    return plain(html[html.index(begin) : html.index(end, html.index(begin))])


@cache
def html(name):
    return render_report(situation(name), Provenance(date="2026-11-22"))


@pytest.mark.slow
@pytest.mark.parametrize("name", HIDDEN)
def test_sentence_tile_and_tables_say_what_the_file_says(name):
    diagnosis, text = situation(name), html(name)
    data = diagnosis.to_dict()
    gain, run = data["gain"]["v"], data["free_run"]["v"]
    best = "extended" if diagnosis.discrepancy_ is None else "formula"
    known = {w: gain[w] for w in ("prior", "refitted", "extended", "formula") if gain[w]}
    left = {which: times(error / gain["noise"]) for which, error in known.items()}
    free = times(run[best] / gain["noise"])
    before, after = (number(run[which], 3) for which in ("prior", best))
    sentence = part(text, '<p class="sentence', "</p>")
    assert f"Error of v in free run {before} → {after} m/s" in part(text, '"tiles"', "</li>")
    assert f"left: {free}" in part(text, '"tiles"', "</li>")
    if diagnosis.verdict_ == "model_adequate":
        assert left[best] in sentence
    else:
        assert f"the error of v in free run falls from {before} to {after} m/s" in sentence
    assert lacks(diagnosis.causes_) in sentence
    if len(diagnosis.causes_) == 1:
        worth = f"{left['refitted'].removesuffix(' ×')} → {left['extended']} the noise"
        assert f"Error reduction: {worth}" in part(text, 'id="missing"', "</section>")
    table = part(text, 'id="errors"', "</table>")
    assert all(f"({said})" in table for said in (left["prior"], left["refitted"], left[best], free))
    assert ("With formula" in table) == (best == "formula")
    if len(diagnosis.causes_) == 1 and 'id="candidates"' in text:
        row = part(text[text.index('id="candidates"') :], '<tr class="named">', "</tr>")
        assert f" {left['extended']} " in row


@pytest.mark.parametrize("name", ["adequate", "named", "unexplained"])
def test_the_run_that_convinces_is_that_of_the_record_which_fits_worst_as_given(name):
    runs = run_estimators(situation(name))
    prior, *_, best = map(np.array, runs.simulated.values())
    y, norm = np.array(runs.measured), np.linalg.norm
    spread = norm(y - y.mean(axis=1, keepdims=True), axis=1)
    fits = [100 * (1 - norm(run - y, axis=1) / spread) for run in (prior, best)]
    k, figure = np.argmin(fits[0]), part(html(name), "<figure>", "</figure>")
    assert figure.startswith(f"Record {k + 1} of 4. Where the model as given is worst.")
    assert re.findall(r"fit ([\d.]+) %", figure)[:2] == [f"{fit[k, 0]:.1f}" for fit in fits]


@pytest.mark.parametrize("name", HIDDEN)
def test_sizes_and_intervals_are_those_of_the_file(name):
    data, text = situation(name).to_dict(), html(name)
    assert faults("diagnosis", {**data, "version": ""}) == []
    title, table = part(text, "<h1>", "</h1>"), part(text, 'id="parameters"', "</section>")
    for parameter in data["parameters"].values():
        assert measured(*(parameter[key] for key in ("value", "low", "high"))) in table
    for cause in data["causes"]:
        first = next(iter(cause["parameters"].values()))
        shown = float(re.search(r"\([a-z ]+ (−?[\d.]+)", title)[1].replace("−", "-"))
        assert shown == pytest.approx(first["value"], rel=0.02)
        for e in cause["parameters"].values():
            said = measured(e["value"], e["low"], e["high"], e["unit"]).replace("-", "−")
            assert said.replace("^2", "²") in plain(text)


def test_adequate_as_given_and_after_retuning_are_told_apart():
    assert "adequate as given" in html("adequate")
    retuned = html("retuned")
    assert "adequate with m and d re-tuned" in retuned
    assert "Use the new values of m and d" in retuned
    assert "(as given" in retuned


def test_every_member_of_an_ambiguity_has_its_size_and_a_model_that_reads_back(tmp_path):
    diagnosis = situation("ambiguous")
    cause = diagnosis.causes_[0]
    members = members_of(diagnosis, cause)
    assert len(members) == 1 + len(cause.confused_with)
    sizes = {member.effect.id: member.sizes[0][1] for member in members}
    assert sizes["input_bias"] == pytest.approx(0.3, rel=0.05)
    assert abs(sizes["constant_load"]) == pytest.approx(0.3, rel=0.05)
    for member in members:
        assert member.left == pytest.approx(members[0].left, rel=0.05)
        (tmp_path / "model.yaml").write_text(member.model.to_yaml(), encoding="utf-8")
        again = PhysicsModel.from_yaml(tmp_path / "model.yaml")
        assert set(again.parameters) == set(member.model.parameters)
    assert html("ambiguous").count("<summary>Model file with") == len(members)


def test_a_formula_has_a_unit_an_interval_and_its_model():
    found = FoundFormula(situation("unexplained"))
    (term,) = [term for term in found.terms if "F**2" in str(term.expression)]
    assert term.coefficient.low < -0.2 < term.coefficient.high
    assert found.coefficient_unit(term) == "m/s² / (m/s · N²)"
    text = html("unexplained")
    assert "Model file with the formula" in text
    assert "with the formula" in text[text.index('id="curves"') :]
    assert text[text.index('id="formula"') :].index("<math") > 0


def test_faults_of_the_records_come_first_and_weaken_the_verdict():
    text = html("bad")
    first = part(text, '<section class="first"', "</section>")
    assert "beware of data-quality problems" in first
    assert "1 fault Look at this: outliers of v Next step: Improve the records first" in first
    assert re.findall(r'<h2 id="(\w+)"', text)[1] == "quality"


@pytest.mark.slow
def test_a_map_shows_where_a_hidden_catch_acts():
    cart = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F - k*x - d*v)/m"},
        {"m": 2.0, "k": 10.0, "d": 1.0},
        {"F": "N"},
        outputs={"position": "x"},
        inertia={"v": "m"},
    )
    catch = "(F - k*x - d*v - 3*exp(-((x-0.15)/0.03)**2)*sign(v))/m"
    t = np.arange(0, 60, 0.02)
    F = 4 * np.sin(1.3 * t) + 3 * np.sin(3.1 * t)
    y = cart.replace(equations={"x": "v", "v": catch}).simulate(t, F, substeps=4).y
    y += 1e-3 * np.random.default_rng(0).standard_normal(y.shape)
    catalogue = (effects.InputBias,)
    diagnosis = ModelDiagnosis(cart, catalogue=catalogue).fit(np.column_stack([t, F]), y)
    assert telling_quantities(diagnosis, "v") == ("x", "v")
    maps = residual_maps(diagnosis, None)
    assert maps[0]["title"] == "Force that is missing on v"
    assert "missing on v" in render_report(diagnosis)


def test_an_adequate_model_says_what_may_still_be_hidden():
    diagnosis = situation("adequate")
    table = diagnosis.detectability([effects.InputDeadZone], n_repeats=40)
    text = render_report(diagnosis, detectability=table)
    assert f"threshold {table.rows[0].smallest:.2g} N" in text
    assert "sklearn-pgnn detect" in html("adequate")
    assert "would have shown" not in html("named")


def test_a_formula_that_tells_nothing_elsewhere_is_a_hint():
    diagnosis = situation("unexplained")
    part = diagnosis.discrepancy_
    assert dependence(diagnosis, part).startswith("It depends on v and F, which explain ")
    said = dependence(diagnosis, replace(part, share=0.0))
    assert said.startswith(
        "Its formula holds v and F, but in records not used for it these explain"
    )
    assert said.endswith("treat it as a hint only. ")


def test_an_effect_is_missing_but_a_number_is_wrong():
    kinds = ("coulomb_friction", "v"), ("wrong_parameter", "m"), ("input_delay", "u")
    causes = [SimpleNamespace(effect=e, target=t, probability=1.0, outside=0.0) for e, t in kinds]
    assert lacks(causes[1:2]) == "has a wrong value of m"
    said = "lacks Coulomb friction on v and input delay of u and has a wrong value of m"
    assert lacks(causes) == said


@pytest.fixture
def known(tmp_path):
    paths = [tmp_path / name for name in ("model.yaml", "r-1.csv")]
    for path in paths:
        path.write_text(path.name)
    command = "sklearn-pgnn diagnose -x -1"
    return Provenance.of_files(paths[0], paths[1:], command, date="2026-11-22")


def test_where_no_free_run_tells_windows_stand_in_the_first_screen():
    lost = copy.copy(situation("named"))
    lost.free_run_ = {"v": replace(lost.free_run_["v"], tells=False)}
    first = part(render_report(lost), '<section class="first"', "</section>")
    before, after = (number(getattr(lost.gain_["v"], e), 3) for e in ("prior", "extended"))
    assert f"the error of v over windows of 0.5 s falls from {before} to {after} m/s" in first
    assert f"Error of v over held-out windows {before} → {after} m/s" in first
    assert "No free run tells here: the models restart from the record every 0.5 s." in first


def test_files_hashes_command_and_samples_are_stated(known):
    text = render_report(situation("adequate"), known)
    for name in ("model.yaml", "r-1.csv"):
        assert hashlib.sha256(name.encode()).hexdigest() in text
    for what in ("4 records, 2000 samples", "2026-11-22", "diagnose -x -1", "sklearn-pgnn 0."):
        assert what in text


def test_the_method_says_which_faults_were_left_out_by_what_is_known_of_the_channels():
    found = copy.copy(situation("adequate"))
    assert "that the channels can have" not in method(found)
    (output,) = found.model.outputs
    found.model = found.model.replace(channels={output: "encoder"})
    assert f"can have were tried: {output} is read by an encoder; of " in method(found)


def test_the_same_is_written_again(known):
    diagnosis = situation("adequate")
    assert render_report(diagnosis, known) == render_report(diagnosis, known)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        Provenance.of_files(None, [tmp_path / "nowhere.csv"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["adequate", "named", "unexplained"])
def test_the_matrix_of_correlations_has_every_parameter(name):
    shown = html(name)[html(name).index("Correlation of the parameters") :]
    assert all(f"<code>{parameter}</code>" in shown for parameter in situation(name).parameters_)
    assert "Beyond ±0.9" in shown or "None is beyond ±0.9" in shown


@pytest.mark.slow
def test_the_correlations_are_within_bounds_and_pairs_beyond_the_bound_are_named():
    found = correlation(situation("named"))
    values = [float(cell["text"].replace("−", "-")) for _, cells in found["rows"] for cell in cells]
    assert len(values) == len(found["names"]) * (len(found["names"]) + 1) // 2
    assert all(abs(value) <= 1 for value in values)
    assert len(found["tight"]) == sum(abs(value) > 0.9 for value in values)


def test_the_policy_allows_the_script_that_makes_parts_large_only():
    (policy,) = re.findall(r'Security-Policy" content="([^"]*)"', html("named"))
    assert re.search(r"script-src 'sha256-[\w+/=]+';", policy)
    assert "unsafe" not in policy
    assert 'data-x="' in html("named")
