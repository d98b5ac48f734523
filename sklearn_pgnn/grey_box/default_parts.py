"""The diagnosis and the network of a recipe, where the user gives none."""

from sklearn.base import clone

from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.grey_box.possible_depths import NETWORKS
from sklearn_pgnn.model_selection.outer_estimator import parameters_named
from sklearn_pgnn.physics.model import PhysicsModel


def diagnosis_or_default(diagnosis, model: PhysicsModel) -> ModelDiagnosis:
    """Return a diagnosis, by default one of the model with the usual settings."""
    return ModelDiagnosis(model) if diagnosis is None else diagnosis


def network_or_default(network):
    """Return a network, by default a `PGNNLRegressor`."""
    if network is not None:
        return network
    with needed_by("the depths 'state_network' and 'network'"):
        from sklearn_pgnn.estimators.pgnnl import PGNNLRegressor
    return PGNNLRegressor()


def network_as_trained(network, model: PhysicsModel, depths):
    """Return a copy of the network with the prior as its model; None if no depth trains one."""
    if depths is not None and not set(NETWORKS) & set(depths):
        return None
    trained = clone(network_or_default(network))
    return trained.set_params(**dict.fromkeys(parameters_named(trained, "model"), model))
