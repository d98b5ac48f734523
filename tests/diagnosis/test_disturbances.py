"""Something unmeasured acts on the machine: it gets no name, and hides none."""

import numpy as np
import pandas as pd
import pytest
from disturbed_cart import CART, RECORDS, drive, slow_noise

from sklearn_pgnn import ModelDiagnosis, datasets, effects, systems
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.diagnosis.formula_selection import FormulaSelection
from sklearn_pgnn.diagnosis.moves import Moves
from sklearn_pgnn.physics.expressions import symbol


def leaking_tanks():
    """Let water that nothing measures come and go in the lower tank; give the prior, X and y."""
    model, rng = systems.two_tanks(), np.random.default_rng(11)
    options = {"n_records": RECORDS, "duration": 600.0, "sample_rate": 0.5, "noise": 1e-2}
    shape = {"excitation": ("multisine", "chirp"), "amplitude": 2.7, "random_state": 11}
    calm = datasets.make_hidden_effect(model, None, **options, **shape)
    records = [rows for _, rows in calm.X.groupby("trajectory")]
    t = records[0]["t"].to_numpy()
    u = np.stack([rows[list(model.inputs)] for rows in records])
    x0 = np.stack([rows[list(model.states)].iloc[0] for rows in records])
    x, y = integrate(model, t, u, x0)
    flow = slow_noise(rng, np.exp(-50 / t.size), u.shape[:2])
    flow *= 0.1 * np.std(np.gradient(x[..., 1], t, axis=1))
    rates = {**model.equations, "x2": model.equations["x2"] + symbol("flow")}
    rig = model.replace(equations=rates, inputs={**model.inputs, "flow": ""})
    _, disturbed = integrate(rig, t, np.concatenate([u, flow[..., None]], axis=2), x0)
    return calm.prior, calm.X, calm.y + (disturbed - y).reshape(calm.y.shape)


@pytest.mark.slow
def test_a_disturbance_gets_no_name_though_windows_tell_for_one(monkeypatch):
    prior, X, y = leaking_tanks()
    catalogue = ("parameter_slope", "parameter_saturation", "leak", "overflow", "state_limit")
    diagnosis = ModelDiagnosis(prior, catalogue=catalogue).fit(X, y)
    assert (diagnosis.verdict_, diagnosis.remaining_.kind) == ("nothing_found", "disturbance")
    monkeypatch.setattr(Moves, "drop_disturbed", lambda *_: None)
    monkeypatch.setattr(FormulaSelection, "choose", lambda _, search, result, left: (result, None))
    assert ModelDiagnosis(prior, catalogue=catalogue).fit(X, y).causes_


@pytest.mark.slow
@pytest.mark.parametrize(
    "hidden",
    [
        effects.CoulombFriction("v", level=0.5),
        effects.QuadraticDrag("v", 0.8),
        effects.ActuatorLag("F", 0.08),
    ],
)
def test_what_is_hidden_is_named_beside_a_disturbance(hidden):
    catalogue = ("coulomb_friction", "quadratic_drag", "actuator_lag", "cubic_stiffness")
    diagnosis = ModelDiagnosis(CART, catalogue=catalogue)
    (cause,) = diagnosis.fit(*drive(CART + hidden, 0.2)).causes_
    assert (cause.effect, cause.target) == (hidden.id, hidden.target)
    assert cause.probability > 0.99 * (1.0 - cause.outside)  # much is left, of no one knows what
    assert diagnosis.remaining_.kind == "disturbance"


@pytest.mark.slow
@pytest.mark.parametrize("short", [4, 15])
def test_a_short_record_changes_no_name(short):
    X, y = drive(CART + effects.CoulombFriction("v", level=0.5), 0.2)
    X = pd.concat([X, X[:short].assign(trajectory=RECORDS)], ignore_index=True)
    diagnosis = ModelDiagnosis(CART, catalogue=("coulomb_friction", "quadratic_drag"))
    (cause,) = diagnosis.fit(X, np.concatenate([y, y[:short]])).causes_
    assert cause.effect == "coulomb_friction"
    assert cause.probability > 0.99 * (1.0 - cause.outside)
