"""A formula as an effect: terms identified from records."""

import re
from dataclasses import dataclass, replace

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effect import Effect, Symbols
from sklearn_pgnn.physics.expressions import parse_expression
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.places import add_at
from sklearn_pgnn.physics.scales import Scales


def known_part(formula: "Formula", model: PhysicsModel) -> "Formula":
    """Return the part of a formula without the states that only another effect adds.

    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> formula = Formula("v", ("x**2", "force_lagged"), (0.1, 0.2))
    >>> known_part(formula, cart_on_spring()).terms
    ('x**2',)
    """
    pairs = zip(formula.terms, formula.coefficients, strict=True)
    known = [(term, value) for term, value in pairs if _is_known(term, model)]
    terms, coefficients = tuple(term for term, _ in known), tuple(value for _, value in known)
    return replace(formula, terms=terms, coefficients=coefficients)


def _is_known(term: str, model: PhysicsModel) -> bool:
    """Return whether a model has all states and inputs of a term."""
    try:
        parse_expression(term, (*model.states, *model.inputs), "term")
    except ModelError:
        return False
    return True


@dataclass(frozen=True)
class Formula(Effect):
    r"""Terms added to an effort, a rate, an input or output, :math:`\sum_i c_i \theta_i(x, u, t)`.

    It is not a candidate of a diagnosis, but proposed by it where no candidate is adequate.

    Parameters
    ----------
    target : str
        The port whose effort it is added to, the state whose rate, or the input or output.
    terms : tuple of str
        Expressions of states, inputs and ``t``.
    coefficients : tuple of float
        One per term.
    first : int, default=1
        Number of the first coefficient; see `next_number` for a second formula on a target.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    >>> print((lag + Formula("y", ("y**2",), (-0.1,))).to_text())
    y' = c1_y*y**2 - y/T
    """

    terms: tuple[str, ...] = ()
    coefficients: tuple[float, ...] = ()
    first: int = 1
    id = "formula"
    summary = "An effect that is not in the catalogue, described by these terms."
    check = "Plot the missing quantity over those in the formula and find out what acts that way."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of all ports, states, inputs and outputs."""
        names = (*model.states, *model.inputs, *model.outputs, *model.ports)
        return tuple(dict.fromkeys(names))

    @staticmethod
    def next_number(model: PhysicsModel, target: str) -> int:
        """Return the next free number for the coefficients of a target in a model.

        Parameters
        ----------
        model : PhysicsModel
            The model.
        target : str
            The state, input or output.

        Returns
        -------
        int
            The number; 1 if there are no coefficients.

        Examples
        --------
        >>> from sklearn_pgnn.physics.systems import cart_on_spring
        >>> cart = cart_on_spring() + Formula("v", ("x**2", "v**2"), (0.1, 0.2))
        >>> Formula.next_number(cart, "v")
        3
        """
        names = [re.fullmatch(rf"c(\d+)_{re.escape(target)}", name) for name in model.parameters]
        return max((int(name[1]) for name in names if name), default=0) + 1

    def names(self) -> dict[str, str]:
        """Return the names of the coefficients."""
        numbers = range(self.first, self.first + len(self.terms))
        return {f"c{number}": f"c{number}_{self.target}" for number in numbers}

    def parameters(self, model: PhysicsModel) -> tuple[Parameter, ...]:
        """Return the coefficients."""
        pairs = zip(self.names().values(), self.coefficients, strict=True)
        return tuple(Parameter(name, value) for name, value in pairs)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Add the terms."""
        known = (*model.states, *model.inputs)
        terms = [parse_expression(term, known, f"term of {self.target!r}") for term in self.terms]
        added = sympy.Add(*(c * term for c, term in zip(p.values(), terms, strict=True)))
        return add_at(model, self.target, added)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Return no start: the terms are not known before the records are seen."""
        return ()

    def proposals(self, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Return the formula itself: its coefficients are where a fit starts."""
        return (self,)
