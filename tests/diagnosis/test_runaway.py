"""An unstable machine in closed loop: what is named predicts better than is possible without it."""

import pytest
from unstable_rig import FRICTION, GAP, STRENGTH, hovering, record

from sklearn_pgnn import ModelDiagnosis
from sklearn_pgnn.inspection.report.finding import next_step, title
from sklearn_pgnn.inspection.words import remaining_sentence, verdict_sentence

#: what ends a divergence, among others
BRAKES = ("rate_limit", "coulomb_friction", "viscous_friction", "constant_load")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_what_merely_ends_a_divergence_is_not_named(seed):
    """The prior's magnet is twice as strong and three times as near."""
    X, y = record(0.01, 1500, seed=seed)
    wrong = hovering(2.0 * STRENGTH, GAP / 3.5)
    lost = ModelDiagnosis(wrong, catalogue=BRAKES, max_causes=2).fit(X, y)
    assert lost.verdict_ == lost.to_dict()["verdict"] == "predicts_nothing"
    assert not lost.causes_
    assert lost.discrepancy_ is None
    assert title(lost).endswith("the model predicts no better than carrying on")
    assert "better than is possible without a model" in verdict_sentence(lost)
    assert "model's own error" in remaining_sentence(lost)
    assert "sample faster" in next_step(lost)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [FRICTION / 3, FRICTION])
@pytest.mark.parametrize("sample_time", [0.002, 0.01])
def test_friction_of_an_unstable_machine_is_found_however_it_is_sampled(sample_time, friction):
    X, y = record(sample_time, 2000, friction)
    prior = hovering(0.98 * STRENGTH, 0.97 * GAP)
    found = ModelDiagnosis(prior, catalogue=BRAKES, max_causes=2).fit(X, y)
    first = found.causes_[0]
    assert (first.effect, first.target) == ("coulomb_friction", "v")
    assert first.parameters["level"].value == pytest.approx(friction, rel=0.15)
    assert not found.remaining_.predicts_nothing


@pytest.mark.slow
def test_nothing_is_named_of_an_unstable_machine_that_lacks_nothing():
    X, y = record(0.01, 2000)
    prior = hovering(0.98 * STRENGTH, 0.97 * GAP)
    found = ModelDiagnosis(prior, catalogue=BRAKES, max_causes=2).fit(X, y)
    assert found.verdict_ == "model_adequate"
    assert not found.remaining_.predicts_nothing


@pytest.mark.slow
def test_nothing_is_named_where_noise_hides_all_that_an_unstable_model_foresees():
    """In 8 samples, noise at the start grows to the size of the output."""
    X, y = record(0.005, 2000, FRICTION, noise=0.1)
    prior = hovering(0.98 * STRENGTH, 0.97 * GAP)
    lost = ModelDiagnosis(prior, catalogue=BRAKES, max_causes=2).fit(X, y)
    assert not lost.causes_
    assert lost.verdict_ == "predicts_nothing"
