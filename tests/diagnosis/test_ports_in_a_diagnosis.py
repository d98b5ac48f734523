"""The joint at which friction acts is named: coupled machines, simulated independently."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel

STEP, FINE, SAMPLES, RECORDS = 0.02, 40, 400, 3
#: speed over which the reference's friction is smoothed, far below every speed of the records
SMOOTH = 2e-4
CATALOGUE = ["coulomb_friction", "viscous_friction"]
#: a hanging pendulum below a cart that a force drives, and a torque at the hinge
HINGED = PhysicsModel(
    {"x": "m", "v": "m/s", "th": "rad", "w": "rad/s"},
    {
        "x": "v",
        "v": "(F - d*v + m*s*(l*w**2 + g*c) - T*c/l)/(M + m*s**2)",
        "th": "w",
        "w": "(T*(M + m)/(m*l) - c*(F - d*v + m*l*w**2*s) - (M + m)*g*s)/(l*(M + m*s**2))",
    },
    {
        "M": {"value": 2.2, "unit": "kg", "spread": 0.05},
        "m": {"value": 0.6, "unit": "kg", "spread": 0.05},
        "l": {"value": 0.8, "unit": "m", "spread": 0.02},
        "d": {"value": 2.0, "unit": "N s/m", "spread": 0.3},
        "g": {"value": 9.81, "unit": "m/s^2", "fixed": True},
    },
    {"F": "N"},
    outputs={"x": "x", "th": "th"},
    let={"s": "sin(th)", "c": "cos(th)"},
    ports={"hinge": {"effort": "T", "flow": "w"}, "track": {"effort": "F", "flow": "v"}},
)


def rates(state, F, at_hinge, at_track):
    """Return the rates of cart and pendulum by their mass matrix."""
    _, v, th, w = state
    M, m, l, d, g = 2.2, 0.6, 0.8, 2.0, 9.81  # noqa: E741 - the length
    s, c = np.sin(th), np.cos(th)
    force = F - d * v - at_track * np.tanh(v / SMOOTH) + m * l * w**2 * s
    torque = -m * g * l * s - at_hinge * np.tanh(w / SMOOTH)
    a, b, e = M + m, m * l * c, m * l**2
    det = a * e - b**2
    return np.array([v, (e * force - b * torque) / det, w, (a * torque - b * force) / det])


def swung(at_hinge, at_track):
    """Return X and y of a cart with dry friction at the hinge and at the track."""
    rng, t = np.random.default_rng(5903), STEP * np.arange(SAMPLES)
    levels = rng.uniform(-9, 9, (RECORDS, SAMPLES // 20 + 1))
    F = levels[:, np.arange(SAMPLES) // 20]
    x = np.zeros((4, RECORDS))
    x[2] = rng.uniform(-0.6, 0.6, RECORDS)
    seen, h = [x], STEP / FINE
    for k in range(SAMPLES - 1):
        for _ in range(FINE):
            k1 = rates(x, F[:, k], at_hinge, at_track)
            k2 = rates(x + h / 2 * k1, F[:, k], at_hinge, at_track)
            k3 = rates(x + h / 2 * k2, F[:, k], at_hinge, at_track)
            k4 = rates(x + h * k3, F[:, k], at_hinge, at_track)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        seen.append(x)
    y = np.array(seen)[:, [0, 2]].transpose(2, 0, 1) + rng.normal(0, 2e-4, (RECORDS, SAMPLES, 2))
    frames = [pd.DataFrame({"trajectory": r, "t": t, "F": F[r]}) for r in range(RECORDS)]
    return pd.concat(frames, ignore_index=True), np.concatenate(list(y))


@pytest.mark.slow
@pytest.mark.parametrize(("place", "level"), [("hinge", 0.06), ("track", 0.8)])
def test_the_joint_with_friction_is_named(place, level):
    levels = {"hinge": (level, 0.0), "track": (0.0, level)}[place]
    diagnosis = ModelDiagnosis(HINGED, catalogue=CATALOGUE).fit(*swung(*levels))
    (cause,) = diagnosis.causes_
    assert (diagnosis.verdict_, cause.effect, cause.target) == (
        "cause_named", "coulomb_friction", place,
    )  # fmt: skip
    assert cause.probability > 0.9
    assert cause.parameters["level"].value == pytest.approx(level, rel=0.03)
    assert diagnosis.to_dict()["causes"][0]["name"] == f"Coulomb friction at the {place}"


@pytest.mark.slow
def test_no_joint_is_named_without_friction():
    diagnosis = ModelDiagnosis(HINGED, catalogue=CATALOGUE).fit(*swung(0.0, 0.0))
    assert (diagnosis.verdict_, diagnosis.causes_) == ("model_adequate", ())
