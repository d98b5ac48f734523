r"""Balances of momentum and of stores, solved for the rates: :math:`M(q)\,\dot v = F`.

An entry of `inertia` or `capacity` is one expression, or a row of the matrix over all states that
have a row, in their order. Zeros divide the matrix into blocks, which are inverted by themselves:

.. math:: M^{-1} = \mathrm{adj}(M)/\det M

Common factors are taken out of every row; nothing is multiplied out. For the planar arm of two,
three and four links a rate has at most 400, 2 900 and 19 000 characters, and writing it with its
derivatives takes 0.3, 1.5 and 10 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.external import External
from sklearn_pgnn.physics.parameter import Parameter

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel

#: what multiplies the rates, and the part that has the other side of the balance
BALANCES = {"inertia": "forces", "capacity": "flows"}
#: most rates that a block of the matrix may couple: the terms grow with the factorial
MAX_COUPLED = 5
#: most operations in a block, times the number of its products
MAX_OPERATIONS = 100_000
#: states at which a matrix is tried, and the largest relative error of symmetry
TRIALS, ROUNDING = 8, 1e-9

Row = tuple[sympy.Expr, ...]
Matrix = tuple[Row, ...]
_Items = tuple[tuple[str, sympy.Basic], ...]


def solved_rates(
    inertia: Mapping[str, sympy.Basic], forces: Mapping[str, sympy.Expr]
) -> dict[str, sympy.Expr]:
    """Return the rates :math:`M^{-1} F` of the states that have a force."""
    rates = {}
    for names, matrix in _blocks(inertia):
        if not set(names) <= set(forces):
            continue
        factors, adjugate = _inverse(matrix)
        for name, factor, row in zip(names, factors, adjugate, strict=True):
            terms = [a * forces[other] for a, other in zip(row, names, strict=True)]
            common = _common_factor(terms)
            rates[name] = factor * common * sympy.Add(*(term / common for term in terms))
    return rates


def mobility(inertia: Mapping[str, sympy.Basic]) -> dict[str, dict[str, sympy.Expr]]:
    """Return the columns of :math:`M^{-1}`: what an effort on a state adds to the rates."""
    columns: dict[str, dict[str, sympy.Expr]] = {}
    for names, matrix in _blocks(inertia):
        factors, adjugate = _inverse(matrix)
        for j, name in enumerate(names):
            entries = [factors[i] * adjugate[i][j] for i in range(len(names))]
            columns[name] = {n: e for n, e in zip(names, entries, strict=True) if e != 0}
    return columns


def balances_of(
    model: PhysicsModel, flow: sympy.Expr, rates: Mapping[str, sympy.Expr]
) -> dict[str, dict[str, sympy.Expr]]:
    r"""Return by how much an effort at a port enters the forces, or the flows, of a model.

    .. math:: b = M^{-1} J^\top, \qquad f = J v

    It is empty where the rates of the port are not those of its flow, or the model has equations.
    """
    for part, other in BALANCES.items():
        inertia, forces = getattr(model, part), getattr(model, other)
        held = [name for name in inertia if flow.has(symbol(name))]
        told = bool(held) and set(held) <= set(forces)
        if told and _is_column(flow, tuple(rates.items()), tuple(inertia.items())):
            return {other: {name: flow.diff(symbol(name)) for name in held}}
    return {}


def is_stated(model: PhysicsModel, flow: sympy.Expr, rates: Mapping[str, sympy.Expr]) -> bool:
    """Return whether a model's inertia or capacity gives the rates of a port by its flow."""
    said = (tuple(getattr(model, part).items()) for part in BALANCES)
    return any(_is_column(flow, tuple(rates.items()), inertia) for inertia in said if inertia)


def rates_of_flow(inertia: Mapping[str, sympy.Basic], flow: sympy.Expr) -> dict[str, sympy.Expr]:
    r"""Return the rates of a unit of effort at a flow, :math:`M^{-1} J^\top` with :math:`f = J v`.

    >>> m, M = sympy.symbols("m M")
    >>> rates_of_flow({"v": m, "w": M}, symbol("v") - symbol("w"))
    {'v': 1/m, 'w': -1/M}
    """
    columns = mobility(inertia)
    found: dict[str, sympy.Expr] = {}
    for name in (name for name in inertia if flow.has(symbol(name))):
        for state, entry in columns[name].items():
            found[state] = found.get(state, sympy.S.Zero) + entry * flow.diff(symbol(name))
    return {state: rate for state, rate in found.items() if rate != 0}


