"""Estimators with scikit-learn's interface."""

from sklearn_pgnn.estimators.physics_model_regressor import PhysicsModelRegressor
from sklearn_pgnn.estimators.residual_regressor import ResidualRegressor

__all__ = ["PhysicsModelRegressor", "ResidualRegressor"]
