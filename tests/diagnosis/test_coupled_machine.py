"""A force that enters several equations: friction of a cart below an upright pendulum."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, Parameter, PhysicsModel

STEP, SAMPLES, RECORDS, LEVEL = 0.02, 600, 3, 1.5
NOISE = np.array([0.001, 0.001])
PULL = "(F + m*l*w**2*sin(th) - m*g*sin(th)*cos(th))/(M + m*sin(th)**2)"
CART = PhysicsModel(
    {"x": "m", "v": "m/s", "th": "rad", "w": "rad/s"},
    {"x": "v", "v": PULL, "th": "w", "w": f"(g*sin(th) - cos(th)*{PULL})/l"},
    {
        "M": Parameter("M", 1.0, unit="kg"),
        "m": Parameter("m", 0.2, unit="kg"),
        "l": Parameter("l", 0.5, unit="m"),
        "g": Parameter("g", 9.81, unit="m/s^2", fixed=True),
    },
    {"F": "N"},
    outputs={"position": "x", "angle": "th"},
)
#: the balanced cart: the force is the controller's, less a friction; the reference is its input
HELD = "30*th + 8*w + 3*(x - r) + 5*v"


def balanced(level):
    """Return X and y of a balanced cart with dry friction, which the controller does not know."""
    force = f"({HELD} - {level}*tanh(v/0.002))"
    rates = {name: str(rate).replace("F", force) for name, rate in CART.equations.items()}
    plant = CART.replace(equations=rates, inputs={"r": "m"})
    rng, X, y = np.random.default_rng(7103), [], []
    t = STEP * np.arange(SAMPLES)
    for number in range(RECORDS):
        phase = rng.uniform(0, 2 * np.pi, 3)
        waves = [np.sin(2 * np.pi * f * t + p) for f, p in zip((0.1, 0.3, 0.7), phase, strict=True)]
        reference = 0.3 * np.sum(waves, axis=0)
        run = plant.simulate(t, reference, [0.0, 0.0, 0.05, 0.0], substeps=40, hold="foh")
        states = dict(zip(plant.states, run.x.T, strict=True))
        F = 30 * states["th"] + 8 * states["w"] + 3 * (states["x"] - reference) + 5 * states["v"]
        X.append(pd.DataFrame({"trajectory": number, "t": t, "F": F}))
        y.append(run.y + NOISE * rng.standard_normal(run.y.shape))
    return pd.concat(X, ignore_index=True), np.concatenate(y)


@pytest.mark.slow
def test_friction_that_enters_two_equations_is_named_at_the_velocity_of_the_force():
    X, y = balanced(LEVEL)
    catalogue = ["coulomb_friction", "viscous_friction"]
    diagnosis = ModelDiagnosis(CART, catalogue=catalogue, hold="foh").fit(X, y)
    (cause,) = diagnosis.causes_
    assert (diagnosis.verdict_, cause.effect, cause.target) == (
        "cause_named", "coulomb_friction", "v",
    )  # fmt: skip
    assert cause.parameters["level"].value == pytest.approx(LEVEL, rel=0.02)


def test_nothing_is_missing_without_friction():
    diagnosis = ModelDiagnosis(CART, hold="foh").fit(*balanced(0.0))
    assert (diagnosis.verdict_, diagnosis.causes_) == ("model_adequate", ())
