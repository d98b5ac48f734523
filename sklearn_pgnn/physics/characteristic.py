"""The curve that shows an effect: which quantity is plotted, and over which."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.expressions import TIME

#: quantities that may be plotted, see `Characteristic`
SHOWN = ("force", "rate", "input", "output", "parameter")


@dataclass(frozen=True)
class Characteristic:
    """The curve that shows an effect, as data; `sklearn_pgnn.inspection` plots it.

    Parameters
    ----------
    shows : {"force", "rate", "input", "output", "parameter"}
        Quantity that is plotted: the force (or, without an inertia, the rate) that is missing from
        a state's equation without the effect; a state's rate; an input as it acts on the machine;
        the excess of an output; the value that a parameter would need.
    of : str
        The state, input, output or parameter.
    over : sympy.Expr, optional
        Abscissa, an expression of states, inputs, parameters and the time. By default the same
        quantity without the effect: the rate without a limit, the commanded input, the output
        as simulated; for a parameter, the missing rate is plotted over what its new value adds.
        Inputs and outputs may be plotted over the time instead.
    period : sympy.Expr, optional
        Period that `over` is reduced by (modulo).
    law : sympy.Expr, optional
        Value of a parameter that is plotted over another quantity.
    unit : str, default=""
        Unit of `over` if it is not a quantity of the model.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import CoulombFriction
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> CoulombFriction("v").characteristic(cart_on_spring() + CoulombFriction("v"))
    Characteristic(shows='force', of='v', over=v, period=None, law=None, unit='')
    """

    shows: str
    of: str
    over: sympy.Expr | None = None
    period: sympy.Expr | None = None
    law: sympy.Expr | None = None
    unit: str = ""

    def __post_init__(self) -> None:
        if self.shows not in SHOWN:
            raise ValueError(f"shows: expected one of {', '.join(SHOWN)}, got {self.shows!r}.")
        if self.shows == "force" and self.over is None:
            raise ValueError("over: expected what the force is plotted over, got None.")
        if self.shows == "rate" and self.over is not None:
            raise ValueError(
                f"over: expected None, since a rate is plotted over the rate without the effect, "
                f"got {self.over}."
            )
        if self.shows in ("input", "output") and self.over not in (None, TIME):
            raise ValueError(f"over: expected None or the time t, got {self.over}.")
        if self.shows == "parameter" and (self.over is None) != (self.law is None):
            raise ValueError("law: expected the parameter's value in what it is plotted over.")
