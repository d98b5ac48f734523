"""The grey-box recipe: diagnose, fit, learn the rest; its depth is cross-validated."""

from sklearn_pgnn.grey_box.grey_box_regressor import GreyBoxRegressor

__all__ = ["GreyBoxRegressor"]
