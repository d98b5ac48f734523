"""A parameter: a number with a unit, bounds and a flag for re-tuning."""

import keyword
import math
from dataclasses import dataclass, replace
from typing import NoReturn

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import RESERVED

#: default spread within which a parameter counts as calibrated
DEFAULT_SPREAD = 0.1
#: longest name of a quantity [characters]
MAX_NAME = 100


def check_name(name: str, what: str) -> None:
    """Raise `ModelError` unless `name` is a valid name of a quantity in an equation."""
    where = (f"{what}s", name)
    if isinstance(name, str) and len(name) > MAX_NAME:
        raise ModelError(
            f"{what} {name[:20]!r} ...: expected a name of at most {MAX_NAME} characters, got "
            f"{len(name)}.",
            where,
        )
    if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
        raise ModelError(
            f"{what} {name!r} is not a name; use letters, digits and underscores.", where
        )
    if name in RESERVED or name.startswith("_"):
        raise ModelError(f"{what} {name!r} is reserved; choose another name.", where)


@dataclass(frozen=True)
class Parameter:
    """A named constant of a model.

    Parameters
    ----------
    name : str
        Name used in the equations.
    value : float
        Prior value, in `unit`.
    unit : str, default=""
        Physical unit, e.g. ``"kg m^2"``.
    bounds : tuple of float, default=(-inf, inf)
        Values the parameter may take.
    fixed : bool, default=False
        Whether the value is known and never re-tuned.
    spread : float, default=0.1
        Largest deviation of the true value from `value`, as a fraction of `value`, at which the
        parameter still counts as calibrated: all values within are equally likely, values beyond
        are not. A diagnosis re-tunes within the spread, never further, and names
        `wrong_parameter` where the records call for more. A fraction of 0 is 0: a parameter of
        value 0 stays 0 unless it is wrong. With ``inf`` only the bounds apply.

    Raises
    ------
    ModelError
        If the name is not an identifier, or the value is not finite or lies outside its bounds.

    Examples
    --------
    >>> Parameter("J", 0.1445, unit="kg m^2", bounds=(0.01, 1)).value
    0.1445
    """

    name: str
    value: float
    unit: str = ""
    bounds: tuple[float, float] = (-math.inf, math.inf)
    fixed: bool = False
    spread: float = DEFAULT_SPREAD

    def __post_init__(self) -> None:
        check_name(self.name, "parameter")
        try:
            low, high = map(float, self.bounds)
            value, spread = float(self.value), float(self.spread)
        except (TypeError, ValueError):
            self._refuse(
                "expected numbers for value, spread and bounds [low, high], "
                f"got {self.value!r}, {self.spread!r} and {self.bounds!r}"
            )
        if not math.isfinite(value):
            self._refuse(f"expected a finite value, got {value}")
        if not low <= value <= high:
            self._refuse(
                f"expected a value within its bounds [{low:.9g}, {high:.9g}], got {value:.9g}"
            )
        if not spread > 0:
            self._refuse(f"expected a spread > 0, got {spread:g}")
        if not isinstance(self.fixed, bool):
            self._refuse(f"expected true or false for fixed, got {self.fixed!r}")
        object.__setattr__(self, "unit", str(self.unit or ""))
        object.__setattr__(self, "value", value)
        object.__setattr__(self, "spread", spread)
        object.__setattr__(self, "bounds", (low, high))

    def _refuse(self, why: str) -> NoReturn:
        raise ModelError(f"parameter {self.name!r}: {why}.", ("parameters", self.name)) from None

    @property
    def reach(self) -> float:
        """Largest deviation of the true value from `value` within the spread, in `unit`."""
        return math.inf if self.spread == math.inf else abs(self.value) * self.spread

    def with_value(self, value: float) -> "Parameter":
        """Return the same parameter with another value.

        Parameters
        ----------
        value : float
            The new value, in `unit`.

        Returns
        -------
        Parameter
            A new parameter; this one is unchanged.
        """
        value, (low, high) = float(value), self.bounds
        if not (math.isfinite(value) and low <= value <= high):
            return replace(self, value=value)  # which says why it cannot be
        new = object.__new__(type(self))  # every step of a fit comes here: nothing else is checked
        new.__dict__.update(self.__dict__, value=value)
        return new

    def with_spread(self, spread: float) -> "Parameter":
        """Return the same parameter with another spread.

        Parameters
        ----------
        spread : float
            The new spread, as a fraction of the value.

        Returns
        -------
        Parameter
            A new parameter; this one is unchanged.
        """
        return replace(self, spread=float(spread))


def by_name(*parameters: Parameter) -> dict[str, Parameter]:
    """Return parameters by their names."""
    return {parameter.name: parameter for parameter in parameters}
