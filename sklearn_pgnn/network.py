"""The network of `PGNNLRegressor`: its cores and the terms of its physical loss."""

from sklearn_pgnn.estimators.network import (
    Bounds,
    EnergyBalance,
    FeedForward,
    Passivity,
    PhysicsTerm,
    RateBounds,
    Recurrent,
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
