"""A network in ONNX takes the steps of its own free run."""

from functools import cache

import numpy as np
import onnxruntime
import pandas as pd
import pytest

from sklearn_pgnn import PGNNLRegressor, PhysicsModel, effects, systems
from sklearn_pgnn.estimators.network.step_network import ready_to_run
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export import to_onnx
from sklearn_pgnn.network import Recurrent
from sklearn_pgnn.simulation.network_run import prior_steps

INTERVAL = 1 / 64
CART = systems.cart_on_spring()
ROBOT = systems.golf_robot()
BENT = PhysicsModel(
    {"y": "V"}, {"y": "(min(max(u, -1), 1) - abs(y)*y - exp(-y**2)/9 + sin(t))/T"}, {"T": 0.5},
    {"u": "V"},
)  # fmt: skip
BRIEF = {"max_epochs": 2, "refine": None, "module__neurons": 5}


@cache
def fitted(name, n=800):
    model = {"cart": CART, "robot": ROBOT, "bent": BENT}[name]
    t = np.arange(n) * INTERVAL
    u = 0.5 * np.sin(0.7 * t) + 0.3 * np.sin(3.1 * t)
    run = model.simulate(t, u)
    states = pd.DataFrame(run.x, columns=list(model.states))
    return model, states.assign(t=t, **dict.fromkeys(model.inputs, u)), run.y


def steps(network, X):
    """Return the network's record, its states in free run, and the inputs of every step by name."""
    (record,) = network._read_ready(X).ready
    x, _ = ready_to_run(network.module_.core, network.step_)(record)
    here, following = record.acting[:-1], record.acting[1:]
    given = {
        "x": x[:-1],
        "u": here,
        "u_next": following,
        "t": record.t[:-1, None],
        "features": record.features[1:],
        "simulated": record.simulated[1:],
    }
    return record, x, given


def run(model, given):
    session = onnxruntime.InferenceSession(model.SerializeToString())
    kinds = {"tensor(double)": np.float64, "tensor(float)": np.float32}
    taken = {part.name: given[part.name].astype(kinds[part.type]) for part in session.get_inputs()}
    return session.run(None, taken)


@pytest.mark.parametrize("structure", ["output", "increment", "correction"])
@pytest.mark.parametrize("guide", [None, "simulation", "step", "terms"])
@pytest.mark.parametrize("name", ["cart", "bent"])
def test_every_step_is_that_of_the_free_run(name, structure, guide):
    model, X, y = fitted(name)
    X = X.assign(temperature=np.cos(X["t"]))
    network = PGNNLRegressor(model, structure=structure, guide=guide, **BRIEF).fit(X, y)
    _, x, given = steps(network, X)
    assert np.allclose(run(to_onnx(network), given)[0], x[1:], rtol=0, atol=1e-12)


@pytest.mark.filterwarnings("ignore:.*ended at a limit")
def test_parameters_that_were_trained_with_the_network():
    model, X, y = fitted("cart")
    network = PGNNLRegressor(model, free="all", sees=["v"], **BRIEF).fit(X, y)
    _, x, given = steps(network, X)
    (found,) = run(to_onnx(network), given)
    assert np.abs(found - x[1:]).max() < 1e-12


@pytest.mark.parametrize("activation", ["relu", "silu", "sigmoid", "identity"])
def test_every_activation_and_straight_inputs(activation):
    model, X, y = fitted("cart")
    options = {**BRIEF, "module__activation": activation, "hold": "foh"}
    network = PGNNLRegressor(model, structure="correction", **options).fit(X, y)
    _, x, given = steps(network, X)
    assert np.allclose(run(to_onnx(network), given)[0], x[1:], rtol=0, atol=1e-12)


def test_a_recurrent_core_hands_its_hidden_state_on():
    model, X, y = fitted("cart")
    network = PGNNLRegressor(model, module=Recurrent, **BRIEF).fit(X, y)
    _, x, given = steps(network, X)
    exported, hidden, found = to_onnx(network), np.zeros((1, 5)), []
    session = onnxruntime.InferenceSession(exported.SerializeToString())
    names = [part.name for part in session.get_inputs() if part.name != "hidden"]
    for k in range(50):
        row = {name: given[name][k : k + 1] for name in names}
        following, hidden = session.run(None, {**row, "hidden": hidden})
        found.append(following[0])
    assert np.allclose(found, x[1:51], rtol=0, atol=1e-12)


def test_the_models_step_may_be_an_input():
    model, X, y = fitted("robot")
    network = PGNNLRegressor(model, structure="correction", **BRIEF).fit(X, y)
    with pytest.raises(ModelError, match=r"'omega' has dry friction.*prior_as_input=True"):
        to_onnx(network)
    record, x, given = steps(network, X)
    dt, step = np.diff(record.t), network.step_
    ends = (record.acting[:-1], record.acting[1:])
    prior = prior_steps(model, step.substeps, step.hold, record.t[:-1], dt, x[:-1], *ends)[0]
    found = run(to_onnx(network, prior_as_input=True), {**given, "prior": prior})[0]
    assert np.allclose(found, x[1:], rtol=0, atol=1e-12)


def test_single_precision_is_near():
    model, X, y = fitted("robot")
    network = PGNNLRegressor(model, structure="increment", **BRIEF).fit(X, y)
    _, x, given = steps(network, X)
    off = np.abs(run(to_onnx(network, precision="single"), given)[0] - x[1:]).max()
    assert 1e-12 < off < 1e-5


@pytest.mark.parametrize(
    ("network", "options", "what"),
    [
        (CART, {}, r"pipeline\[-1\]"),
        (PGNNLRegressor(CART), {"precision": "half"}, "double, single"),
    ],
)
def test_what_it_cannot_be_is_refused(network, options, what):
    with pytest.raises(OptionError, match=what):
        to_onnx(network, **options)


def test_effects_are_in_the_graph():
    model = CART + effects.Hysteresis("v", 3.0, 0.02)
    t = np.arange(600) * INTERVAL
    u = 3 * np.sin(t)
    run_ = model.simulate(t, u)
    X = pd.DataFrame({"t": t, "force": u})
    network = PGNNLRegressor(model, structure="correction", guide="step", **BRIEF).fit(X, run_.y)
    _, x, given = steps(network, X)
    assert np.allclose(run(to_onnx(network), given)[0], x[1:], rtol=0, atol=1e-11)
