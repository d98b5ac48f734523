"""A balance with a dissipation of its own, whose parameters are trained with the network."""

import copy
import pickle

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import PGNNLRegressor, PhysicsModel
from sklearn_pgnn.network import EnergyBalance

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(force - d*v - k*x)/m"},
    {"m": 1.0, "d": 0.2, "k": 4.0},
    {"force": "N"},
    outputs={"x": "x", "v": "v"},
    inertia={"v": "m"},
    energy={"stored": "m*v**2/2 + k*x**2/2", "dissipated": "d*v**2", "supplied": "force*v"},
)
PLANT = CART.replace(equations={"x": "v", "v": "(force - d*v - 0.5*v*abs(v) - k*x)/m"})
QUICK = {"max_epochs": 15, "module__neurons": 4, "refine_max_iter": 40, "substeps": 1}
OWN = EnergyBalance(dissipated="d*v**2 + c*abs(v)**3", parameters={"c": 0.1})


def records(n=3, n_samples=150):
    rng = np.random.default_rng(0)
    frames, outputs = [], []
    for i in range(n):
        t = 0.05 * np.arange(n_samples)
        force = 3 * np.repeat(rng.normal(size=n_samples // 15 + 1), 15)[:n_samples]
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.0, "v": 0.0}))
        outputs.append(PLANT.simulate(t, force, [0.0, 0.0], substeps=4).y)
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


X, Y = records()


@pytest.fixture(scope="module")
def net():
    return PGNNLRegressor(CART, lambda_phy=0.1, physics_loss=OWN, **QUICK).fit(X, Y)


@pytest.mark.slow
def test_the_parameter_is_found(net):
    assert net.dissipation_["c"] == pytest.approx(0.5, rel=0.1)
    assert net.model_.parameters["c"].value == net.dissipation_["c"]
    assert net.parameters_ == {}
    assert "c" not in CART.parameters


@pytest.mark.slow
def test_the_residual_is_that_of_the_trained_balance(net):
    own, priors = (
        np.nanmean(each.physics_residual(X) ** 2)
        for each in (net, PGNNLRegressor(CART, lambda_phy=0.0, **QUICK).fit(X, Y))
    )
    assert own < 0.2 * priors


@pytest.mark.slow
def test_it_survives_copies(net):
    for again in (copy.deepcopy(net), pickle.loads(pickle.dumps(net))):
        assert np.array_equal(again.predict(X), net.predict(X))
        assert np.array_equal(again.physics_residual(X), net.physics_residual(X), equal_nan=True)


def test_it_does_not_become_negative():
    drives = EnergyBalance(dissipated="d*v**2 + 9*v**2 + c*abs(v)**3", parameters={"c": 0.1})
    options = {**QUICK, "refine_max_iter": 5, "max_epochs": 2}
    net = PGNNLRegressor(CART, lambda_phy=0.5, physics_loss=drives, **options).fit(X, Y)
    assert 0 <= net.dissipation_["c"] < 0.1


def test_without_a_weight_nothing_is_trained():
    options = {**QUICK, "refine": None, "max_epochs": 1}
    one = PGNNLRegressor(CART, physics_loss=OWN, **options).fit(X, Y)
    assert one.dissipation_ == {}
    assert np.array_equal(one.predict(X), PGNNLRegressor(CART, **options).fit(X, Y).predict(X))


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (EnergyBalance(parameters={"c": 1.0}), "expected 'dissipated' with c in it, got none"),
        (EnergyBalance(dissipated="d*v**2", parameters={"d": 1.0}), r"free=\['d'\] trains"),
        (EnergyBalance(dissipated="d*v**2 + e"), "'e'"),
        (EnergyBalance(dissipated="c*v", parameters={"c": -1.0}), "within its bounds"),
    ],
)
def test_balances_that_cannot_be(term, message):
    with pytest.raises(ValueError, match=message):
        PGNNLRegressor(CART, lambda_phy=0.1, physics_loss=term, **QUICK).fit(X, Y)
