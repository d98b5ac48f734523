"""A warning where a diagnosis re-tuned parameters as far as their spreads let it."""

import warnings

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_spread_ends

#: this many parameters at the ends of their spreads are no coincidence, and cause a warning
SEVERAL = 2


def warn_of_spreads(prior: PhysicsModel, retuned: PhysicsModel) -> None:
    """Warn if several parameters ended at the limits of their spreads.

    Parameters
    ----------
    prior, retuned : PhysicsModel
        See `at_spread_ends`; re-tuned together with the named causes, since the parameters of a
        model without a cause may be distorted by what the cause explains.
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
