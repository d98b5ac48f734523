"""Plain data as strict JSON, which every reader takes."""

import json
import math
from collections.abc import Mapping


def as_strict_json(data: Mapping) -> str:
    """Return plain data as strict JSON; null where a number is not finite.

    Parameters
    ----------
    data : mapping
        Texts, numbers and containers of both, of NumPy as well.

    Returns
    -------
    str
        The text, with an end of line.

    Examples
    --------
    >>> print(as_strict_json({"free_run": float("inf")}), end="")
    {
      "free_run": null
    }
    """
    return json.dumps(finite(data), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def finite(value):
    """Return plain data with None in the place of every number that is not finite.

    Parameters
    ----------
    value : mapping, sequence, number or str
        The data.

    Returns
    -------
    dict, list, number, str or None
        What JSON holds and gives back unchanged.

    Examples
    --------
    >>> finite({"low": (1.0, float("nan"))})
    {'low': [1.0, None]}
    """
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
