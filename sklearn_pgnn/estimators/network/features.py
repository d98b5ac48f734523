"""Which rates a network corrects, and which quantities it sees."""

import numpy as np

from sklearn_pgnn.estimators.network.structure import ON_THE_MODEL, corrected_states
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import names_in_terms

#: scale of a feature that the network must not see: divided by it, the feature vanishes
UNSEEN = 1e30


def check_features(model: PhysicsModel, structure, guide, corrects, sees, further=()) -> None:
    """Refuse quantities that a network cannot correct or see.

    `further` are columns that it could see, too.
    """
    own = [list(model.states)[i] for i in corrected_states(model, structure)]
    _check_names("corrects", corrects, own)
    _check_names("sees", sees, (*model.states, *model.inputs, *further))
    if corrects is not None and structure not in ON_THE_MODEL:
        raise ValueError(
            f"corrects={corrects!r} needs structure='correction' or 'dissipative', got "
            f"{structure!r}: any other network has an output for every state. Remedy: "
            f"structure='correction', or corrects=None."
        )
    if sees is not None and guide in ("simulation", "step"):
        raise ValueError(
            f"sees={sees!r} cannot be combined with guide={guide!r}, which depends on all "
            f"quantities. Remedy: guide='terms' or guide=None."
        )


def _check_names(name, given, expected) -> None:
    if given is None:
        return
    if isinstance(given, str) or not list(given) or not set(given) <= set(expected):
        raise ValueError(
            f"{name}: expected a list of names among {', '.join(map(str, expected))}, "
            f"got {given!r}."
        )


def feature_scale(model: PhysicsModel, guide, scale, sees, further) -> np.ndarray:
    """Return the divisors of the features, so large for features not seen that 0 is left.

    `scale`, the standard deviations of the features, has shape (n_features,); with `sees` of None
    all are seen; `further` names the further columns.
    """
    if sees is None:
        return scale
    names = [{name} for name in (*model.states, *model.inputs)]
    names += names_in_terms(model) if guide == "terms" else []
    names += [{name} for name in further]
    return np.where([each <= set(sees) for each in names], scale, UNSEEN)
