"""The range in which a fit may move a parameter."""

import math

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.window_fit import ParameterPrior


def freedom_of(model: PhysicsModel, name: str, within_spread: bool) -> ParameterPrior:
    r"""Let a parameter vary between its bounds, or within its spread.

    The variance of a uniform distribution within :math:`\pm r` is :math:`r^2/3`.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": {"value": 2.0, "spread": 0.25}})
    >>> near = freedom_of(lag, "T", within_spread=True)
    >>> near.low, near.high, freedom_of(lag, "T", within_spread=False).high
    (1.5, 2.5, inf)
    """
    parameter = model.parameters[name]
    value, (low, high), reach = parameter.value, parameter.bounds, parameter.reach
    if not within_spread or not math.isfinite(reach):
        return ParameterPrior(name, low, high, value, math.inf, abs(value) or 1.0)
    low, high = max(low, value - reach), min(high, value + reach)
    return ParameterPrior(name, low, high, value, reach / math.sqrt(3.0), reach)
