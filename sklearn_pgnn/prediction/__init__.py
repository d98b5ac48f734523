"""Uncertainty of predictions: intervals of any estimator's free runs, and ensembles."""

from sklearn_pgnn.prediction.conformal_regressor import ConformalRegressor
from sklearn_pgnn.prediction.ensemble_regressor import EnsembleRegressor

__all__ = ["ConformalRegressor", "EnsembleRegressor"]
