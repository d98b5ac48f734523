"""Free runs of whole records, output by output, and unstable machines, which have none."""

import numpy as np
import pandas as pd
import pytest
from unstable_rig import FRICTION, GAP, STRENGTH, hovering, record

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.inspection.report.finding import next_step, title
from sklearn_pgnn.inspection.words import remaining_sentence, verdict_sentence

STEP = 0.005
#: a body in the field of a coil: it falls away from where it hangs, the coil's current does not
LEVITATOR = PhysicsModel(
    {"h": "m", "v": "m/s", "i": "A"},
    {"h": "v", "v": "a*h - b*i", "i": "(u - R*i)/L"},
    {"a": 900.0, "b": 10.0, "R": 2.0, "L": 0.02},
    {"u": "V"},
    outputs={"gap": "h", "current": "i"},
)


def hover(machine, samples=400):
    """Return records of a levitator under control, a test signal being added to the command."""
    rng, tables, outputs = np.random.default_rng(0), [], []
    for k in range(4):
        t, x, command = STEP * np.arange(samples), [np.array([1e-3, 0.0, 0.0])], []
        for now in t[:-1]:
            gap, speed, _ = x[-1]
            test_signal = 0.6 * np.sign(np.sin(7.0 * now + k))
            command.append(400.0 * gap + 20.0 * speed + test_signal)
            x.append(machine.simulate([0.0, STEP], command[-1:] * 2, x[-1], substeps=5).x[-1])
        tables.append(pd.DataFrame({"trajectory": k, "t": t, "u": [*command, command[-1]]}))
        outputs.append(np.array(x)[:, [0, 2]])
    y = np.concatenate(outputs)
    return pd.concat(tables, ignore_index=True), y + [2e-5, 2e-3] * rng.normal(size=y.shape)


@pytest.mark.slow
def test_the_free_run_tells_of_the_stable_output_of_an_unstable_machine_only():
    diagnosis = ModelDiagnosis(LEVITATOR).fit(*hover(LEVITATOR + effects.ViscousFriction("v", 8.0)))
    assert diagnosis.verdict_ == "cause_named"
    (cause,) = diagnosis.causes_
    assert (cause.effect, cause.target) == ("viscous_friction", "v")
    assert cause.parameters["coefficient"].low <= 8.0 <= cause.parameters["coefficient"].high
    tells = {output: error.tells for output, error in diagnosis.free_run_.items()}
    assert tells == {"gap": False, "current": True}
    assert "The free run of gap is not informative: " in verdict_sentence(diagnosis)


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
