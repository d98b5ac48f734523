"""The parameters of the recipe, as far as they can be checked without records."""

from numbers import Integral, Real

from sklearn.utils.validation import check_memory

from sklearn_pgnn.diagnosis.options import check_time_limit
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.grey_box.hidden_parts import WAYS
from sklearn_pgnn.grey_box.possible_depths import DEPTHS, NETWORKS, can_see_less, possible_depths
from sklearn_pgnn.model_selection.outer_estimator import parameters_named
from sklearn_pgnn.trajectories.validation import check_model


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
