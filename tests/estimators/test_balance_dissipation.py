"""A balance with a dissipation of its own, whose parameters are trained with the network."""

import copy
import pickle

import numpy as np
import pytest
from braked_cart import CART, QUICK, records

from sklearn_pgnn import PGNNLRegressor
from sklearn_pgnn.network import EnergyBalance

OWN = EnergyBalance(dissipated="d*v**2 + c*abs(v)**3", parameters={"c": 0.1})
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
