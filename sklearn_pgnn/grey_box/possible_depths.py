"""The depths of the recipe, and those that a network allows."""

from sklearn_pgnn.extras import is_installed
from sklearn_pgnn.model_selection.outer_estimator import parameters_named

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