@lru_cache(maxsize=1024)
def _is_column(flow: sympy.Expr, rates: _Items, inertia: _Items) -> bool:
    """Return whether the rates of a port follow from its flow."""
    expected = rates_of_flow(dict(inertia), flow)
    return set(expected) == {state for state, _ in rates} and all(
        _alike(expected[state], rate) for state, rate in rates
    )


def _alike(one: sympy.Expr, other: sympy.Expr) -> bool:
    """Return whether two expressions have the same values, at some points."""
    if one == other or one.has(External):
        return bool(one == other)
    names = sorted((one - other).free_symbols, key=str)
    both = sympy.lambdify(names, [one, other], "numpy")
    points = np.random.default_rng(0).uniform(0.5, 1.5, (TRIALS, len(names)))
    with np.errstate(all="ignore"):
        values = np.array([both(*point) for point in points], dtype=float)
    return bool(np.allclose(values[:, 0], values[:, 1], rtol=ROUNDING, atol=0.0))


def balanced_changes(model: PhysicsModel, changes: Mapping) -> dict:
    """Return the changes of a model such that no rate is given twice, as equation and as force."""
    rates = changes.get("equations", model.equations)
    changed = {name for name, rate in model.equations.items() if rates.get(name) != rate}
    found: dict = dict(changes)
    for part, other in BALANCES.items():
        kept = {
            name: getattr(model, other)[name]
            for names, _ in _blocks(getattr(model, part))
            for name in names
            if name in getattr(model, other) and not changed & set(names)
        }
        found.setdefault(other, kept)
    balanced = {*found["forces"], *found["flows"]}
    found["equations"] = {name: rate for name, rate in rates.items() if name not in balanced}
    return found


def own_entry(inertia: Mapping[str, sympy.Basic], state: str) -> sympy.Expr | None:
    """Return the entry of a state on the diagonal."""
    entry = inertia.get(state)
    return entry[coupled(inertia).index(state)] if isinstance(entry, sympy.Tuple) else entry


def coupled(inertia: Mapping[str, sympy.Basic]) -> tuple[str, ...]:
    """Return the states that have a row of the matrix, in its order."""
    return tuple(name for name, entry in inertia.items() if isinstance(entry, sympy.Tuple))


# -- the inverse -----------------------------------------------------------------------------------


def _blocks(inertia: Mapping[str, sympy.Basic]) -> list[tuple[tuple[str, ...], Matrix]]:
    """Return the names and the matrix of every block that no other is coupled with."""
    rows = coupled(inertia)
    place = {name: i for i, name in enumerate(rows)}
    blocks, left = [], dict(inertia)
    while left:
        names = _reached(next(iter(left)), inertia, rows)
        for name in names:
            del left[name]
        blocks.append(
            (names, tuple(_row(inertia[n], [place.get(o) for o in names]) for n in names))
        )
    return blocks


def _reached(
    first: str, inertia: Mapping[str, sympy.Basic], rows: tuple[str, ...]
) -> tuple[str, ...]:
    """Return the states that entries of the matrix connect with one, in order."""
    if first not in rows:
        return (first,)
    found, new = {first}, [first]
    while new:
        entries = zip(rows, inertia[new.pop()], strict=True)
        more = {name for name, entry in entries if entry != 0} - found
        found |= more
        new += more
    return tuple(name for name in rows if name in found)


def _row(entry: sympy.Basic, places: Sequence[int | None]) -> Row:
    return tuple(entry[i] for i in places) if isinstance(entry, sympy.Tuple) else (entry,)


