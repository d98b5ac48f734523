"""Every verdict tells its own story, in words, sizes, models and maps."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from situations import situation

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.inspection.report import Provenance, render_report
from sklearn_pgnn.inspection.report.causes import members_of
from sklearn_pgnn.inspection.report.evidence_section import residual_maps, telling_quantities
from sklearn_pgnn.inspection.report.formula import FoundFormula
from sklearn_pgnn.inspection.words import dependence, lacks

pytestmark = [pytest.mark.core, pytest.mark.filterwarnings("ignore:.*the term:UserWarning")]


def html(name):
    return render_report(situation(name), Provenance(date="2026-11-22"))


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
    assert text.index('id="quality"') < text.index('class="verdict')
    assert "beware of data-quality problems" in text


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
    assert dependence(diagnosis, replace(part, share=0.0)) == (
        "Its formula holds v and F, but in records not used for it these explain almost nothing "
        "of its smoothed time series: treat it as a hint only. "
    )


def test_an_effect_is_missing_but_a_number_is_wrong():
    kinds = ("coulomb_friction", "v"), ("wrong_parameter", "m"), ("input_delay", "u")
    causes = [SimpleNamespace(effect=effect, target=target) for effect, target in kinds]
    assert lacks(causes[1:2]) == "has a wrong value of m"
    said = "lacks Coulomb friction on v and input delay of u and has a wrong value of m"
    assert lacks(causes) == said
