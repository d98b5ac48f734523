"""A trained network in C gives the numbers of its own free run."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from c_program import run_c
from torch import nn

from sklearn_pgnn import PGNNLRegressor, effects, make_pgnn_pipeline, systems
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export import to_c
from sklearn_pgnn.network import Recurrent

INTERVAL = 1 / 64
ROBOT = systems.golf_robot()
CART = systems.cart_on_spring()
BRIEF = {"max_epochs": 3, "refine": None, "module__neurons": 5}


def records(model, n, size):
    """Return a table of a machine that is driven, and its outputs."""
    t = np.arange(n) * INTERVAL
    u = size * (np.sin(0.7 * t) + 0.5 * np.sin(3.1 * t))
    run = model.simulate(t, u)
    table = pd.DataFrame({"t": t, **dict.fromkeys(model.inputs, u)})
    states = pd.DataFrame(run.x, columns=list(model.states))
    return pd.concat([table, states], axis=1), run.y


@cache
def robot_records(n=1500):
    return records(ROBOT + effects.ViscousFriction("omega", 0.05), n, 0.2)


def differ(network, X, folder, **options):
    """Return the largest difference of C and Python, as a share of the output's range."""
    expected = network.predict(X).reshape(len(X), -1)
    model, interval = network.model_, options.pop("interval", None)
    text = to_c(network, interval, name="net", precision=options.get("precision", "double"))
    further = list(network.further_columns_)
    given = {"features": X[further].to_numpy()} if further else {}
    x0 = X[list(model.states)].to_numpy()[0] if set(model.states) <= set(X.columns) else None
    u = X[[model.columns.get(name, name) for name in model.inputs]].to_numpy()
    found = run_c(text, folder, "net", model, u, x0=x0, hold=network.hold_, **given, **options)[1]
    return np.abs(found - expected).max() / np.ptp(expected)


@pytest.mark.parametrize("structure", ["output", "increment", "correction"])
@pytest.mark.parametrize("guide", [None, "simulation", "step", "terms"])
def test_every_structure_and_guide(structure, guide, tmp_path):
    X, y = robot_records()
    network = PGNNLRegressor(ROBOT, structure=structure, guide=guide, **BRIEF).fit(X, y)
    assert differ(network, X, tmp_path) < 1e-12


@pytest.mark.filterwarnings("ignore:.*ended at a limit")
def test_parameters_that_were_trained_with_the_network(tmp_path):
    X, y = robot_records()
    network = PGNNLRegressor(ROBOT, free="all", sees=["omega"], **BRIEF).fit(X, y)
    assert network.model_ != ROBOT
    assert differ(network, X, tmp_path) < 1e-12


@pytest.mark.parametrize("activation", ["relu", "silu", "sigmoid", "identity"])
def test_every_activation(activation, tmp_path):
    X, y = robot_records()
    options = {**BRIEF, "module__activation": activation, "module__layers": 1}
    assert differ(PGNNLRegressor(ROBOT, **options).fit(X, y), X, tmp_path) < 1e-12


@pytest.mark.parametrize("structure", ["output", "correction"])
def test_a_recurrent_core(structure, tmp_path):
    X, y = robot_records()
    network = PGNNLRegressor(ROBOT, structure=structure, module=Recurrent, **BRIEF).fit(X, y)
    assert differ(network, X, tmp_path) < 1e-12


@pytest.mark.slow
def test_a_hundred_thousand_steps_of_a_trained_network(tmp_path):
    X, y = robot_records()
    network = PGNNLRegressor(ROBOT, max_epochs=20, refine_max_iter=20).fit(X, y)
    long, _ = robot_records(100_000)
    assert network.score(*robot_records(5000)) > 0.99
    assert differ(network, long, tmp_path) < 1e-12
    assert 1e-9 < differ(network, X, tmp_path, precision="single") < 1e-4


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("guide", ["simulation", "step"])
def test_late_inputs_held_and_straight_ones(hold, guide, tmp_path):
    late = CART + effects.InputDelay("force", 0.04)
    X, y = records(late, 1000, 3.0)
    network = PGNNLRegressor(late, guide=guide, hold=hold, structure="increment", **BRIEF)
    assert differ(network.fit(X, y), X, tmp_path) < 1e-12


def test_further_columns_and_a_network_of_a_pipeline(tmp_path):
    X, y = robot_records()
    X = X.assign(temperature=np.cos(X["t"]))
    pipeline = make_pgnn_pipeline(ROBOT, guide="simulation", **BRIEF).fit(X, y)
    network, table = pipeline[-1], pipeline[:-1].transform(X)
    assert list(network.further_columns_) == ["temperature"]
    assert differ(network, table, tmp_path) < 1e-9  # the line that a scaler is, is estimated


def test_a_plain_network_without_a_model(tmp_path):
    X, y = robot_records()
    network = PGNNLRegressor(states=["phi", "omega"], **BRIEF).fit(X, y)
    model = network.model_
    x0 = X[["phi", "omega"]].to_numpy()[0]
    text = to_c(network, name="net")
    found = run_c(text, tmp_path, "net", model, X["torque"], x0=x0)[1]
    expected = network.predict(X).reshape(len(X), -1)
    assert np.abs(found - expected).max() < 1e-12 * np.ptp(expected)


def test_states_out_of_reach_are_kept_as_in_python(tmp_path):
    X, y = robot_records()
    network = PGNNLRegressor(ROBOT, structure="increment", guide=None, **BRIEF).fit(X, y)
    network.step_ = replace(network.step_, reach=network.step_.reach * 3e-4)
    with pytest.warns(RuntimeWarning, match="exceeded 1000 times the range"):
        assert differ(network, X, tmp_path) < 1e-12


class Own(nn.Linear):
    """A core of one's own."""

    def __init__(self, n_inputs=1, n_outputs=1):
        super().__init__(n_inputs, n_outputs)


def test_what_cannot_be_exported_says_why():
    X, y = robot_records()
    own = PGNNLRegressor(ROBOT, module=Own, max_epochs=1, refine=None, guide=None).fit(X, y)
    with pytest.raises(ModelError, match=r"core Own has no form.*module=FeedForward"):
        to_c(own)
    rows = PGNNLRegressor(max_epochs=1).fit(np.eye(20, 2), np.arange(20.0))
    with pytest.raises(ModelError, match="trained on trajectories"):
        to_c(rows)
    with pytest.raises(OptionError, match="it is fixed by the training of the network"):
        to_c(own, hold="foh")
    with pytest.raises(OptionError, match=r"pipeline\[-1\]"):
        to_c(make_pgnn_pipeline(ROBOT))
