"""Check of the units of a model's equations, term by term."""

from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import sympy

from sklearn_pgnn.physics.expressions import TIME, to_text
from sklearn_pgnn.physics.external import External
from sklearn_pgnn.physics.mass_matrix import BALANCES, coupled
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.physics.units import is_like, no_unit, product, read_unit, unit_text

if TYPE_CHECKING:
    from sklearn_pgnn.physics.units import Quantity

#: functions of a number, or of an angle in radians
_OF_NUMBERS = (
    *(sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan),
    *(sympy.sinh, sympy.cosh, sympy.tanh, sympy.exp, sympy.log, sympy.floor, sympy.ceiling),
)
#: added to the message about a term with a numerical factor
_NUMBER = " (numbers have no unit: define a constant such as 9.81 m/s^2 as a fixed parameter)"


def check_units(model: PhysicsModel) -> tuple[str, ...]:
    """Return the terms of a model's equations whose units are inconsistent.

    What contains a quantity without a unit, or with an unknown one, is compatible with everything,
    but rates in 1/h have the wrong scale, whatever their states are. The scale of a term with a
    numerical factor is not checked: the number may be the conversion.

    Parameters
    ----------
    model : PhysicsModel
        The model.

    Returns
    -------
    tuple of str
        One sentence per term; empty if all units are consistent.

    Examples
    --------
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, inputs={"F": "N"},
    ...     parameters={"m": {"value": 2.0, "unit": "kg"}, "d": {"value": 0.5, "unit": "N/m"}})
    >>> print(*check_units(cart))
    equations.v: the term -d*v is in N/s, expected N.
    """
    check = _Check(model)
    for part, other in BALANCES.items():
        check.ask_balance(part, getattr(model, part), other, getattr(model, other))
    for state, rate in model.equations.items():
        if state not in model.forces and state not in model.flows:
            check.ask(f"equations.{state}", rate, check.of_rate(state, rate))
    for output, shown in model.outputs.items():
        check.ask(f"outputs.{output}", shown, None)
    for part, expression in model.energy.items():
        check.ask(f"energy.{part}", expression, None)
    for name, port in model.declared_ports.items():
        check.ask_power(f"ports.{name}", port)
    for name, delay in model.delays.items():
        check.ask(f"delays.{name}", sympy.Symbol(delay, real=True), read_unit("s"))
    return tuple(dict.fromkeys(check.said))


def unknown_units(model: PhysicsModel) -> tuple[str, ...]:
    """Return the units of a model that are unknown: one sentence each."""
    units = {("states", name): unit for name, unit in model.states.items()}
    units |= {("inputs", name): unit for name, unit in model.inputs.items()}
    units |= {("parameters", name): p.unit for name, p in model.parameters.items()}
    return tuple(
        f"{part}.{name}: the unit {unit!r} is unknown, and is not checked."
        for (part, name), unit in units.items()
        if unit and read_unit(unit) is None
    )


def output_measure(model: PhysicsModel, output: str) -> "Quantity | None":
    """Return the measure of an output by its expression, if no number in it may be a conversion."""
    expression, check = model.outputs[output], _Check(model)
    names = set(map(str, expression.free_symbols)) - set(check.table)
    check.table |= {name: no_unit() for name in names if not model.unit(name)}
    return check.measure(expression) if _is_bare(expression) else None


