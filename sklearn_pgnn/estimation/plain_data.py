"""Results as plain data, as JSON holds it."""

import math
from dataclasses import asdict


def plain(value) -> dict:
    """Return a result as what JSON holds; a number that is not finite becomes None.

    Parameters
    ----------
    value : dataclass or NamedTuple
        The result.

    Returns
    -------
    dict
        Its fields.

    Examples
    --------
    >>> from sklearn_pgnn.estimation.candidate import Candidate
    >>> plain(Candidate("coulomb_friction", "v"))
    {'effect': 'coulomb_friction', 'target': 'v'}
    """
    items = value._asdict() if hasattr(value, "_asdict") else asdict(value)
    return {
        key: None if isinstance(item, float) and not math.isfinite(item) else item
        for key, item in items.items()
    }
