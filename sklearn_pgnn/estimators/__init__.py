"""Estimators with scikit-learn's interface."""

from sklearn_pgnn.estimators.physics_model_regressor import PhysicsModelRegressor

__all__ = ["PhysicsModelRegressor"]
