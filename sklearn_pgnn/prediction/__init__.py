"""How sure a prediction is: intervals of any estimator's free runs."""

from sklearn_pgnn.prediction.conformal_regressor import ConformalRegressor

__all__ = ["ConformalRegressor"]
