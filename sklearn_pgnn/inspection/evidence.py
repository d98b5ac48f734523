"""The evidence for a cause in the user's records: the missing part without it, and its law."""

from dataclasses import dataclass

import numpy as np
import sympy

from sklearn_pgnn.inspection.case import Case, Samples, make_case, window_residual
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.words import place_name
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effects.rates import RateEffect, is_moving
from sklearn_pgnn.physics.expressions import TIME, expanded, parse_expression, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_units import rate_unit
from sklearn_pgnn.physics.places import unit_at
from sklearn_pgnn.physics.port import Port, against, inertia_at
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.source import differentiate

GRID = 801


@dataclass(frozen=True)
class Line:
    """A curve of the evidence: its points, and the model it belongs to."""

    x: np.ndarray
    y: np.ndarray
    whose: str
    label: str


@dataclass(frozen=True)
class Evidence:
    """The evidence for a cause: the records' points, the models' curves, and what to look at."""

    title: str
    x_label: str
    y_label: str
    points: tuple[np.ndarray, np.ndarray] | None
    lines: tuple[Line, ...]
    note: str


def even_grid(x) -> np.ndarray:
    """Return evenly spaced values over the range of some points."""
    low, high = np.nanmin(x), np.nanmax(x)
    return np.linspace(low, high, GRID)


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
    what = effort_name(model, port)
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


def effort_name(model: PhysicsModel, port: Port) -> str:
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


def felt_input(case: Case, curve: Characteristic) -> Evidence | None:
    """Return the effective input of the machine against the commanded one, or over time."""
    acting = _acting_input(case, curve.of)
    if acting is None:
        return None
    state, felt = acting
    if curve.over is None:
        return _over_command(case, curve.of, state, felt)
    return _input_in_time(case, curve.of, felt)


def _over_command(case: Case, name: str, state: str, felt) -> Evidence:
    """Return the effective input against the commanded one."""
    u = case.samples.mean(symbol(name))
    grid, unit = even_grid(u), case.full.unit(name)
    return Evidence(
        title=f"Effective {name}",
        x_label=label(f"{name} as commanded", unit),
        y_label=label(f"effective {name}", unit),
        points=(u, felt),
        lines=(
            Line(grid, grid, "prior", "in the model"),
            Line(grid, _seen_input(case, name, state, grid), "extended", case.name),
        ),
        note=(
            f"Every point is a sample of the records: the {name} that would explain the measured "
            f"motion, over the one that was commanded."
        ),
    )


def _input_in_time(case: Case, name: str, felt) -> Evidence:
    """Return commanded and effective input around the largest change of the command."""
    rows = _about_largest_change(case.records.windows, _column(case, name), _lateness(case))
    t, unit = case.records.windows.t[rows], case.full.unit(name)
    return Evidence(
        title=f"{name} around its largest change",
        x_label=label("t", "s"),
        y_label=label(name, unit),
        points=(t, felt[rows]),
        lines=(
            Line(t, _column(case, name)[rows], "prior", "commanded"),
            Line(t, _late_input(case, name)[rows], "extended", f"with {case.name}"),
        ),
        note=(
            f"The points are the {name} that would explain the measured motion: they follow the "
            f"command with a delay."
        ),
    )


def shown_output(case: Case, curve: Characteristic) -> Evidence:
    """Return the error of a sensor against the true output, or its output over time."""
    column = list(case.full.outputs).index(curve.of)
    draw = _over_truth if curve.over is None else _output_in_time
    return draw(case, curve.of, column)


def _output_in_time(case: Case, name: str, column: int) -> Evidence:
    """Return the output of a delayed sensor around its quickest change."""
    windows = case.records.windows
    y = windows.y[:, column]
    rows = _about_largest_change(windows, y, _lateness(case))
    t, unit = windows.t[rows], case.prior.unit(name)
    at_once, late = (
        (y - window_residual(case, model)[:, column])[rows] for model in (case.without, case.full)
    )
    return Evidence(
        title=f"{name} around its fastest change",
        x_label=label("t", "s"),
        y_label=label(name, unit),
        points=(t, y[rows]),
        lines=(
            Line(t, at_once, "prior", "without delay"),
            Line(t, late, "extended", f"with {case.name}"),
        ),
        note=f"The points are the readings of {name}: they are delayed.",
    )


def _over_truth(case: Case, name: str, column: int) -> Evidence:
    """Return the error of a sensor against the true output."""
    residual = window_residual(case, case.without)[:, column]
    unit = case.prior.unit(name)
    true = case.records.windows.y[:, column] - residual
    added = residual - window_residual(case, case.full)[:, column]
    order = np.argsort(true)
    return Evidence(
        title=f"Error of {name} over its true value",
        x_label=label(f"{name} as simulated without this cause", unit),
        y_label=label("measured minus simulated", unit),
        points=(true, residual),
        lines=(Line(true[order], added[order], "extended", case.name),),
        note=(
            "Every point is a sample of the records: the error of the sensor over the value that "
            "it should show."
        ),
    )


