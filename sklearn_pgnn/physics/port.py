r"""A port: where something can act on a machine, and what it changes there.

An effort :math:`e` at a port (a force, a torque, a heat flow) enters the rates linearly, and the
outputs that contain a rate; with the conjugate flow :math:`f` (a velocity, a temperature) it makes
the power :math:`e f`:

.. math:: \dot x_i = \ldots + b_i(x)\, e, \qquad y_j = \ldots + c_j(x)\, e .

For a mechanism :math:`b = M^{-1} J^\top`, with the mass matrix :math:`M` and :math:`f = J v`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import sympy

from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.mass_matrix import balances_of, own_entry

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel


class PortName(str):
    """The name that people give to a place: something acts at the elbow, but on a velocity v."""

    __slots__ = ()


@dataclass(frozen=True)
class Port:
    r"""A place where something can act: an effort, and the flow conjugate to it.

    .. math:: \dot x_i = f_i - b_i\, e, \qquad y_j = g_j - c_j\, e

    Parameters
    ----------
    name : str
        Its name in a model and in a diagnosis.
    flow : sympy.Expr
        The conjugate flow: a state, or a difference of two if the port lies between them.
    displacement : sympy.Expr, optional
        The integral of the flow, where there is one.
    rates : mapping of str to sympy.Expr
        The coefficients :math:`b_i`: by how much a unit of effort changes the rate of a state.
    outputs : mapping of str to sympy.Expr, default={}
        The coefficients :math:`c_j`, for outputs that contain a rate.
    unit : str, default=""
        Unit of the effort.

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> port = cart_on_spring().port("v")
    >>> port.flow, port.displacement, dict(port.rates), port.unit
    (v, x, {'v': 1/m}, 'N')
    """

    name: str
    flow: sympy.Expr
    displacement: sympy.Expr | None = None
    rates: Mapping[str, sympy.Expr] = field(default_factory=dict)
    outputs: Mapping[str, sympy.Expr] = field(default_factory=dict)
    unit: str = ""

    @property
    def position(self) -> str:
        """Text of the displacement, under which records have its magnitudes; empty without one."""
        return "" if self.displacement is None else to_text(self.displacement)

    @property
    def mobility(self) -> sympy.Expr:
        r"""Change of the flow's rate by a unit of effort, :math:`\sum_i b_i \, df/dx_i`."""
        slopes = (self.flow.diff(symbol(state)) * b for state, b in self.rates.items())
        return sympy.Add(*slopes)

    def act(self, model: PhysicsModel, effort: sympy.Expr) -> dict[str, Any]:
        """Return the parts of a model that an effort against the flow changes.

        Parameters
        ----------
        model : PhysicsModel
            The model that has the port.
        effort : sympy.Expr
            The resisting effort [`unit`].

        Returns
        -------
        dict
            Constructor parameters of `PhysicsModel` and their new values; where the model has
            `forces` or `flows`, these as well: its equations follow from them. An effect that
            changes a rate further leaves them out.

        Examples
        --------
        >>> from sklearn_pgnn.physics.systems import cart_on_spring
        >>> cart = cart_on_spring()
        >>> cart.port("v").act(cart, sympy.Float(2.0))["equations"]["v"]
        (-d*v + force - k*x - 2.0)/m
        """
        rates, outputs = dict(model.equations), dict(model.outputs)
        balances = balances_of(model, self.flow, self.rates)
        for state, b in self.rates.items():
            rates[state] = _less(rates[state], effort, b, own_entry(model.inertia, state))
        for output, c in self.outputs.items():
            outputs[output] = _less(outputs[output], effort, c, None)
        forces = {}
        for other, slopes in balances.items():
            own = getattr(model, other)
            forces[other] = {**own, **{name: own[name] - b * effort for name, b in slopes.items()}}
        energy = self._energy(model, effort)
        return {"equations": rates, "outputs": outputs, "energy": energy, **forces}

    def is_power(self, model: PhysicsModel) -> bool:
        """Return whether effort times flow is known to be a power, not a change of a rate.

        Parameters
        ----------
        model : PhysicsModel
            The model that has the port.

        Returns
        -------
        bool
            False for a velocity whose inertia the model does not give.
        """
        return dict(self.rates) != {self.name: 1} or self.name in model.inertia

    def _energy(self, model: PhysicsModel, effort: sympy.Expr) -> dict[str, sympy.Expr]:
        """Return a model's energy with the power of a resisting effort."""
        energy = dict(model.energy)
        if energy and self.is_power(model):
            is_store = set(map(str, self.flow.free_symbols)) <= set(model.capacity)  # its content
            taken = self._taken(energy["stored"]) if is_store and "stored" in energy else self.flow
            energy["dissipated"] = energy.get("dissipated", 0) + effort * taken
        return energy

    def _taken(self, stored: sympy.Expr) -> sympy.Expr:
        r"""Return what a unit of effort takes from what is stored, :math:`\sum_i b_i E_{x_i}`."""
        slopes = (stored.diff(symbol(state)) * b for state, b in self.rates.items())
        return sympy.Add(*slopes)

    def expressions(self) -> tuple[sympy.Expr, ...]:
        """Return everything that is an expression."""
        own = () if self.displacement is None else (self.displacement,)
        return (self.flow, *own, *self.rates.values(), *self.outputs.values())

    def parts(self) -> dict[str, Any]:
        """Return the port as plain data, as a model file holds it."""
        texts = {"flow": to_text(self.flow), "displacement": self.position}
        slopes = {
            part: {name: to_text(each) for name, each in of.items()}
            for part, of in (("rates", self.rates), ("outputs", self.outputs))
        }
        parts = {**texts, **slopes, "unit": self.unit}
        return {key: part for key, part in parts.items() if part}


def _less(
    expression: sympy.Expr, effort: sympy.Expr, slope: sympy.Expr, inertia: sympy.Expr | None
) -> sympy.Expr:
    """Subtract slope*effort, keeping the form (sum of forces)/inertia where there is one."""
    share, below = sympy.fraction(slope)
    if inertia is not None and slope == 1 / inertia:
        share, below = sympy.Integer(1), inertia
    if below == 1:
        return expression - share * effort
    above = expression * below
    if not above.has(1 / below):
        return (above - share * effort) / below
    return expression - slope * effort


def inertia_at(port: Port, model: PhysicsModel) -> sympy.Expr:
    """Return the inertia that an effort moves, as the model writes it where it does."""
    if set(port.rates) == {port.name}:
        return own_entry(model.inertia, port.name) or 1 / port.mobility
    return 1 / port.mobility


def against(port: Port, model: PhysicsModel) -> str:
    """Return where an effort resists, in words: a port may have the name of its flow."""
    return f"against {port.name}" if port.name in model.states else f"at the {port.name}"


def with_coefficients(port: Port, change: Callable[[sympy.Expr], sympy.Expr]) -> Port:
    """Return a port with other coefficients."""
    rates, outputs = (
        {name: change(each) for name, each in of.items()} for of in (port.rates, port.outputs)
    )
    return replace(port, rates=rates, outputs=outputs)
