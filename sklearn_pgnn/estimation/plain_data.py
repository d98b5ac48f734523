"""Results as plain data, as JSON holds it."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any


def plain(value: Any) -> dict:
    """Return a dataclass or NamedTuple as what JSON holds; a number that is not finite is None."""
    return finite(value._asdict() if hasattr(value, "_asdict") else asdict(value))


def finite(value: Any) -> Any:
    """Return plain data with None in the place of every number that is not finite."""
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
