"""The parameters of the recipe: its depths, its default parts, and what can be checked of them."""

from numbers import Integral, Real

from sklearn.base import clone
from sklearn.utils.validation import check_memory

from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.diagnosis.options import check_time_limit
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.extras import is_installed, needed_by
from sklearn_pgnn.grey_box.folds import WAYS
from sklearn_pgnn.model_selection.outer_estimator import parameters_named
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.validation import check_model

#: from the shallowest to the deepest
DEPTHS = ("prior", "fitted", "extended", "formula", "state_network", "network")
NETWORKS = DEPTHS[-2:]
#: the depths that need a diagnosis
DIAGNOSED = DEPTHS[2:4]


def possible_depths(network) -> tuple[str, ...]:
    """Return all depths that can be tried with a network, by default the usual one."""
    if network is None and not is_installed("network"):
        return DEPTHS[: -len(NETWORKS)]
    return tuple(d for d in DEPTHS if d != "state_network" or can_see_less(network))


def can_see_less(network) -> bool:
    """Return whether a network, by default PGNNL, can be restricted to seeing the states only."""
    if network is None:
        return True
    seen = parameters_named(network, "sees").values()
    return bool(seen) and all(each is None for each in seen)


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


def check_options(recipe) -> tuple[str, ...]:
    """Check the parameters of a recipe, and return its depths in their order."""
    check_model(recipe.model)
    check_time_limit(recipe.time_limit)
    check_memory(recipe.memory)
    _check_cross_validation(recipe)
    depths = possible_depths(recipe.network) if recipe.depths is None else recipe.depths
    _check_depths(depths, recipe.depths)
    _check_network(recipe.network, depths)
    return tuple(depth for depth in DEPTHS if depth in depths)


def _check_cross_validation(recipe) -> None:
    if recipe.by not in WAYS:
        raise OptionError(f"by: expected one of {', '.join(WAYS)}, got {recipe.by!r}.")
    for name, least in (("n_splits", 2), ("initial_window", 0)):
        value = getattr(recipe, name)
        if not isinstance(value, Integral) or value < least:
            raise OptionError(f"{name}: expected an integer >= {least}, got {value!r}.")
    if not isinstance(recipe.least_gain, Real) or not float(recipe.least_gain) >= 0:
        raise OptionError(f"least_gain: expected a share >= 0, got {recipe.least_gain!r}.")


def _check_depths(depths, given) -> None:
    wrong = [depth for depth in depths if depth not in DEPTHS]
    if wrong or isinstance(depths, str) or not set(depths) - set(NETWORKS):
        raise OptionError(
            f"depths: expected some of {', '.join(DEPTHS)}, one at least besides the networks, got "
            f"{given!r}."
        )


def _check_network(network, depths) -> None:
    if network is not None and not parameters_named(network, "model"):
        raise OptionError(
            f"network: expected a regressor with a parameter 'model', itself or in what it "
            f"contains, got {network!r}. Remedy: ResidualRegressor(model, regressor)."
        )
    if "state_network" in depths and not can_see_less(network):
        raise OptionError(
            f"depths: 'state_network' expects a network whose parameter 'sees' is None, got "
            f"{network!r}. Remedy: network=PGNNLRegressor(), or depths without it."
        )