@lru_cache(maxsize=256)
def _inverse(matrix: Matrix) -> tuple[Row, Matrix]:
    """Return a factor for every row of the inverse, and the rows without it."""
    n = len(matrix)
    minor = _minors(matrix)
    every = tuple(range(n))
    adjugate = [[sympy.Integer(0)] * n for _ in every]
    for i in every:
        for j in range(i, n):  # the matrix is symmetric, and so is its adjugate
            rows, columns = every[:i] + every[i + 1 :], every[:j] + every[j + 1 :]
            cofactor = sympy.factor_terms((-1) ** (i + j) * minor(rows, columns))
            adjugate[i][j] = adjugate[j][i] = cofactor
    first = zip(matrix[0], adjugate[0], strict=True)
    determinant = sympy.factor_terms(sympy.Add(*(a * b for a, b in first)))
    common = [_common_factor(row) for row in adjugate]
    reduced = tuple(
        tuple(a / factor for a in row) for row, factor in zip(adjugate, common, strict=True)
    )
    return tuple(factor / determinant for factor in common), reduced


def _minors(matrix: Matrix) -> Callable[[tuple[int, ...], tuple[int, ...]], sympy.Expr]:
    """Return the determinant of rows and columns, expanded by the first row."""

    @cache
    def minor(rows: tuple[int, ...], columns: tuple[int, ...]) -> sympy.Expr:
        if not rows:
            return sympy.Integer(1)
        return sympy.Add(
            *(
                (-1) ** k * matrix[rows[0]][c] * minor(rows[1:], columns[:k] + columns[k + 1 :])
                for k, c in enumerate(columns)
                if matrix[rows[0]][c] != 0
            )
        )

    return minor


def _common_factor(row: Sequence[sympy.Expr]) -> sympy.Expr:
    """Return the product of the symbols that every entry of a row has as factors."""
    powers = [
        {b: e for b, e in entry.as_powers_dict().items() if b.is_Symbol and e.is_Integer and e > 0}
        for entry in row
        if entry != 0
    ]
    common = powers[0] if powers else {}
    for other in powers[1:]:
        common = {base: min(e, other[base]) for base, e in common.items() if base in other}
    return sympy.Mul(*(base**exponent for base, exponent in common.items()))


# -- what is refused -------------------------------------------------------------------------------


def check_balance(
    part: str, inertia: Mapping[str, Any], forces: Collection[str], equations: Collection[str]
) -> None:
    """Raise `ModelError` unless every force has an inertia, and no rate is given twice."""
    other = BALANCES[part]
    for name in forces:
        if name not in inertia:
            raise ModelError(
                f"{other}.{name}: expected what its rate is multiplied by, in {part!r}, got none. "
                f"Remedy: give {part}.{name}, or write the rate into 'equations'.",
                (other, name),
            )
        if name in equations:
            raise ModelError(
                f"equations.{name}: the rate follows from {other}.{name}, and is given twice. "
                f"Remedy: leave one of the two out.",
                ("equations", name),
            )
    for names, matrix in _blocks(inertia):
        _check_block(part, names, matrix)
        _check_forces(part, names, forces)


def _check_rows(part: str, inertia: Mapping[str, sympy.Basic]) -> None:
    rows = coupled(inertia)
    for name in rows:
        if len(inertia[name]) != len(rows):
            raise ModelError(
                f"{part}.{name}: expected a row of {len(rows)} entries, for {', '.join(rows)}, got "
                f"{len(inertia[name])}. Remedy: give every state that has a row one entry in every "
                f"row, 0 where two do not act on each other.",
                (part, name),
            )


def _check_block(part: str, names: tuple[str, ...], matrix: Matrix) -> None:
    """Raise `ModelError` for a block whose inverse would be too long."""
    count, long = len(names), sum(sympy.count_ops(entry) for row in matrix for entry in row)
    if count > MAX_COUPLED or long * math.factorial(count - 1) > MAX_OPERATIONS:
        raise ModelError(
            f"{part}: expected at most {MAX_COUPLED} rates that act on each other, by short "
            f"expressions, got {', '.join(names)} with {long} operations. Remedy: choose "
            f"coordinates in which more entries are zero, or write 'equations', and 'ports' with "
            f"their 'rates'.",
            (part, names[0]),
        )


