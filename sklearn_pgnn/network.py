"""The network of `PGNNLRegressor`: its cores and the terms of its physical loss."""

from sklearn_pgnn.estimators.network import *  # noqa: F403 - a part is listed once, there
from sklearn_pgnn.estimators.network import __all__ as __all__