class _Check:
    """Units of a model's quantities, and the terms found to be inconsistent."""

    def __init__(self, model: PhysicsModel):
        units = {**model.states, **model.inputs}
        units |= {name: p.unit for name, p in model.parameters.items()}
        #: measure by name of quantity; those without a unit or with an unknown one are left out
        self.table: dict[str, Any] = {
            n: m for n, u in units.items() if u and (m := read_unit(u)) is not None
        }
        self.table[str(TIME)] = read_unit("s")
        self.said: list[str] = []

    def of_rate(self, state: str, rate: sympy.Expr = sympy.S.Zero) -> "Quantity | None":
        """Return what the rate of a state measures; a number per time counts seconds."""
        unit, per_second = self.table.get(state), read_unit("1/s")
        if unit is not None:
            return unit * per_second
        got = self.measure(rate)
        return per_second if got is not None and is_like(got, per_second) else None

    def ask_balance(
        self,
        part: str,
        inertia: Mapping[str, sympy.Basic],
        other: str,
        forces: Mapping[str, sympy.Expr],
    ) -> None:
        """Check forces, and the rows of a matrix, against the entry on the diagonal."""
        rows = coupled(inertia)
        for state, entry in inertia.items():
            row = dict(zip(rows, entry, strict=True)) if state in rows else {state: entry}
            force = self.product_of(row[state], state)
            for column, coefficient in row.items():
                rate, where = self.of_rate(column), f"{part}.{state}"
                expected = None if force is None or rate is None else force / rate
                self.ask(where, coefficient, expected)
            if state in forces:
                self.ask(f"{other}.{state}", forces[state], force)

    def product_of(self, inertia: sympy.Expr, state: str) -> "Quantity | None":
        """Return what an inertia times the rate of a state measures."""
        if inertia.is_number or not _is_bare(inertia):
            return None
        mass, rate = self.measure(inertia), self.of_rate(state)
        return None if mass is None or rate is None else mass * rate

    def ask(self, where: str, expression: sympy.Expr, expected: "Quantity | None") -> None:
        """Record every term of an expression that differs from the expected measure."""
        if expression.is_number:
            return
        if isinstance(expression, sympy.Add | sympy.Max | sympy.Min):
            self.ask_terms(where, expression, expected)
        elif isinstance(expression, sympy.Mul) and (found := self.sum_of(expression)):
            self.ask_factor(where, expression, found, expected)
        else:
            self.compare(where, expression, expected)
            self.ask_inside(where, expression)

    def ask_power(self, where: str, port: Port) -> None:
        """Record an effort that makes no power with its flow; a heat flow is one already."""
        effort, flow, power = read_unit(port.unit), self.measure(port.flow), read_unit("W")
        if not port.unit or effort is None or flow is None or is_like(effort, power):
            return
        if not is_like(effort * flow, power):
            self.said.append(
                f"{where}: the effort in {port.unit} times the flow {_short(port.flow)} in "
                f"{unit_text(flow)} is no power."
            )

    def ask_terms(self, where: str, expression: sympy.Expr, expected: "Quantity | None") -> None:
        """Check every term of a sum or a bound; by default against what most of them measure."""
        if expected is None:
            known = self.measures(expression)
            expected = Counter(known).most_common(1)[0][0] if known else None
        for term in expression.args:
            self.ask(where, term, expected)

    def sum_of(self, product: sympy.Mul) -> sympy.Add | None:
        """Return the sum in a product, where there is one."""
        sums = [part for part in product.args if isinstance(part, sympy.Add)]
        return sums[0] if len(sums) == 1 else None

    def ask_factor(
        self, where: str, product: sympy.Mul, inner: sympy.Add, expected: "Quantity | None"
    ) -> None:
        """Check the terms of a sum in a product against what remains after the other factors."""
        rest = product / inner
        others = self.measure(rest)
        for part in rest.args or (rest,):
            self.ask_inside(where, part)
        number = not _is_bare(rest)
        left = None if expected is None or others is None else expected / others
        if left is not None and number:
            mine = self.measure(inner)
            left = left if mine is None or not is_like(mine, left) else None
        self.ask(where, inner, left)

    def ask_inside(self, where: str, expression: sympy.Expr) -> None:
        """Check the arguments of functions, and the parts of products and powers."""
        if isinstance(expression, _OF_NUMBERS):
            self.ask(where, expression.args[0], no_unit())
        elif isinstance(expression, sympy.Function | sympy.Mul | sympy.Pow):
            for part in expression.args:
                self.ask(where, part, None)

    def compare(self, where: str, term: sympy.Expr, expected: "Quantity | None") -> None:
        """Record a term that measures something else, or the same in another unit."""
        got = self.measure(term)
        if got is None or expected is None:
            return
        scale = expected.magnitude / got.magnitude
        if not is_like(got, expected):
            why = "" if _is_bare(term) else _NUMBER
        elif _is_bare(term) and abs(scale - 1) > 1e-6:
            why = f" (a factor of {1 / scale:.4g})"
        else:
            return
        self.said.append(
            f"{where}: the term {_short(term)} is in {unit_text(got)}, expected "
            f"{unit_text(expected)}{why}."
        )

    def measure(self, expression: sympy.Expr) -> "Quantity | None":
        """Return what an expression measures; None if unknown."""
        if expression.is_number:
            return None if expression.is_zero else no_unit()
        if isinstance(expression, sympy.Symbol):
            return self.table.get(str(expression))
        if isinstance(expression, sympy.Mul):
            return product(map(self.measure, expression.args))
        if isinstance(expression, sympy.Pow):
            return self.power(expression)
        if isinstance(expression, sympy.Add | sympy.Max | sympy.Min | sympy.Abs):
            return next(iter(self.measures(expression)), None)
        return None if isinstance(expression, External) else no_unit()

    def measures(self, expression: sympy.Expr) -> list["Quantity"]:
        """Return what the terms of a sum or a bound measure; numbers take the terms' unit."""
        terms = [term for term in expression.args if not term.is_number]
        return [measure for term in terms if (measure := self.measure(term)) is not None]

    def power(self, expression: sympy.Pow) -> "Quantity | None":
        """Return what a power measures."""
        base = self.measure(expression.base)
        if base is None:
            return None
        if expression.exp.is_number:
            return base ** float(expression.exp)
        return no_unit() if base == no_unit() else None


def _short(term: sympy.Expr) -> str:
    """Return a term with every number rounded to four digits."""
    return to_text(term.xreplace({n: sympy.Float(f"{n:.4g}") for n in term.atoms(sympy.Float)}))


def _is_bare(term: sympy.Expr) -> bool:
    """Whether a term has no number in front that may be a conversion; SymPy puts it into sums."""
    if term.is_Add:
        return any(map(_is_bare, term.args))
    coefficient, rest = term.as_coeff_Mul()
    return abs(coefficient) == 1 and not rest.has(sympy.pi)
