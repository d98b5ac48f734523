"""Warnings of depths that are missing, cannot be trained or predict nothing, and of spreads."""

from sklearn_pgnn.grey_box.options import NETWORKS
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_spread_ends
from sklearn_pgnn.user_line import warn_user

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
