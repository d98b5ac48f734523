"""structure="dissipative": a network that can only take energy out of the model's states."""

import copy
import pickle

import braked_cart
import numpy as np
import pandas as pd
import pytest
from braked_cart import CART, records
from sklearn.base import clone

from sklearn_pgnn import PGNNLRegressor
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.export import to_c
from sklearn_pgnn.network import Recurrent

DRIVEN = CART.replace(equations={"x": "v", "v": "(force + 0.3*v - k*x)/m"})
QUICK = {"structure": "dissipative", **braked_cart.QUICK}
X, Y = records()
NEW, NEW_Y = records(n=2, seed=9)


def rms(error):
    return float(np.sqrt(np.mean(np.square(error))))


@pytest.fixture(scope="module")
def net():
    return PGNNLRegressor(CART, **QUICK).fit(X, Y)


@pytest.mark.slow
def test_a_lost_power_is_learnt(net):
    without = rms(CART.simulate(NEW["t"][:150], NEW["force"][:150], [0, 0]).y - NEW_Y[:150])
    assert rms(net.predict(NEW) - NEW_Y) < 0.05 * without


def test_it_only_slows_down(net):
    t = 0.05 * np.arange(400)
    X = pd.DataFrame({"trajectory": 0, "t": t, "force": 0.0, "x": 0.0, "v": 8.0})
    x = net.predict_states(X)
    energy = x[:, 1] ** 2 / 2 + 2 * x[:, 0] ** 2
    assert np.all(np.diff(energy) <= 1e-6 * energy[0])
    assert energy[-1] < 1e-2 * energy[0]


@pytest.mark.slow
def test_what_drives_is_not_learnt_but_does_no_harm():
    given, y = records(DRIVEN)
    net = PGNNLRegressor(CART, **QUICK).fit(given, y)
    alone = np.concatenate(
        [CART.simulate(r["t"], r["force"], [0, 0]).y for _, r in given.groupby("trajectory")]
    )
    assert rms(net.predict(given) - alone) < 0.3 * rms(alone - y)


def test_it_survives_copies(net):
    for again in (copy.deepcopy(net), pickle.loads(pickle.dumps(net))):
        assert np.array_equal(again.predict(NEW), net.predict(NEW))
    assert clone(net).get_params()["structure"] == "dissipative"


def test_step_by_step_it_is_the_free_run(net):
    stepper = net.stepper(x0=[0.0, 0.0], interval=0.05)
    run = [stepper.step([force]) for force in NEW["force"][:40]]
    assert np.array(run) == pytest.approx(net.predict(NEW)[1:41], rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_a_few_samples_ahead(net):
    ahead = net.predict_ahead(NEW, NEW_Y, steps=3)
    assert rms(ahead - NEW_Y) < 1.1 * rms(net.predict(NEW) - NEW_Y) + 1e-3


@pytest.mark.slow
def test_parameters_that_measure_no_speed_may_be_free():
    net = PGNNLRegressor(CART.with_parameters(k=4.2), free=["k"], **QUICK).fit(X, Y)
    assert net.parameters_["k"].value == pytest.approx(4.0, rel=0.02)


@pytest.mark.slow
def test_rollouts_and_a_hidden_state():
    options = {**QUICK, "module": Recurrent, "horizon": 5, "rollout_epochs": 2, "max_epochs": 2}
    net = PGNNLRegressor(CART, **options).fit(X, Y)
    assert np.isfinite(net.predict(NEW)).all()


@pytest.mark.slow
def test_it_goes_with_a_balance():
    net = PGNNLRegressor(CART, lambda_phy=0.1, **{**QUICK, "refine_max_iter": 5}).fit(X, Y)
    assert np.isfinite(net.physics_residual(NEW)[1:5]).all()


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        (None, {}, "needs a model"),
        (CART.replace(energy={}), {}, "energy of .* is not known"),
        (CART, {"corrects": ["x"]}, "corrects"),
        (CART.replace(energy={"stored": "k*x**2/2"}), {}, "expected states that the stored energy"),
        (CART.replace(energy={"stored": "v**4"}), {}, "quadratic in v"),
        (CART.replace(energy={"stored": "-m*v**2"}), {}, "makes negative"),
        (CART, {"free": ["m"]}, "would change"),
        (CART, {"guide": "step"}, "guide='step' cannot be combined"),
    ],
)
def test_what_cannot_be_is_refused(model, options, message):
    given = X if model is not None else X[["trajectory", "t", "force"]]
    with pytest.raises(ValueError, match=message):
        PGNNLRegressor(model, **{**QUICK, **options}).fit(given, Y)


def test_export_says_that_it_has_no_form(net):
    with pytest.raises(ModelError, match="structure='dissipative' has no form there"):
        to_c(net)
