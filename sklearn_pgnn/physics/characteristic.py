"""The curve by which a person sees an effect: what is drawn, and over what."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.expressions import TIME

#: what may be drawn, see `Characteristic`
SHOWN = ("force", "rate", "input", "output", "parameter")


@dataclass(frozen=True)
class Characteristic:
    """What a person would draw of an effect, as data; `sklearn_pgnn.inspection` draws it.

    Parameters
    ----------
    shows : {"force", "rate", "input", "output", "parameter"}
        What is drawn: the force (or, without an inertia, the rate) that a state's equation lacks
        without the effect; a state's rate; an input as the machine feels it; what an output shows
        too much; the value that a parameter would have to have.
    of : str
        The state, input, output or parameter.
    over : sympy.Expr, optional
        What it is drawn over, an expression of states, inputs, parameters and the time. By default
        over itself without the effect: the rate without a limit, the commanded input, the output
        as simulated; of a parameter, what is missing over what its new value adds.
        Inputs and outputs may be drawn over the time instead.
    period : sympy.Expr, optional
        What `over` is taken modulo.
    law : sympy.Expr, optional
        The value of a parameter that is drawn over something else.
    unit : str, default=""
        Unit of `over` where it is no quantity of the model.

    Raises
    ------
    ValueError
        If `shows` is none of these, or is not drawn over that.

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

    def __post_init__(self):
        if self.shows not in SHOWN:
            raise ValueError(f"shows: expected one of {', '.join(SHOWN)}, got {self.shows!r}.")
        if self.shows == "force" and self.over is None:
            raise ValueError("over: expected what the force is drawn over, got None.")
        if self.shows == "rate" and self.over is not None:
            raise ValueError(f"over: a rate is drawn over itself, got {self.over}.")
        if self.shows in ("input", "output") and self.over not in (None, TIME):
            raise ValueError(f"over: expected None or the time t, got {self.over}.")
        if self.shows == "parameter" and (self.over is None) != (self.law is None):
            raise ValueError("law: expected the parameter's value in what it is drawn over.")
