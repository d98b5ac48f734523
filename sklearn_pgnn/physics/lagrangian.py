r"""Equations of motion from kinetic and potential energy, by Lagrange.

For coordinates :math:`q`, velocities :math:`v = \dot q`, kinetic energy :math:`T(q, v, t)`,
potential energy :math:`V(q, t)`, a dissipation function :math:`D` and generalised forces :math:`Q`

.. math:: M \dot v = Q - \frac{\partial D}{\partial v} - \frac{\partial V}{\partial q}
          + \frac{\partial T}{\partial q} - \frac{\partial p}{\partial q} v
          - \frac{\partial p}{\partial t}, \qquad
          p = \frac{\partial T}{\partial v}, \quad M = \frac{\partial p}{\partial v},

and the balance of energy follows [1]_:

.. math:: \frac{d}{dt} \bigl(v^T p - T + V\bigr) = v^T Q - v^T \frac{\partial D}{\partial v}
          + \frac{\partial}{\partial t}(V - T).

Where :math:`T` is quadratic in the velocities, :math:`v^T p - T = T`; where :math:`D` is, half the
dissipated power, it is Rayleigh's function. A potential of an input, such as that of a spring with
a moved end, stores :math:`V` at zero input; what the input adds is a force, and supplied.

References
----------
.. [1] H. Goldstein, C. Poole, J. Safko, "Classical Mechanics", 3rd ed., 2002, sections 1.5, 2.7.
"""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import sympy
from sympy.simplify.fu import TR8

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.declared_ports import declared_in, read_let
from sklearn_pgnn.physics.expressions import RATE, TIME, expanded, symbol
from sklearn_pgnn.physics.model_parts import (
    as_expression,
    as_mapping,
    as_parameters,
    check_keys,
)

#: what the model file's section ``lagrangian`` holds
ENERGIES = ("kinetic", "potential", "dissipation")
#: most sines and cosines in a product that is written by the sums of angles
MAX_WAVES = 8
SECTION = ("coordinates", *ENERGIES, "forces")


def lagrangian_parts(section: Mapping[str, Any], model: Mapping[str, Any]) -> dict[str, Any]:
    """Return the constructor's parts of a model of which a section gives the energies.

    >>> section = {"coordinates": {"q": "w"}, "kinetic": "w**2/2", "potential": "1 - cos(q)"}
    >>> parts = lagrangian_parts(section, {"states": {"q": "rad", "w": "rad/s"}})
    >>> parts["equations"], parts["inertia"], parts["forces"]
    ({'q': 'w'}, {'w': 1}, {'w': -sin(q)})
    """
    check_section(section)
    coordinates, inputs = section["coordinates"], model.get("inputs") or {}
    parameters = as_parameters(model.get("parameters") or {})
    _check_coordinates(coordinates, model)
    names = (*as_mapping("states", model["states"]), *inputs, *parameters)
    efforts = read_let(model.get("let"), declared_in(model.get("ports")), names, inputs)

    let = {**efforts.let, **_rates_of(efforts.let, coordinates)}

    def read(given: Any, *where: str) -> sympy.Expr:
        return as_expression(given, efforts.names(names), ("lagrangian", *where), let)

    kinetic, potential, dissipation = (read(section.get(part, 0), part) for part in ENERGIES)
    check_keys("lagrangian.forces", section.get("forces"), coordinates)
    given = section.get("forces") or {}
    acting = {name: read(force, "forces", name) for name, force in given.items()}
    _check_signals(kinetic, "kinetic", (*coordinates, *coordinates.values()), parameters)
    _check_signals(potential, "potential", (*coordinates, *inputs), parameters)
    motion = _Motion(coordinates, kinetic, potential, dissipation, acting, inputs)
    found = {"equations": coordinates, "inertia": motion.inertia(), "forces": motion.forces()}
    together = {part: {**(model.get(part) or {}), **items} for part, items in found.items()}
    return {**model, **together, "energy": motion.energy()}


def _rates_of(
    let: Mapping[str, sympy.Expr], coordinates: Mapping[str, str]
) -> dict[str, sympy.Expr]:
    """Return what ``der`` of a coordinate, or of a place that depends on some, stands for."""
    moving = {symbol(q): symbol(v) for q, v in coordinates.items()}
    places = {name: e for name, e in let.items() if not e.free_symbols & set(moving.values())}
    rates = {
        name: sympy.Add(e.diff(TIME), *(_slope(e, q) * v for q, v in moving.items()))
        for name, e in {**places, **{str(q): q for q in moving}}.items()
    }
    return {f"{RATE}({name})": rate for name, rate in rates.items()}


def check_section(section: Mapping[str, Any]) -> None:
    """Raise `ModelError` unless a section has the keys that it needs, and no other."""
    check_keys("lagrangian", section, SECTION)
    missing = [key for key in ("coordinates", "kinetic") if key not in section]
    if missing:
        raise ModelError(
            f"lagrangian: expected the key {missing[0]!r}, got {', '.join(section) or 'none'}. "
            f"Remedy: give coordinates with their velocities, and the kinetic energy.",
            ("lagrangian",),
        )


