"""A warning where a diagnosis re-tuned parameters as far as their spreads let it."""

import warnings

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_spread_ends

#: so many parameters at the ends of their spreads are no chance, and are told
SEVERAL = 2


def warn_of_spreads(prior: PhysicsModel, retuned: PhysicsModel) -> None:
    """Warn where several parameters went to the ends of their spreads.

    Parameters
    ----------
    prior, retuned : PhysicsModel
        See `at_spread_ends`; re-tuned beside the named causes, for what a cause explains may bend
        the parameters of a model without it.
    """
    names = at_spread_ends(prior, retuned)
    if len(names) < SEVERAL:
        return
    warnings.warn(
        f"the diagnosis re-tuned {', '.join(names[:-1])} and {names[-1]} to the ends of their "
        f"spreads, within which a prior's parameters count as known, whatever cause it named "
        f"beside them; the recipe fits them between their bounds. What it named may stand for "
        f"wrong numbers. Remedy: give the spread of parameters that nobody has measured, "
        f"Parameter(..., spread=inf) where nothing is known of them.",
        UserWarning,
        stacklevel=5,
    )
