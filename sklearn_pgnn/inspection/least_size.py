"""The smallest size at which an effect would be named, in words."""

from sklearn_pgnn.experiment_design.detectability import Detectable
from sklearn_pgnn.inspection.numbers import number, typeset_unit


def least_size(row: Detectable, digits: int = 2) -> str:
    """Return the smallest size with its unit, and whether none smaller was tried."""
    size = f"{number(row.smallest, digits)} {typeset_unit(row.unit)}".rstrip()
    return f"{size} (smallest tried)" if row.is_least_tried else size
