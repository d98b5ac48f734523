"""Functions in Python are models like any other, or say why not."""

import math

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.exceptions import ModelError, ModelWarning, OptionError
from sklearn_pgnn.priors import from_function

pytestmark = pytest.mark.core

STATES, INPUTS = {"phi": "rad", "omega": "rad/s"}, {"torque": "N m"}
VALUES = {"J": 0.1, "d": 0.02}


def pendulum(t, x, u, p):
    phi, omega = x
    return [omega, (u[0] - p["d"] * omega) / p["J"] - 9.81 * np.sin(phi)]


def model(rates, **more):
    return from_function(rates, STATES, inputs=INPUTS, parameters=VALUES, **more)


def test_it_is_the_model_that_its_text_would_be():
    written = PhysicsModel(
        STATES,
        {"phi": "omega", "omega": "(torque - d*omega)/J - 9.81*sin(phi)"},
        VALUES,
        INPUTS,
    )
    assert model(pendulum) == written


def test_effects_act_on_rates_inputs_and_outputs_of_it():
    found = model(pendulum, inertia={"omega": "J"}, outputs={"angle": "phi"})
    t, u = np.arange(0, 2, 0.01), np.sin(np.arange(0, 2, 0.01))
    before = found.simulate(t, u).y
    for effect in (
        effects.CoulombFriction("omega", level=0.05),
        effects.InputBias("torque", bias=0.1),
        effects.SensorBias("angle", bias=0.1),
    ):
        assert not np.allclose((found + effect).simulate(t, u).y, before)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (lambda x: np.where(x[0] > 0, x[1], 2 * x[1]), "2*omega - omega*(sign(phi)/2 + 1/2)"),
        (lambda x: np.maximum(x, 0.5)[1], "max(0.5, omega)"),
        (lambda x: np.clip(x[1], -1, 1), "min(1, max(-1, omega))"),
        (lambda x: (np.array([[0, 1], [-2, 3]]) @ x)[1], "3*omega - 2*phi"),
        (lambda x: np.sum(np.array([x[0], x[1]]) ** 2), "omega**2 + phi**2"),
        (lambda x: np.sin(np.array([x[0]]))[0], "sin(phi)"),
        (lambda x: np.hypot(x[0], 3.0) * np.sign(x[1]), "sqrt(phi**2 + 9)*sign(omega)"),
        (lambda x: x["omega"] * (x[0] > 1) * (x[0] < 2), None),
        (lambda x: -(abs(x[1]) ** 1.5) / (1 + np.exp(-x[0])), None),
    ],
)
def test_what_numpy_computes_is_followed(line, text):
    found = model(lambda t, x, u, p: [x[1], line(x)])
    if text is not None:
        assert found == found.replace(equations={"phi": "omega", "omega": text})


def test_rates_may_have_names_and_outputs_must():
    named = model(
        lambda t, x, u, p: dict(zip(("omega", "phi"), pendulum(t, x, u, p)[::-1], strict=True)),
        outputs=lambda t, x, u, p: {"angle": x[0], "power": u[0] * x[1]},
    )
    assert named.equations == model(pendulum).equations
    assert list(named.outputs) == ["angle", "power"]
    with pytest.raises(ModelError, match=r"outputs.*a dict of outputs by name, got list"):
        model(pendulum, outputs=lambda t, x, u, p: [x[0]])


def branches(t, x, u, p):
    if x[1] > 0:
        return [x[1], -p["d"]]
    return [x[1], p["d"]]


def needs_numbers(t, x, u, p):
    return [x[1], math.sin(x[0])]


def fills_an_array(t, x, u, p):
    rates = np.zeros(2)
    rates[0] = x[1]
    return rates


def interpolates(t, x, u, p):
    return [x[1], np.interp(x[0], [0.0, 1.0], [0.0, 2.0])]


def too_few(t, x, u, p):
    return [x[1]]


def remembers(t, x, u, p, calls=[]):  # noqa: B006
    calls.append(1)
    return [x[1], len(calls) * x[0]]


@pytest.mark.parametrize(
    ("rates", "said"),
    [
        (branches, r"rates, line \d+: expected an equation, got a branch.*np\.where"),
        (needs_numbers, r"rates, line \d+: expected functions of numpy.*np\.sin in place of math"),
        (fills_an_array, r"rates, line \d+: .*np\.zeros_like"),
        (interpolates, r"rates, line \d+: "),
        (too_few, r"rates: expected 2 rates, of phi, omega, got 1"),
        (remembers, r"returns the same values in every call, but 'omega'"),
        (lambda t, x, u, p: [x[1], p["mass"]], r"expected one of J, d, got 'mass'"),
    ],
)
def test_what_is_no_equation_is_refused_with_its_line(rates, said):
    with pytest.raises(ModelError, match=said):
        model(rates, trace=True)


@pytest.mark.slow
@pytest.mark.parametrize("rates", [branches, needs_numbers, interpolates])
def test_what_cannot_be_followed_is_called_with_a_warning(rates):
    with pytest.warns(ModelWarning, match=r"rates, line \d+: .* the model calls the function"):
        found = model(rates)
    assert found.opaque_functions == (rates.__name__,)


@pytest.mark.parametrize(
    ("rates", "said"),
    [
        (too_few, r"rates: expected 2 rates, of phi, omega, got 1"),
        (remembers, r"returns the same values in every call, but 'omega'"),
        (lambda t, x, u, p: [x[1], p["mass"]], r"expected one of J, d, got 'mass'"),
    ],
)
def test_what_computes_nothing_is_refused_whether_followed_or_called(rates, said):
    for trace in ("auto", False):
        with pytest.raises(ModelError, match=said):
            model(rates, trace=trace)


def test_an_unknown_way_is_refused():
    with pytest.raises(OptionError, match="'auto', True or False"):
        model(pendulum, trace="never")
