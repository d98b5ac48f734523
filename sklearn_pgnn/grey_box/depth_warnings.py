"""Warnings of depths that are missing, that cannot be trained, or that predict nothing."""

from sklearn_pgnn.grey_box.possible_depths import NETWORKS
from sklearn_pgnn.user_line import warn_user


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
