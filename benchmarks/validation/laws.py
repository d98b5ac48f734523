"""The laws of an effect: terms of which it adds a multiple to rates and outputs."""

import sympy

from sklearn_pgnn.estimation.same_in_equations import is_of_other_order
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel

#: place of an addition, and the terms added: ``"v'"`` for the rate of v, ``"v"`` for the output v
Law = frozenset[tuple[str, sympy.Expr]]


def laws_of(effect: Effect, model: PhysicsModel) -> frozenset[Law]:
    r"""Return the laws of an effect, derived from its equations.

    A parameter :math:`q` of the effect stands for a law if :math:`\partial (f, g)/\partial q` does
    not depend on the effect's own parameters. Constant factors do not count. Addends at one place
    are separate laws; what is added at several places is one law.

    Parameters
    ----------
    effect : Effect
        The effect.
    model : PhysicsModel
        The model that lacks it.

    Returns
    -------
    frozenset of frozenset of (str, sympy.Expr)
        The laws; empty for an effect that adds states or delays.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import CoulombFriction, StribeckFriction
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> [dict(law) for law in laws_of(CoulombFriction("v"), cart_on_spring())]
    [{"v'": sign(v)}]
    """
    extended = effect.apply(model)
    if is_of_other_order(model, extended):
        return frozenset()
    own = set(map(symbol, effect.names().values()))
    rates = ((f"{state}'", rate) for state, rate in extended.equations.items())
    places = [*rates, *extended.outputs.items()]
    slopes = ({name: sympy.diff(e, q) for name, e in places} for q in own)
    return frozenset().union(
        *(_laws(extended, slope) for slope in slopes if not own & _symbols(slope.values()))
    )


def _laws(model: PhysicsModel, slopes: dict[str, sympy.Expr]) -> set[Law]:
    """Return the laws of one parameter from the derivatives with respect to it."""
    there = {name: sympy.expand(slope) for name, slope in slopes.items() if slope != 0}
    moving = [*map(symbol, (*model.states, *model.inputs)), TIME]
    if len(there) != 1:
        law = frozenset((name, _term(slope, moving)) for name, slope in there.items())
        return {law} if law else set()
    ((name, slope),) = there.items()
    return {frozenset({(name, _term(part, moving))}) for part in sympy.Add.make_args(slope)}


def _term(expression: sympy.Expr, moving) -> sympy.Expr:
    """Return an expression without its constant factors."""
    return sympy.factor_terms(expression).as_independent(*moving, as_Add=False)[1]


def _symbols(expressions) -> set[sympy.Symbol]:
    return set().union(*(expression.free_symbols for expression in expressions))
