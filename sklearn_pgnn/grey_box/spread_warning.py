"""A warning where a diagnosis re-tuned parameters as far as their spreads let it."""

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_spread_ends
from sklearn_pgnn.user_line import warn_user

#: this many parameters at the ends of their spreads are no coincidence, and cause a warning
SEVERAL = 2


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
