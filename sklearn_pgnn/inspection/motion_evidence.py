"""Evidence in an equation of motion: the missing rate of a state against what it depends on.

Each function draws a `Characteristic` for a `Case`, or returns None where the records do not show
it.
"""

import numpy as np
import sympy

from sklearn_pgnn.inspection.case import Case
from sklearn_pgnn.inspection.curves import GRID, Evidence, Line, even_grid
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.derived_units import rate_unit
from sklearn_pgnn.physics.effects.rates import RateEffect, is_moving
from sklearn_pgnn.physics.expansion import expanded
from sklearn_pgnn.physics.expressions import TIME, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port, against, inertia_at
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.source import differentiate


def cut_rate(case: Case, curve: Characteristic) -> Evidence | None:
    """Return the measured rate against that without the cause, or the missing rate."""
    shown = _cut_rate(case, curve.of)
    return shown or missing_force(case, Characteristic("force", curve.of, symbol(curve.of)))


def _cut_rate(case: Case, state: str) -> Evidence | None:
    """Return the measured rate against that without the cause, where the cause limits just that."""
    if state not in case.seen:
        return None
    free, samples = symbol("_free"), case.samples
    without = case.without.equations[state]
    law = case.full.equations[state].subs(without, free)
    own = {symbol(parameter.name): parameter.value for parameter in case.parameters}
    if not law.has(free) or law.free_symbols - {*own, free}:
        return None
    x = samples.mean(without)
    grid, unit = even_grid(x), rate_unit(case.full.unit(state))
    cut = evaluate_samples(law.subs(own), {"_free": grid}, GRID)
    return Evidence(
        title=f"Rate of {state} over the rate without limit",
        x_label=label(f"{state}' without this cause", unit),
        y_label=label(f"{state}' as measured", unit),
        points=(x, samples.rate(state)),
        lines=(
            Line(grid, grid, "prior", "in the model"),
            Line(grid, cut, "extended", case.name),
        ),
        note=(
            f"Every point is a sample of the records: how fast {state} changes, over how fast it "
            f"would change without this cause."
        ),
    )


def missing_force(case: Case, curve: Characteristic) -> Evidence | None:
    """Return the missing force of a state's equation against the quantity it depends on."""
    model, port = case.full, _port_of(case.full, curve.of)
    if port is None or not case.shows(port) or curve.over is None:
        return None
    over, unit, x = _abscissa(case, curve)
    what = _what_is_missing(model, port)
    return Evidence(
        title=f"Missing {what} over {over}",
        x_label=label(over, unit),
        y_label=label(f"{what} {against(port, model)}", port.unit),
        points=(x, -case.missing_effort(port)),
        lines=(_law(case, _effort(case, port), curve.over, x),),
        note=(
            f"Every point is a sample of the records: the {what} that the model without this cause "
            f"lacks. The line is the {case.name} as identified."
        ),
    )


def _abscissa(case: Case, curve: Characteristic) -> tuple[str, str, np.ndarray]:
    """Return the abscissa of a curve: its name, its unit and its values in the records."""
    x = case.samples.value(curve.over)
    if curve.period is not None:
        return "the time within a period", "s", x % case.samples.value(curve.period)
    if curve.over == TIME:
        return "t", "s", x
    name = to_text(curve.over)
    return name, curve.unit or case.full.unit(name), x


def implied_parameter(case: Case, curve: Characteristic) -> Evidence | None:
    """Return the implied value of a parameter, or the change of a rate by its new value."""
    name = curve.of
    for state, rate in case.full.equations.items():
        if state in case.seen and symbol(name) in rate.free_symbols:
            if curve.over is None:
                return _over_correction(case, name, state)
            return _implied_value(case, curve, state)
    return None


def _implied_value(case: Case, curve: Characteristic, state: str) -> Evidence:
    """Return the implied value of a parameter, at the most informative moments."""
    samples, name = case.samples, curve.of
    slope = samples.mean(differentiate(case.without.equations[state], symbol(name)))
    over, unit, x = _abscissa(case, curve)
    telling = np.abs(slope) > np.nanmedian(np.abs(slope))
    missing = case.missing_rate(state)[telling] / slope[telling]
    implied = np.broadcast_to(samples.value(symbol(name)), slope.shape)[telling] + missing
    return Evidence(
        title=f"The value of {name} over {'time' if over == 't' else over}",
        x_label=label(over, unit),
        y_label=label(name, case.full.unit(name)),
        points=(x[telling], implied),
        lines=(_law(case, curve.law, curve.over, x[telling]),),
        note=(
            f"Every point is a sample of the records: the {name} that would explain how {state} "
            f"changed."
        ),
    )


def _over_correction(case: Case, name: str, state: str) -> Evidence:
    """Return the missing rate against the change of the rate by a parameter's new value."""
    rate, samples = case.full.equations[state], case.samples
    added = samples.mean(rate, **{name: case.full.parameters[name].value}) - samples.mean(rate)
    grid, unit = even_grid(added), rate_unit(case.full.unit(state))
    return Evidence(
        title=f"Missing rate of {state} over what the new {name} adds",
        x_label=label(f"added by the new {name}", unit),
        y_label=label(f"missing in {state}'", unit),
        points=(added, case.missing_rate(state)),
        lines=(Line(grid, grid, "extended", f"{name} as identified"),),
        note=(
            f"On the line, the new value of {name} adds exactly the missing rate; if the prior "
            f"value were right, all points would lie at zero."
        ),
    )


def _port_of(model: PhysicsModel, name: str) -> Port | None:
    """Return a port; for a position, which has none, that at which its rate changes."""
    if name in model.states and name not in model.ports:
        one, unit = sympy.Integer(1), rate_unit(model.unit(name))
        return Port(name, symbol(name), None, {name: one}, {}, unit)
    return model.ports.get(name)


def _effort(case: Case, port: Port) -> sympy.Expr:
    """Return the effort of a cause against the flow at a port."""
    if isinstance(case.effect, RateEffect):
        return case.effect.effort(case.without)
    state, mobility = next(iter(port.rates.items()))
    added = expanded(case.full.equations[state] - case.without.equations[state])
    return -added * (inertia_at(port, case.full) if len(port.rates) == 1 else 1 / mobility)


def _what_is_missing(model: PhysicsModel, port: Port) -> str:
    """Return the name of the effort at a port."""
    moving = is_moving(model, port)
    if not port.is_power(model):
        return "deceleration" if moving else "rate"
    if not moving:
        return "effort"
    return "torque" if port.unit.replace("*", " ").endswith("N m") else "force"


def _law(case: Case, expression, over, x) -> Line:
    """Return an expression as a curve over the abscissa, where it is a function of it."""
    along = symbol("_along")
    law = expression.subs(over, along)
    moving = {TIME, *map(symbol, (*case.full.states, *case.full.inputs))}
    if law.free_symbols & moving:
        return _course(case, expression, x)
    grid = even_grid(x)
    table = {name: p.value for name, p in case.full.parameters.items()}
    values = evaluate_samples(law, {**table, "_along": grid}, GRID)
    return Line(grid, values, "extended", case.name)


def _course(case: Case, expression, x) -> Line:
    """Return the trajectory of an expression in the record where it is largest."""
    values, windows = case.samples.value(expression), case.records.windows
    record = windows.record_at(np.argmax(np.abs(values)))
    rows = slice(windows.bounds[record], windows.bounds[record + 1])
    return Line(x[rows], values[rows], "extended", case.name)