def residual_over_time(case: Case) -> Evidence:
    """Return the residuals over windows with and without the cause, where it matters most."""
    windows, errors = case.records.windows, window_residual(case, case.without)
    column = int(np.argmax(np.nanmean((errors / windows.scale) ** 2, axis=0)))
    without = errors[:, column]
    left = case.records.fits[case.records.best].residual[:, column]
    rows = _worst_rows(windows, without)
    name = list(case.full.outputs)[column]
    t = windows.t[rows]
    return Evidence(
        title=f"Error of {name} with and without the cause",
        x_label=label("t", "s"),
        y_label=label(f"error of {name}", case.prior.unit(name)),
        points=None,
        lines=(
            Line(t, without[rows], "prior", f"without {case.name}"),
            Line(t, left[rows], "extended", f"with {case.name}"),
        ),
        note=(
            "The error on short windows, each started from the record, where the cause has most "
            "effect; both models have the same parameters."
        ),
    )


def _column(case: Case, name: str) -> np.ndarray:
    return case.records.windows.u[:, list(case.full.inputs).index(name)]


def _lateness(case: Case) -> float:
    """Return the longest time constant of the effect [s], a step where it has none."""
    step = float(np.median(np.diff(case.records.windows.t)))
    return max((p.value for p in case.parameters if p.unit == "s"), default=step)


def _acting_input(case: Case, name: str):
    """Solve a state's equation without the cause for the input; None where that is impossible."""
    u = symbol(name)
    for state, rate in case.without.equations.items():
        slope = differentiate(rate, u)
        if state in case.seen and slope != 0 and u not in slope.free_symbols:
            samples = case.samples
            felt = samples.mean(u) + case.missing_rate(state) / samples.mean(slope)
            return state, felt
    return None


def _seen_input(case: Case, name: str, state: str, grid) -> np.ndarray:
    """Return the input that the extended model computes from the commanded one."""
    u = symbol(name)
    slope = differentiate(case.without.equations[state], u)
    seen = u + (case.full.equations[state] - case.without.equations[state]) / slope
    table = {n: np.full(GRID, np.nanmedian(v)) for n, v in case.samples.table.items()}
    return case.samples.value(seen, **{**table, name: grid})


def _late_input(case: Case, name: str) -> np.ndarray:
    """Return the input as it acts in the extended model: delayed, or lagged."""
    for state, followed in case.full.settled.items():
        if followed == name and state not in case.without.states:
            return case.samples.table[state]
    acting = case.records.windows.acting_inputs(case.full)
    return acting[:, list(case.full.inputs).index(name)]


def _about_largest_change(windows, u, late: float) -> slice:
    """Return some delays before and after the largest change of an input within a delay."""
    step = float(np.median(np.diff(windows.t)))
    reach = max(1, round(late / step))
    change = np.abs(u[reach:] - u[:-reach])
    for b in windows.bounds[1:-1]:
        change[max(b - reach, 0) : b] = 0.0
    at = int(np.argmax(change)) + reach // 2
    record = windows.record_at(at)
    a, b = windows.bounds[record], windows.bounds[record + 1]
    width = max(4 * reach, 20)
    return slice(max(a, at - width), min(b, at + 2 * width))


def _worst_rows(windows, residual, count: int = 6) -> slice:
    """Return some windows of one record about the one with the largest error."""
    power = [
        np.nansum(residual[a : a + n] ** 2)
        for a, n in zip(windows.starts, windows.lengths, strict=True)
    ]
    worst = int(np.argmax(power))
    near = [
        w
        for w in range(max(0, worst - count // 2), min(len(windows), worst + count // 2 + 1))
        if windows.record[w] == windows.record[worst]
    ]
    return slice(windows.starts[near[0]], windows.starts[near[-1]] + windows.lengths[near[-1]])


#: function that computes each kind of characteristic; None where the records do not show it
DRAWN = {
    "force": missing_force,
    "rate": cut_rate,
    "input": felt_input,
    "output": shown_output,
    "parameter": implied_parameter,
}


def find_evidence(diagnosis, cause) -> Evidence:
    """Return the evidence for a named cause: the characteristic that its effect declares."""
    return evidence_of(make_case(diagnosis, cause))


def evidence_of(case: Case) -> Evidence:
    """Return the evidence for the cause of a case."""
    curve = case.effect.characteristic(case.full)
    drawn = None if curve is None else DRAWN[curve.shows](case, curve)
    return residual_over_time(case) if drawn is None else drawn


def missing_evidence(diagnosis) -> Evidence:
    """Return the evidence for a formula: what the records show at its place, against its value.

    With the formula's value :math:`g(x)` and what is left beside it :math:`d`, the points are
    :math:`(g, g + d)`: partial residuals, with the parameters that were fitted with the formula.
    """
    part = diagnosis.discrepancy_
    said = said_by_formula(diagnosis)
    unit = unit_at(part.model, part.target)
    grid = even_grid(said)
    return Evidence(
        title=f"What is missing in {place_name(diagnosis.model, part.target)}",
        x_label=label("by the formula", unit),
        y_label=label("as the records show it", unit),
        points=(said, said + part.left),
        lines=(Line(grid, grid, "extended", "the formula"),),
        note=(
            "Every point is a sample of the records: what is missing beside the parameters fitted "
            "with the formula, smoothed, over the value of the formula. Points on the line are "
            "described by it."
        ),
    )


def said_by_formula(diagnosis) -> np.ndarray:
    """Return the value of a diagnosis' formula at every sample of its records."""
    part = diagnosis.discrepancy_
    known = (*part.model.states, *part.model.inputs)
    terms = (parse_expression(term, known) for term in part.effect.terms)
    said = sympy.Add(*(c * term for c, term in zip(part.effect.coefficients, terms, strict=True)))
    return Samples.of(diagnosis.records_, part.model, part.model).value(said)