class _Motion:
    """Coordinates, energies and forces, by the equations above."""

    def __init__(
        self,
        coordinates: Mapping[str, str],
        kinetic: sympy.Expr,
        potential: sympy.Expr,
        dissipation: sympy.Expr,
        acting: Mapping[str, sympy.Expr],
        inputs: Iterable[str],
    ):
        self.q = [symbol(name) for name in coordinates]
        self.v = [symbol(name) for name in coordinates.values()]
        self.kinetic, self.dissipation = kinetic, dissipation
        at_rest = dict.fromkeys(map(symbol, inputs), sympy.Integer(0))
        self.stored = potential.xreplace(at_rest)
        moved = [tidy(_slope(self.stored - potential, q)) for q in self.q]
        self.acting = [
            acting.get(str(q), 0) + force for q, force in zip(self.q, moved, strict=True)
        ]
        self.momenta = [_slope(kinetic, v) for v in self.v]

    def inertia(self) -> dict[str, Any]:
        """Return the Hessian of the kinetic energy: rows, or single entries if it is diagonal."""
        rows = [[tidy(_slope(p, v)) for v in self.v] for p in self.momenta]
        for i, (q, v) in enumerate(zip(self.q, self.v, strict=True)):
            if rows[i][i] == 0:
                raise ModelError(
                    f"lagrangian.kinetic: expected an energy in which every velocity stands as a "
                    f"square, got none of {str(v)!r}. Remedy: give the coordinate {str(q)!r} its "
                    f"mass or inertia, or take it out of 'coordinates'.",
                    ("lagrangian", "kinetic"),
                )
        apart = all(e == 0 for i, row in enumerate(rows) for j, e in enumerate(row) if i != j)
        entries = [row[i] for i, row in enumerate(rows)] if apart else rows
        return dict(zip(map(str, self.v), entries, strict=True))

    def forces(self) -> dict[str, sympy.Expr]:
        """Return the right-hand sides."""
        return {str(v): self._force(i) for i, v in enumerate(self.v)}

    def _force(self, i: int) -> sympy.Expr:
        momentum, q, v = self.momenta[i], self.q[i], self.v[i]
        along = [_slope(momentum, other) * w for other, w in zip(self.q, self.v, strict=True)]
        of_motion = tidy(_slope(self.kinetic, q) - sympy.Add(*along, _slope(momentum, TIME)))
        fields = _slope(self.stored, q) + _slope(self.dissipation, v)
        return self.acting[i] + of_motion - fields

    def energy(self) -> dict[str, sympy.Expr]:
        """Return what is stored, supplied and dissipated."""
        twice = self._power(self.kinetic)
        by_time = _slope(self.stored - self.kinetic, TIME)
        supplied = sympy.Add(*(f * v for f, v in zip(self.acting, self.v, strict=True)))
        parts = {
            "stored": twice - self.kinetic + self.stored,
            "supplied": supplied + by_time,
            "dissipated": self._power(self.dissipation),
        }
        return {part: power for part, power in parts.items() if part == "stored" or power != 0}

    def _power(self, function: sympy.Expr) -> sympy.Expr:
        r"""Return :math:`v^T \partial F/\partial v`: twice the function where it is quadratic."""
        power = sympy.Add(*(v * _slope(function, v) for v in self.v))
        return 2 * function if expanded(power - 2 * function) == 0 else power


def _slope(function: sympy.Expr, by: sympy.Symbol) -> sympy.Expr:
    """Differentiate; a step of height one is written by a sign."""
    slope = sympy.diff(function, by)
    if slope.has(sympy.DiracDelta, sympy.Derivative, sympy.Subs):
        raise ModelError(
            f"lagrangian: expected energies with a mass and forces that are finite, got one that "
            f"jumps, or bends sharply, in {str(by)!r}. Remedy: leave abs, max, min, sign and floor "
            f"of velocities to the dissipation and the forces.",
            ("lagrangian",),
        )
    return slope.rewrite(sympy.Heaviside, sympy.sign) if slope.has(sympy.Heaviside) else slope


def tidy(expression: sympy.Expr) -> sympy.Expr:
    """Return the shortest form that multiplying out, and the sums of angles, give."""
    plain = expanded(expression)
    forms = [expression, plain]
    if 0 < max(map(_waves, sympy.Add.make_args(plain))) <= MAX_WAVES:
        forms.append(expanded(TR8(plain)))
    return min(forms, key=sympy.count_ops)


def _waves(term: sympy.Expr) -> int:
    """Return a bound of the sines and cosines in a product: their sums have two to its power."""
    if isinstance(term, sympy.sin | sympy.cos):
        return 1
    power = abs(int(term.exp)) if term.is_Pow and term.exp.is_Integer else 1
    return power * sum(map(_waves, term.args))


def _check_coordinates(coordinates: Mapping[str, str], model: Mapping[str, Any]) -> None:
    """Raise `ModelError` unless coordinates and velocities are states, each of them once."""
    where = "lagrangian.coordinates"
    pairs = as_mapping(where, coordinates)
    named = [*pairs, *pairs.values()]
    strange = [n for n in named if n not in model["states"] or named.count(n) > 1]
    if strange or not pairs:
        raise ModelError(
            f"{where}: expected for every coordinate, a state, its velocity, another state, got "
            f"{repr(strange[0]) if strange else 'none'}. Remedy: list both among 'states', "
            f"and each once here.",
            ("lagrangian", "coordinates"),
        )
    for part in ("equations", "inertia", "forces"):
        given = [name for name in named if name in (model.get(part) or {})]
        if given:
            raise ModelError(
                f"{part}.{given[0]}: follows from 'lagrangian', and is given twice. Remedy: leave "
                f"it out of {part!r}.",
                (part, given[0]),
            )


def _check_signals(
    energy: sympy.Expr, part: str, signals: Collection[str], parameters: Collection[str]
) -> None:
    """Raise `ModelError` where an energy contains what the balance has no rate of."""
    strange = {s.name for s in energy.free_symbols - {TIME}} - {*signals, *parameters}
    if strange:
        raise ModelError(
            f"lagrangian.{part}: expected an energy of {', '.join(signals)}, parameters and t, got "
            f"{min(strange)!r} in it. Remedy: describe what it does by lagrangian.forces.",
            ("lagrangian", part),
        )
