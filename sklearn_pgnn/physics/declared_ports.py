"""Shared subexpressions and ports of a model as they are given: read, and refused if not valid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import same_name, symbol
from sklearn_pgnn.physics.found_ports import found_ports
from sklearn_pgnn.physics.mass_matrix import BALANCES, coupled, is_stated, rates_of_flow
from sklearn_pgnn.physics.model_parts import as_expression, as_mapping, as_text, check_keys
from sklearn_pgnn.physics.model_units import EFFORTS, force_unit, unit_of
from sklearn_pgnn.physics.parameter import check_name
from sklearn_pgnn.physics.port import Port, PortName
from sklearn_pgnn.physics.repeated_rates import repeated_rates, shown_rates

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel

_SHOWN = ("equations", "outputs")
_KEYS = ("effort", "flow", "displacement", "rates", "outputs", "unit")


def declared_in(ports: Any) -> dict[str, Any]:
    """Return what a model declares as ports: of another model, not those that are found."""
    return as_mapping("ports", ports.declared if isinstance(ports, Ports) else ports or {})


class Ports(Mapping[str, Port]):
    """The ports of a model: those that it declares, then those that are found when asked for."""

    def __init__(self, declared: Mapping[str, Port], model: PhysicsModel):
        self.declared, self._model = dict(declared), model

    @cached_property
    def _all(self) -> dict[str, Port]:
        found = found_ports(self._model, self.declared.values())
        named = {self._called(name): port for name, port in self.declared.items()}
        return {name: self._seen(port) for name, port in {**named, **found}.items()}

    def _called(self, name: str) -> str:
        """Return a name as that of a place, unless it is that of the flow."""
        return name if name in self._model.states else PortName(name)

    def _seen(self, port: Port) -> Port:
        """Return a port with its coefficients in outputs that repeat a rate."""
        slopes = {
            output: sympy.Add(*(c * port.rates.get(state, 0) for state, c in factors.items()))
            for output, factors in shown_rates(self._model).items()
        }
        told = {output: slope for output, slope in slopes.items() if slope != 0}
        return replace(port, outputs={**told, **port.outputs}) if told else port

    @property
    def kept(self) -> dict[str, Port]:
        """What a model keeps that is made from this one: ports that it could not find again."""
        model = self._model
        stated = {*coupled(model.inertia), *coupled(model.capacity)}
        several = [p for p in self._all.values() if len(p.rates) > 1 and p.name not in stated]
        return {**{each.name: replace(each, outputs={}) for each in several}, **self.declared}

    def parts(self) -> dict[str, dict]:
        """Return the declared ports as plain data, without rates that follow from a mass matrix."""
        said = {name: port.parts() for name, port in self.declared.items()}
        for name, port in self.declared.items():
            if is_stated(self._model, port.flow, port.rates):
                del said[name]["rates"]
        return said

    def __getitem__(self, name: str) -> Port:
        return self._all[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)


@dataclass(frozen=True)
class Efforts:
    """The names that ports give to their efforts, while the equations of a model are read."""

    #: names of efforts that stand for a shared subexpression, or that nobody applies
    replaced: tuple[str, ...]
    #: what shared subexpressions stand for; efforts stand for themselves
    let: Mapping[str, sympy.Expr]
    #: what is put in the place of an effort once its coefficients are taken
    values: Mapping[sympy.Symbol, sympy.Expr]

    def names(self, known: tuple[str, ...]) -> tuple[str, ...]:
        """Return the names that an expression may contain."""
        return (*known, *self.replaced)

    def applied(self, expression: sympy.Expr, known: tuple[str, ...]) -> sympy.Expr:
        """Return an expression without the names of efforts."""
        if not self.values or not expression.free_symbols & set(self.values):
            return expression
        return as_expression(expression.xreplace(self.values), known, ("let",))

    def settled(self, items: Mapping, known: tuple[str, ...]) -> Mapping[str, sympy.Expr]:
        """Return expressions without the names of efforts."""
        if not self.values:
            return items
        return MappingProxyType({key: self.applied(each, known) for key, each in items.items()})


def read_let(let: Any, ports: Any, names: tuple[str, ...], inputs: Mapping[str, str]) -> Efforts:
    """Return the shared subexpressions, written out, and the names of efforts among them."""
    given = as_mapping("let", let or {})
    efforts = [name for name in _efforts_of(ports) if name not in inputs]
    replaced = tuple(dict.fromkeys(efforts))
    check_let({**given, **dict.fromkeys(replaced)}, names)
    found: dict[str, sympy.Expr] = {}
    values: dict[sympy.Symbol, sympy.Expr] = {
        symbol(name): sympy.Integer(0) for name in replaced if name not in given
    }
    for name, text in given.items():
        expression = as_expression(text, (*names, *replaced), ("let", name), found)
        found[name] = expression
        if name in replaced:
            found[name], values[symbol(name)] = symbol(name), expression.xreplace(values)
    return Efforts(replaced, found, values)


def _efforts_of(ports: Any) -> Iterator[str]:
    """Yield the names of efforts that ports give."""
    for name, given in as_mapping("ports", ports or {}).items():
        if isinstance(given, Mapping) and "effort" in given:
            effort = given["effort"]
            if not isinstance(effort, str):
                raise ModelError(
                    f"ports.{name}.effort: expected a name, got {effort!r}.", ("ports", name)
                )
            check_name(effort, "effort")
            yield effort


def check_let(let: Mapping[str, Any], names: tuple[str, ...]) -> None:
    """Raise `ModelError` unless every shared subexpression and effort has a name of its own."""
    taken = {same_name(name) for name in names}
    for name in let:
        check_name(name, "let")
        if same_name(name) in taken:
            raise ModelError(
                f"let {name!r}: the name is taken by another quantity of the model. Remedy: "
                f"rename one of them; an effort is an input, a name of 'let' or a new name.",
                ("let", name),
            )
        taken.add(same_name(name))


def read_ports(
    declared: Mapping[str, Any],
    parts: Mapping[str, Mapping],
    names: tuple[str, ...],
    efforts: Efforts,
) -> dict[str, Port]:
    """Return the ports of a model, from its parts that still have the names of the efforts."""
    reader = _PortReader(parts, names, efforts)
    plain = {str(name): given for name, given in declared.items()}
    return {name: reader.read(name, given) for name, given in plain.items()}


@dataclass(frozen=True)
class _PortReader:
    """Read the ports of a model whose equations still contain the names of the efforts."""

    #: parts of the model
    parts: Mapping[str, Mapping]
    names: tuple[str, ...]
    efforts: Efforts

    def read(self, name: str, given: Any) -> Port:
        """Return a port that is given as a `Port` or as names and values."""
        self.check_name(name, given)
        if isinstance(given, Port):
            given = {key: getattr(given, key) for key in _KEYS if key != "effort"}
        self.check(name, given)
        flow = self.expression(name, "flow", given["flow"])
        if not flow.free_symbols & set(map(symbol, self.parts["states"])):
            self.refuse(name, f"flow: expected a state, or a difference of two, got {flow}")
        return self.completed(name, flow, given)

    def completed(self, name: str, flow: sympy.Expr, given: Mapping) -> Port:
        """Return a port with its coefficients, its displacement and its unit."""
        effort = given.get("effort")
        displacement = self.displacement(name, flow, given)
        rates, outputs = self.taken(name, effort) if effort else self.told(name, flow, given)
        unit = as_text(str(given.get("unit") or ""), ("ports", name))
        unit = unit or self.parts["inputs"].get(effort, "")
        port = Port(name, flow, displacement, rates, outputs, unit)
        return port if unit else Port(name, flow, displacement, rates, outputs, self.unit(port))

    def check_name(self, name: str, given: Any) -> None:
        """Refuse a name that is none, or that of another quantity than the port's own flow."""
        check_name(name, "port")
        flow = getattr(given, "flow", None) or (isinstance(given, Mapping) and given.get("flow"))
        if name in {*self.names, *self.parts["outputs"]} and str(flow) != name:
            self.refuse(name, "the name is taken by another quantity", "choose another name")

    def check(self, name: str, given: Any) -> None:
        """Refuse what is no port."""
        if not isinstance(given, Mapping):
            self.refuse(name, f"expected names and values, got {given!r}")
        for key in given:
            if key not in _KEYS:
                self.refuse(name, f"unknown key {key!r}; expected {', '.join(_KEYS)}")
        if not given.get("flow"):
            self.refuse(name, "expected the flow conjugate to the effort, got none")
        if given.get("effort") and given.get("rates"):
            self.refuse(name, "expected either 'effort' or 'rates', got both")

    def refuse(self, name: str, why: str, remedy: str = "") -> NoReturn:
        """Raise `ModelError`."""
        advice = remedy or "name the effort and the flow, {effort: tau2, flow: w2}"
        raise ModelError(f"ports.{name}: {why}. Remedy: {advice}.", ("ports", name))

    def expression(self, name: str, key: str, given: Any) -> sympy.Expr:
        """Return an expression without efforts."""
        known = self.efforts.names(self.names)
        read = as_expression(given, known, ("ports", name, key), self.efforts.let)
        return self.efforts.applied(read, self.names)

    def told(self, name: str, flow: sympy.Expr, given: Mapping) -> tuple[dict, dict]:
        """Return the coefficients as they are given, or as the model's inertia gives them."""
        found = []
        for part, known in (("rates", self.parts["states"]), ("outputs", self.parts["outputs"])):
            check_keys(f"ports.{name}.{part}", given.get(part) or {}, known)
            slopes = dict(given.get(part) or {})
            found.append({k: self.expression(name, part, each) for k, each in slopes.items()})
        return found[0] or self.stated(name, flow), found[1]

    def stated(self, name: str, flow: sympy.Expr) -> dict[str, sympy.Expr]:
        """Return the rates by the inertia or capacity of all states in the flow."""
        held = {str(each) for each in flow.free_symbols} & set(self.parts["states"])
        for part in BALANCES:
            if held <= set(self.parts[part]):
                return rates_of_flow(self.parts[part], flow)
        self.refuse(name, "expected 'effort' or 'rates', got none, and no inertia of the flow")

    def taken(self, name: str, effort: str) -> tuple[dict, dict]:
        """Return the coefficients of an effort in the equations and in the outputs."""
        found = [
            {key: self.slope(name, effort, key, each) for key, each in part.items() if each.has(e)}
            for e in [symbol(effort)]
            for part in (self.parts["equations"], self.parts["outputs"])
        ]
        if not found[0]:
            self.refuse(
                name,
                f"the effort {effort!r} is in no equation",
                f"write {effort} into the equations where it acts, or give the port's 'rates'",
            )
        return found[0], {k: c for k, c in found[1].items() if c != self.shown(k, found[0])}

    def shown(self, output: str, rates: Mapping[str, sympy.Expr]) -> sympy.Expr:
        """Return the coefficient of an output that repeats rates as they are."""
        factors = {s: c for s, c in self.repeated.get(output, {}).items() if abs(c) == 1}
        return sympy.Add(*(c * rates.get(state, 0) for state, c in factors.items()))

    @property
    def repeated(self) -> dict[str, dict[str, sympy.Expr]]:
        """Factors of the rates that outputs repeat, with the names of the efforts in both."""
        constants = frozenset(map(symbol, self.parts["parameters"]))
        return repeated_rates(*(tuple(self.parts[p].items()) for p in _SHOWN), constants)

    def slope(self, name: str, effort: str, key: str, expression: sympy.Expr) -> sympy.Expr:
        """Return the coefficient of an effort in an expression; it must be linear in it."""
        slope = expression.diff(symbol(effort))
        if slope.has(symbol(effort)):
            self.refuse(
                name,
                f"the effort {effort!r} is not linear in the equation or output of {key!r}",
                "give the force or torque behind it a name in 'let', and make that the effort",
            )
        return as_expression(self.efforts.applied(slope, self.names), self.names, ("ports", name))

    def unit_of(self, expression: sympy.Expr) -> str:
        """Return the unit of an expression of states, inputs and parameters."""
        units = {**self.parts["states"], **self.parts["inputs"]}
        units |= {name: each.unit for name, each in self.parts["parameters"].items()}
        return unit_of(expression, lambda name: units.get(name, ""))

    def integral_of(self, flow: sympy.Expr) -> sympy.Expr | None:
        """Return the displacement of a flow whose velocities all have a position."""
        pairs = {rate: symbol(s) for s, rate in self.parts["equations"].items() if rate.is_Symbol}
        velocities = flow.free_symbols & set(map(symbol, self.parts["states"]))
        slopes = [flow.diff(v) for v in velocities]
        if not velocities <= set(pairs) or any(s.free_symbols & velocities for s in slopes):
            return None
        return flow.xreplace({v: pairs[v] for v in velocities})

    def displacement(self, name: str, flow: sympy.Expr, given: Mapping) -> sympy.Expr | None:
        """Return the displacement; an effect may bend its rate, so not all are checked."""
        if given.get("displacement") in (None, ""):
            return self.integral_of(flow)
        found = self.expression(name, "displacement", given["displacement"])
        if given.get("effort"):
            self.check_rate(name, flow, found)
        return found

    def check_rate(self, name: str, flow: sympy.Expr, found: sympy.Expr) -> None:
        """Refuse a displacement whose rate is not the flow."""
        slopes = (found.diff(symbol(s)) * rate for s, rate in self.parts["equations"].items())
        rate = sympy.Add(*(slope for slope in slopes if slope != 0))
        if sympy.expand(rate - flow) != 0:
            self.refuse(
                name,
                f"displacement: expected a quantity whose rate is {flow}, got {found}, whose "
                f"rate is {rate}",
                "correct it, or leave it out",
            )

    def unit(self, port: Port) -> str:
        """Return the unit of an effort, by the inertia that it moves."""
        mobility, flow = port.mobility, self.unit_of(port.flow)
        inertia = self.unit_of(1 / mobility) if mobility != 0 else ""
        if inertia and flow:
            return force_unit(inertia, flow)
        return EFFORTS.get(flow, "")
