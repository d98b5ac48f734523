"""Choosing among models: splits by trajectory, search spaces, and the Pareto front."""

from sklearn_pgnn.model_selection.pareto_front import pareto_front
from sklearn_pgnn.model_selection.search_space import search_space
from sklearn_pgnn.model_selection.three_parts import train_validation_test_split
from sklearn_pgnn.model_selection.trajectory_split import TrajectorySplit

__all__ = ["TrajectorySplit", "pareto_front", "search_space", "train_validation_test_split"]
