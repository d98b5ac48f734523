"""Parameters that were re-tuned to an end of their spread, or to a bound."""

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel


def at_spread_ends(prior: PhysicsModel, retuned: PhysicsModel) -> tuple[str, ...]:
    """Return the parameters that reached an end of their spread before their bounds."""
    return tuple(name for name in prior.free_parameters if _is_at_an_end(name, prior, retuned))


def at_bounds(retuned: PhysicsModel) -> tuple[str, ...]:
    """Return the parameters at a bound of the model file that is not zero.

    Nothing physical ends at such a bound as a friction or a mass does at zero.

    >>> k = {"value": 1.0, "bounds": [0.0, 4.0]}
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(k*u - y)/T"}, {"T": 2.0, "k": k}, {"u": "V"})
    >>> at_bounds(lag), at_bounds(lag.with_parameters(k=4.0)), at_bounds(lag.with_parameters(k=0.0))
    ((), ('k',), ())
    """
    free = ((name, retuned.parameters[name]) for name in retuned.free_parameters)
    return tuple(n for n, p in free if p.value and np.isclose(p.value, p.bounds, 1e-6, 0.0).any())


def _is_at_an_end(name: str, prior: PhysicsModel, retuned: PhysicsModel) -> bool:
    parameter, value = prior.parameters[name], retuned.parameters[name].value
    if not 0 < parameter.reach < np.inf:
        return False
    low, high = parameter.bounds
    ends = [parameter.value - parameter.reach, parameter.value + parameter.reach]
    near = np.isclose(value, ends, rtol=0.0, atol=1e-6 * parameter.reach)
    return bool((near & [low < ends[0], ends[1] < high]).any())
