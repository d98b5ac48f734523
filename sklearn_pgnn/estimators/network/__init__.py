"""The network of `PGNNLRegressor`: its cores, its step, its losses and its training."""
