"""The parameters of the recipe: its depths, default parts, what is refused and warned of."""

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
from sklearn_pgnn.physics.spread_ends import at_spread_ends
from sklearn_pgnn.trajectories.validation import check_model
from sklearn_pgnn.user_line import warn_user

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


#: this many parameters at the ends of their spreads are no coincidence, and cause a warning
SEVERAL = 2


def warn_of_no_finding(depths: tuple[str, ...]) -> None:
    """Warn that the diagnosis has no model for any of the physical depths."""
    asked = ", ".join(depth for depth in depths if depth not in NETWORKS)
    warn_user(
        f"depths: the diagnosis has nothing for {asked}; the depth 'fitted' is taken instead. "
        f"Remedy: depths={('fitted', *depths)!r}."
    )


def warn_of_training(error, depth: str, base: str) -> None:
    """Warn that a network is left out."""
    warn_user(
        f"depth {depth!r}: {error} This depth is skipped; the best depth without a network is "
        f"{base!r}. Remedy: network=PGNNLRegressor(lr=0.003, horizon=20), or depths without "
        f"{depth!r}."
    )


def warn_if_useless(depth: str, error: float) -> None:
    """Warn if the chosen depth is no nearer to hidden parts than the outputs' mean."""
    if error < 1.0:
        return
    warn_user(
        f"no depth predicts the hidden parts of the records better than the mean of the outputs: "
        f"the error of the chosen one, {depth!r}, is {error:.3g} standard deviations. Remedy: "
        f"check the model's equations, units and parameters (`sklearn-pgnn check`), and that its "
        f"free run does not diverge."
    )


def warn_of_spreads(prior: PhysicsModel, retuned: PhysicsModel) -> None:
    """Warn if several parameters ended at the limits of their spreads."""
    names = at_spread_ends(prior, retuned)
    if len(names) < SEVERAL:
        return
    warn_user(
        f"the diagnosis re-tuned {', '.join(names[:-1])} and {names[-1]} to the limits of their "
        f"spreads. The named causes may compensate for wrong parameter values. Remedy: widen the "
        f"spread of parameters that were not measured, Parameter(..., spread=inf) for unknown "
        f"ones. (The fits of GreyBoxRegressor use the bounds, not the spreads.)"
    )
