r"""Where a model has dry friction: the velocities, or differences of velocities, that can stick.

A flow :math:`\varphi = c^T x` is under dry friction where the rates contain
:math:`s = \mathrm{sign}(\varphi)` and with them :math:`\dot\varphi`. At :math:`\varphi = 0` the
sign is any number from -1 to 1 (Filippov): the rates are those of one side, of the other, or
between them, :math:`f = f_0 + B s` with :math:`B = (f|_{s=1} - f|_{s=-1})/2`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class DryFriction:
    """The flows of a model under dry friction, as rows over the states, and their signs."""

    rows: tuple[tuple[float, ...], ...]
    flows: tuple[sympy.Expr, ...]
    #: every sign in the equations that is one of a flow, by that flow's sign, or its negative
    signs: Mapping[sympy.Expr, sympy.Expr]

    @property
    def symbols(self) -> tuple[sympy.Symbol, ...]:
        """What stands for the flows' signs."""
        return tuple(map(sign_symbol, range(len(self.rows))))

    def smoothed(self, width: float) -> dict[sympy.Expr, sympy.Expr]:
        """Return what every sign becomes where its jump is rounded off over a width."""
        round_off = {
            sign: sympy.tanh(flow / width)
            for sign, flow in zip(self.symbols, self.flows, strict=True)
        }
        return {old: new.xreplace(round_off) for old, new in self.signs.items()}


def sign_symbol(i: int) -> sympy.Symbol:
    """Return the symbol for the sign of a flow."""
    return sympy.Symbol(f"s{i}")


def dry_friction(model: PhysicsModel) -> DryFriction:
    """Find the flows under dry friction, velocities before differences of them."""
    states = [symbol(name) for name in model.states]
    rates = list(model.equations.values())
    found: dict[tuple[float, ...], list[tuple[sympy.Expr, int]]] = {}
    for sign in set().union(*(rate.atoms(sympy.sign) for rate in rates)):
        row = _row(sign.args[0], states)
        if row is not None and any(
            c and rate.has(sign) for c, rate in zip(row[0], rates, strict=True)
        ):
            found.setdefault(row[0], []).append((sign, row[1]))
    rows = tuple(sorted(found, key=lambda row: (sum(map(bool, row)), *(-abs(c) for c in row), row)))
    signs = {sign: side * sign_symbol(i) for i, row in enumerate(rows) for sign, side in found[row]}
    return DryFriction(rows, tuple(_flow(row, states) for row in rows), signs)


def _row(flow: sympy.Expr, states: Sequence[sympy.Symbol]) -> tuple[tuple[float, ...], int] | None:
    """Return a linear form's coefficients, the first made 1, and its sign; None for others."""
    if not flow.free_symbols <= set(states):
        return None
    slopes = [sympy.diff(flow, x) if flow.has(x) else sympy.Integer(0) for x in states]
    linear = sum(c * x for c, x in zip(slopes, states, strict=True))
    if not all(c.is_number for c in slopes) or sympy.expand(flow - linear) != 0:
        return None
    first = next(c for c in slopes if c != 0)
    return tuple(float(c / first) for c in slopes), 1 if first > 0 else -1


def _flow(row: Sequence[float], states: Sequence[sympy.Symbol]) -> sympy.Expr:
    whole = (sympy.nsimplify(c, rational=True) for c in row)
    return sympy.Add(*(c * x for c, x in zip(whole, states, strict=True)))


def with_signs(expression: sympy.Expr, dry: DryFriction) -> sympy.Expr:
    """Write an expression with the flows' signs, each of which it is made linear in.

    Between the two sides of a flow Filippov's rule mixes what stands on them.
    """
    written = expression.xreplace(dict(dry.signs))
    for s in dry.symbols if written != expression else ():
        if sympy.diff(written, s).has(s):
            forward, backward = written.xreplace({s: 1}), written.xreplace({s: -1})
            written = (forward + backward) / 2 + s * (forward - backward) / 2
    return written


def check_signs(
    rates: list[sympy.Expr], signs: Sequence[sympy.Symbol], dry: DryFriction, names: list[str]
) -> None:
    """Raise `ModelError` where a rate contains a product of two flows' signs."""
    for name, rate in zip(names, rates, strict=True):
        for i, s in enumerate(signs):
            others = sympy.diff(rate, s).free_symbols & set(signs)
            if others:
                other = dry.flows[signs.index(others.pop())]
                raise ModelError(
                    f"equations: the rate of {name!r} contains a product of sign({dry.flows[i]}) "
                    f"and sign({other}), so what one dry friction does at rest depends on the "
                    "other's direction. Remedy: write them as a sum."
                )
