"""An unstable machine in closed loop: what is named predicts better than is possible without it."""

import numpy as np
import pytest
from unstable_rig import FRICTION, GROWTH, prior, record

from sklearn_pgnn import ModelDiagnosis
from sklearn_pgnn.inspection.report.next_step import next_step
from sklearn_pgnn.inspection.words import RUNS_AWAY, verdict_in_words, verdict_title

#: what ends a divergence, among others
BRAKES = ("rate_limit", "coulomb_friction", "viscous_friction", "constant_load", "input_gain")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_what_merely_ends_a_divergence_is_not_named(seed):
    """The prior's instability is ten times too fast, and no candidate changes that."""
    X, y = record(0.01, 1500, seed=seed)
    lost = ModelDiagnosis(prior(10 * GROWTH), catalogue=BRAKES[:4], max_causes=2).fit(X, y)
    assert lost.verdict_ == "unexplained"
    assert not lost.causes_
    assert lost.discrepancy_ is None
    assert lost.remaining_.runs_away
    assert verdict_title(lost) == RUNS_AWAY == verdict_in_words(lost.to_dict())
    assert "sample faster" in next_step(lost)


@pytest.mark.slow
def test_a_wrong_parameter_with_which_the_model_no_longer_runs_away_is_named():
    X, y = record(0.01, 1500)
    wrong = prior(10 * GROWTH)
    found = ModelDiagnosis(wrong, catalogue=(*BRAKES, "wrong_parameter"), max_causes=2).fit(X, y)
    assert [(cause.effect, cause.target) for cause in found.causes_] == [("wrong_parameter", "q")]
    assert found.extended_model_.parameters["q"].value == pytest.approx(GROWTH, rel=0.05)
    assert not found.remaining_.runs_away


@pytest.mark.slow
@pytest.mark.parametrize("sample_time", [0.002, 0.01])
def test_friction_of_an_unstable_machine_is_found_however_it_is_sampled(sample_time):
    X, y = record(sample_time, 3000, FRICTION)
    found = ModelDiagnosis(prior(), catalogue=BRAKES, max_causes=2).fit(X, y)
    assert found.causes_[0].effect == "coulomb_friction"
    level = found.causes_[0].parameters["level"]
    assert level.value == pytest.approx(FRICTION, rel=0.2)
    assert np.isfinite(found.gain_["x"].extended)
