"""Ways out: models and networks in the languages of other tools."""

from sklearn_pgnn.export.c import to_c

__all__ = ["to_c"]
