"""The parameters of a model that are trained with the network, within their spread."""

from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import parameter_units
from sklearn_pgnn.simulation.uncertainty import Estimate

#: every parameter of the model that is not fixed
ALL = "all"
#: a parameter this close to the end of its range, as a share of the range, is at its end
AT_THE_END = 1e-6


@dataclass(frozen=True)
class FreeParameters:
    """Parameters as relative changes from their values at the start of the training.

    `unit` is the change that a relative change of 1 stands for; `low` and `high` are the least and
    largest relative change. All have shape (n_free,).
    """

    names: tuple[str, ...]
    start: np.ndarray
    unit: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, prior: PhysicsModel, start: PhysicsModel, names) -> "FreeParameters":
        """Let parameters vary as far as the prior's spread and bounds allow.

        `prior` defines spread and bounds, `start` the initial values.
        """
        names = tuple(names)
        given = [prior.parameters[name] for name in names]
        now = np.array([start.parameters[name].value for name in names])
        unit = parameter_units(start, names)
        low = np.array([max(p.bounds[0], p.value - p.reach) for p in given])
        high = np.array([min(p.bounds[1], p.value + p.reach) for p in given])
        return cls(names, now, unit, (low - now) / unit, (high - now) / unit)

    def values(self, changes) -> dict:
        """Return the parameters' values by name, as numbers or tensors like the changes.

        The changes are relative, of shape (..., n_free).
        """
        known = zip(self.names, self.start.tolist(), self.unit.tolist(), strict=True)
        return {name: a + b * changes[..., i] for i, (name, a, b) in enumerate(known)}

    def estimates(self, model: PhysicsModel, changes, reach) -> dict[str, Estimate]:
        """Return the parameters' values with intervals, kept within their range.

        `reach` is half the width of the intervals of the relative changes.
        """
        ends = np.clip(changes - reach, self.low, self.high), changes, changes + reach
        low, value, high = (self.values(np.minimum(each, self.high)) for each in ends)
        return {
            name: Estimate(
                float(value[name]), float(low[name]), float(high[name]), model.parameters[name].unit
            )
            for name in self.names
        }

    def at_the_end(self, changes: np.ndarray) -> list[str]:
        """Name the parameters that ended at a limit of their range."""
        near = np.minimum(changes - self.low, self.high - changes)
        reached = near <= AT_THE_END * np.minimum(self.high - self.low, 1.0)
        return [name for name, is_at in zip(self.names, reached, strict=True) if is_at]


def names_of(model: PhysicsModel | None, free) -> tuple[str, ...]:
    """Read the parameter ``free``.

    It is None for no parameter, ``"all"``, or names.

    Examples
    --------
    >>> from sklearn_pgnn import systems
    >>> names_of(systems.cart_on_spring(), ["d", "k"])
    ('d', 'k')
    """
    if free is None:
        return ()
    if model is None:
        raise ValueError(f"free={free!r} needs a model, got none. Remedy: give model=.")
    if isinstance(free, str):
        if free == ALL:
            return tuple(model.free_parameters)
        raise ValueError(
            f"free: expected {ALL!r}, or a sequence of parameters among "
            f"{', '.join(model.parameters)}, got {free!r}. Remedy: free=[{free!r}]."
        )
    unknown = [name for name in free if name not in model.parameters]
    if unknown:
        raise ValueError(
            f"free: expected parameters among {', '.join(model.parameters)}, got {unknown[0]!r}."
        )
    return tuple(free)