def _check_forces(part: str, names: tuple[str, ...], forces: Collection[str]) -> None:
    """Raise `ModelError` for a block that has only a part of its forces."""
    other = BALANCES[part]
    given = [name for name in names if name in forces]
    if given and len(given) < len(names):
        missing = next(name for name in names if name not in forces)
        raise ModelError(
            f"{other}: {missing!r} is missing, on which the rate of {given[0]!r} depends. Remedy: "
            f"give {other}.{missing}, 0 where nothing acts.",
            (other,),
        )


def check_matrix(
    part: str, inertia: Mapping[str, sympy.Basic], parameters: Mapping[str, Parameter]
) -> None:
    r"""Raise `ModelError` unless the rows are symmetric, and positive definite at some state."""
    _check_rows(part, inertia)
    rows = coupled(inertia)
    if not rows or any(inertia[name].has(External) for name in rows):
        return
    matrix = tuple(tuple(inertia[name]) for name in rows)
    held = {str(each) for row in matrix for entry in row for each in entry.free_symbols}
    values = tuple((name, p.value) for name, p in parameters.items() if name in held)
    _check_tried(part, rows, matrix, tuple(sorted(held - set(parameters))), values)


@lru_cache(maxsize=256)
def _check_tried(
    part: str,
    rows: tuple[str, ...],
    matrix: Matrix,
    signals: tuple[str, ...],
    values: tuple[tuple[str, float], ...],
) -> None:
    tried = _tried(matrix, signals, values)
    if not len(tried):
        return
    _check_symmetry(part, rows, matrix, tried)
    lowest = max(tried, key=_lowest)
    if _lowest(lowest) > ROUNDING:
        return
    _, directions = np.linalg.eigh(_scaled(lowest))
    worst = rows[int(np.argmax(np.abs(directions[:, 0])))]
    kind = "singular" if _lowest(lowest) > -ROUNDING else "negative"
    raise ModelError(
        f"{part}: expected a symmetric matrix that is positive definite, got one that is {kind}, "
        f"mainly by {worst!r}, at the parameters' values and {len(tried)} states. Remedy: give "
        f"every direction of motion its inertia, or write the equations of fewer states.",
        (part, worst),
    )


def _tried(
    matrix: Matrix, signals: tuple[str, ...], values: tuple[tuple[str, float], ...]
) -> np.ndarray:
    """Return the matrix at the parameters' values and some states, without those not finite."""
    names = [*(symbol(name) for name, _ in values), *map(symbol, signals)]
    function = sympy.lambdify(names, [list(row) for row in matrix], "numpy")
    rng = np.random.default_rng(0)
    points = rng.standard_normal((TRIALS, len(signals)))
    numbers = [np.float64(value) for _, value in values]  # which may be divided by zero
    with np.errstate(all="ignore"):
        tried = [np.array(function(*numbers, *point), dtype=complex) for point in points]
    real = [m.real for m in tried if np.all(np.isfinite(m)) and np.all(m.imag == 0.0)]
    return np.array(real)


def _check_symmetry(part: str, rows: tuple[str, ...], matrix: Matrix, tried: np.ndarray) -> None:
    size = np.abs(tried).max(axis=(1, 2), keepdims=True)
    off = np.any(np.abs(tried - tried.transpose(0, 2, 1)) > ROUNDING * size, axis=0)
    for i, j in np.argwhere(np.triu(off)):
        raise ModelError(
            f"{part}: expected a symmetric matrix, got {to_text(matrix[i][j])} in the row of "
            f"{rows[i]!r} for {rows[j]!r}, and {to_text(matrix[j][i])} in the row of {rows[j]!r} "
            f"for {rows[i]!r}. Remedy: write both alike: kinetic energy is symmetric in the rates.",
            (part, rows[j]),
        )


def _scaled(matrix: np.ndarray) -> np.ndarray:
    """Return a matrix with ones on its diagonal, whatever the units."""
    root = np.sqrt(np.abs(np.diag(matrix)))
    root[root == 0.0] = 1.0
    return (matrix + matrix.T) / 2.0 / np.outer(root, root)


def _lowest(matrix: np.ndarray) -> float:
    """Return the lowest eigenvalue of the scaled matrix."""
    values = np.linalg.eigvalsh(_scaled(matrix))
    return float(values[0]) if np.all(np.isfinite(values)) else -math.inf
