"""Free runs of whole records: what they say, output by output."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.inspection.words import verdict_sentence

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
