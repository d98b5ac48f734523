"""The additive terms of a model's rates."""

import sympy

from sklearn_pgnn.physics.expressions import expanded, symbol
from sklearn_pgnn.physics.model import PhysicsModel


def model_terms(model: PhysicsModel) -> list[sympy.Expr]:
    """Return a model's states, inputs and the terms of its rates, without constant factors."""
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    terms = [symbol(name) for name in (*model.states, *model.inputs)]
    for rate in model.equations.values():
        rate = expanded(rate.xreplace(values), log=False, power_base=False, power_exp=False)
        for addend in sympy.Add.make_args(rate):
            terms.append(addend.as_independent(*addend.free_symbols, as_Add=False)[1])
    return [term for term in dict.fromkeys(terms) if not term.is_zero]
