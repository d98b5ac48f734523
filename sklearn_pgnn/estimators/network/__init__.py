"""The network of `PGNNLRegressor`: its cores and the terms of its physical loss."""

from sklearn_pgnn.extras import needed_by

with needed_by("The network of PGNNLRegressor"):
    from sklearn_pgnn.estimators.network.cores import FeedForward, Recurrent
    from sklearn_pgnn.estimators.network.physics_loss import (
        Bounds,
        EnergyBalance,
        Passivity,
        PhysicsTerm,
        RateBounds,
    )

__all__ = [
    "Bounds",
    "EnergyBalance",
    "FeedForward",
    "Passivity",
    "PhysicsTerm",
    "RateBounds",
    "Recurrent",
]
