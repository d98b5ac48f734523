r"""From coefficients to a model: :math:`\dot x = \Xi\Psi(x, u)` as a `PhysicsModel`.

A map :math:`x_{k+1} = \Xi\Psi(x_k, u_k)` is written as the rate :math:`(\Xi\Psi(x, u) - x)/T` with
the sample interval :math:`T`, so that one explicit Euler step of a sample is exactly the map.
"""

import re

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter

#: longest part of a coefficient's name that is made from its term
NAME_LENGTH = 24


def identified_model(
    base: PhysicsModel, terms, coefficients, T: float | None = None
) -> PhysicsModel:
    """Return a model with identified equations.

    `base` gives names, units, inputs, outputs, delays and columns, and the rate of every position.
    The coefficients, of shape (n_states, n_terms), are of rates, or of a map if its sample interval
    `T` [s] is given; zero where a term is left out. They are parameters such as
    ``c_omega_sin_phi``.
    """
    kept = _kept_parameters(base, with_inertia=T is None)
    taken = {*base.states, *base.inputs, *kept}
    known = {} if T is not None else velocities(base)
    equations = {position: symbol(velocity) for position, velocity in known.items()}
    new: dict[str, Parameter] = {}
    if T is not None:
        interval = Parameter(_free_name("T", taken), T, unit="s", fixed=True)
        kept[interval.name] = interval
    for state, row in zip(base.states, coefficients, strict=True):
        if state in known:
            continue
        found = _coefficients(state, terms, row, taken, base.unit(state), T)
        total = sympy.Add(*(symbol(p.name) * term for p, term in found))
        if T is not None:
            # a simulation splits no steps there: a map describes no sticking between two samples
            signs = {sympy.sign(x): sympy.sign(sympy.tanh(x)) for x in map(symbol, base.states)}
            total = (total.xreplace(signs) - symbol(state)) / symbol(interval.name)
        equations[state] = total
        new |= {parameter.name: parameter for parameter, _ in found}
    return base.replace(
        name=f"{base.name}, identified",
        equations=equations,
        parameters={**new, **kept},
        inertia=base.inertia if T is None else {},
        energy={},
        ports={},
    )


def complete(base: PhysicsModel, library, found, discrete: bool):
    """Add the known terms to the identified ones: a state's last value, a position's velocity.

    `found`, of shape (n_identified, n_terms), are coefficients of steps of all states where
    `discrete`, or of the rates of all that are no positions. Return the library and the terms that
    it lacked, and coefficients of shape (n_states, n_terms).
    """
    known = {state: state for state in base.states} if discrete else velocities(base)
    terms = list(dict.fromkeys([*library, *map(symbol, known.values())]))
    coefficients, rows = np.zeros((len(base.states), len(terms))), iter(found)
    for i, state in enumerate(base.states):
        if discrete or state not in known:
            coefficients[i, : len(library)] = next(rows)
        if state in known:
            coefficients[i, terms.index(symbol(known[state]))] += 1.0
    return terms, coefficients


def equation_texts(left, terms, coefficients) -> list[str]:
    """Write equations with four digits; the coefficients have shape (n_equations, n_terms).

    >>> x = symbol("x")
    >>> equation_texts(["x'"], [sympy.Integer(1), x, sympy.sin(x) + 1], np.array([[0.5, -2, 1]]))
    ["x' = 0.5 - 2*x + (sin(x) + 1)"]
    """
    return [f"{name} = {_sum(terms, row)}" for name, row in zip(left, coefficients, strict=True)]


def _sum(terms, row) -> str:
    parts = [_product(value, term) for value, term in zip(row, terms, strict=True) if value]
    return " + ".join(parts).replace("+ -", "- ") or "0"


def _product(value: float, term: sympy.Expr) -> str:
    number, text = f"{value:.4g}", to_text(term)
    if term == 1:
        return number
    factor = f"({text})" if term.is_Add else text
    return {"1": factor, "-1": f"-{factor}"}.get(number, f"{number}*{factor}")


def velocities(base: PhysicsModel) -> dict[str, str]:
    """Return the velocity of every position whose rate is just that."""
    pairs = {position: velocity for velocity, position in base.slope_pairs.items()}
    return {p: v for p, v in pairs.items() if base.equations[p] == symbol(v)}


def _kept_parameters(base: PhysicsModel, with_inertia: bool) -> dict[str, Parameter]:
    """Return the parameters that outputs, delays and inertia still use, as fixed ones."""
    used = [*base.outputs.values(), *(base.inertia.values() if with_inertia else ())]
    names = {str(s) for expression in used for s in expression.free_symbols}
    names |= set(base.delays.values())
    return {
        name: Parameter(name, p.value, unit=p.unit, bounds=p.bounds, fixed=True)
        for name, p in base.parameters.items()
        if name in names
    }


def _coefficients(state, terms, row, taken, unit, T):
    """Make a parameter of every coefficient that is not zero, with its term."""
    found = []
    for term, value in zip(terms, row, strict=True):
        if value:
            text = to_text(term)
            slug = re.sub(r"\W+", "_", text).strip("_")[:NAME_LENGTH].strip("_")
            name = _free_name(f"c_{state}_{slug}", taken)
            per = unit or "1" if T is not None else f"{unit or 1}/s"
            found.append((Parameter(name, float(value), unit=f"{per} per {text}"), term))
    return found


def _free_name(wanted: str, taken: set[str]) -> str:
    name, number = wanted, 2
    while name in taken:
        name, number = f"{wanted}_{number}", number + 1
    taken.add(name)
    return name
