"""Choosing among models: splits by trajectory, search spaces, and the Pareto front."""

from sklearn_pgnn.model_selection.halving_bayes_search import HalvingBayesSearchCV
from sklearn_pgnn.model_selection.pareto_front import pareto_front
from sklearn_pgnn.model_selection.search_space import search_space
from sklearn_pgnn.model_selection.trajectory_k_fold import TrajectoryKFold
from sklearn_pgnn.model_selection.trajectory_rows import train_validation_test_split

__all__ = [
    "HalvingBayesSearchCV",
    "TrajectoryKFold",
    "pareto_front",
    "search_space",
    "train_validation_test_split",
]
