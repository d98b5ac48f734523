"""Records made for trying things out: simulated rigs, and machines that hide an effect."""

from sklearn_pgnn.datasets.hidden_effect import HiddenEffect, make_hidden_effect

__all__ = ["HiddenEffect", "make_hidden_effect"]
