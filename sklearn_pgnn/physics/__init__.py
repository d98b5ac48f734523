"""Physical models: parameters, models, effects and ready systems."""

from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.port import Port

__all__ = ["Effect", "Parameter", "PhysicsModel", "Port"]
