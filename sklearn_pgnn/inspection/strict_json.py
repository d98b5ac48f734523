"""Plain data as strict JSON, which every parser accepts."""

import json
from collections.abc import Mapping

from sklearn_pgnn.estimation.plain_data import finite


def as_strict_json(data: Mapping) -> str:
    """Return plain data as strict JSON; null where a number is not finite.

    Examples
    --------
    >>> print(as_strict_json({"free_run": float("inf")}), end="")
    {
      "free_run": null
    }
    """
    return json.dumps(finite(data), indent=2, allow_nan=False, ensure_ascii=False) + "\n"
