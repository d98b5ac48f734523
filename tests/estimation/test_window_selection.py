"""How long the windows are, where nobody sees a state."""

import numpy as np

from sklearn_pgnn import ModelDiagnosis, PhysicsModel


def test_a_hidden_velocity_may_have_dry_friction():
    model = PhysicsModel(
        {"shown": "V", "v": "m/s"},
        {"shown": "v - shown", "v": "F - v - 0.2*sign(v)"},
        inputs={"F": "N"},
        outputs={"sensor": "shown"},
    )
    t = np.arange(0, 20, 0.02)
    F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    y = model.simulate(t, F, substeps=4).y
    y = y + 1e-3 * np.random.default_rng(0).normal(size=y.shape)
    diagnosis = ModelDiagnosis(model, catalogue=["input_gain"])
    assert diagnosis.fit(np.column_stack([t, F]), y).verdict_ == "model_adequate"
