"""Evidence in an equation of motion: the rate that a state lacks, over what it depends on.

Each way reads a `Case` and gives the evidence, or None where the records do not show it that way.
"""

import numpy as np
import sympy

from sklearn_pgnn.inspection.case import Case, effect_parameters
from sklearn_pgnn.inspection.curves import GRID, Evidence, Line, even_grid
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.physics.effects.rates import force_unit, is_velocity
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.simulation.pointwise import evaluate_samples


def over_rate(case: Case) -> Evidence | None:
    """Show the measured rate over the one without the cause, where the cause cuts just that."""
    state = case.target
    if state not in case.seen:
        return None
    free, samples = symbol("_free"), case.samples
    without = case.without.equations[state]
    law = case.full.equations[state].subs(without, free)
    own = {symbol(parameter.name): parameter.value for parameter in effect_parameters(case)}
    if not isinstance(law, sympy.Max | sympy.Min) or law.free_symbols - {*own, free}:
        return None
    x = samples.mean(without)
    grid, unit = even_grid(x), _rate_unit(case, state)
    cut = evaluate_samples(law.subs(own), {"_free": grid}, GRID)
    return Evidence(
        title=f"Rate of {state} over the rate without limit",
        x_label=label(f"{state}' without this cause", unit),
        y_label=label(f"{state}' as measured", unit),
        points=(x, samples.rate(state)),
        lines=(
            Line(grid, grid, "prior", "as the model has it"),
            Line(grid, cut, "extended", case.name),
        ),
        note=f"Every point is a moment of the records: how fast {state} changes, over how fast it "
        "would change without this cause.",
    )


def over_motion(case: Case) -> Evidence | None:
    """Show the missing force over what it depends on: velocity, position or the phase of a wave."""
    state, model = case.target, case.full
    if state not in case.seen or state not in model.equations:
        return None
    added = sympy.expand(model.equations[state] - case.without.equations[state])
    inertia = model.inertia.get(state)
    force = -added if inertia is None else -added * inertia
    over, x, law = _motion(case, added, force)
    scale = 1.0 if inertia is None else case.samples.value(inertia)
    unit = force_unit(model, state)
    what = _what_is_missing(model, state, unit)
    return Evidence(
        title=f"Missing {what} over {over}",
        x_label=label(over, "s" if TIME in added.free_symbols else model.unit(over)),
        y_label=label(f"{what} against {state}", unit),
        points=(x, -scale * case.missing_rate(state)),
        lines=(law,),
        note=f"Every point is a moment of the records: the {what} that the model without this "
        f"cause lacks. The line is the {case.name} as identified.",
    )


def _motion(case: Case, added, force) -> tuple[str, np.ndarray, Line]:
    """Say over what a force is shown, and give its values there and the law."""
    table, symbols = case.samples.table, added.free_symbols
    if TIME in symbols:
        period = 1.0 / next(p.value for p in effect_parameters(case) if p.unit == "Hz")
        x = table["t"] % period
        return "the time within a period", x, _law(case, force, "t", x)
    position = case.full.kinematic_pairs.get(case.target)
    memory = set(map(str, symbols)) & set(case.full.states) - set(case.without.states)
    over = position if position and (memory or symbol(position) in symbols) else case.target
    x = table[over]
    others = set(map(str, symbols)) & {*case.full.states, *case.full.inputs} - {over}
    return over, x, _course(case, force, x) if others else _law(case, force, over, x)


def over_correction(case: Case) -> Evidence | None:
    """Show the missing rate over what the new value of a parameter adds to it."""
    if case.target not in case.full.parameters:
        return None
    show = _over_correction if set(case.fields) == {"value"} else _drift
    for state in case.full.equations:
        change = case.full.equations[state]
        if state in case.seen and symbol(case.target) in change.free_symbols:
            return show(case, state)
    return None


def _drift(case, state):
    """Show the value that a parameter must have had, at the moments that tell most of it."""
    samples, name = case.samples, case.target
    slope = samples.mean(case.without.equations[state].diff(symbol(name)))
    value, (rate,) = case.full.parameters[name], effect_parameters(case)
    telling = np.abs(slope) > np.nanmedian(np.abs(slope))
    implied = samples.value(symbol(name)) + case.missing_rate(state) / slope
    t = samples.table["t"][telling]
    grid = even_grid(t)
    return Evidence(
        title=f"The value of {name} over time",
        x_label=label("t", "s"),
        y_label=label(name, value.unit),
        points=(t, implied[telling]),
        lines=(Line(grid, value.value * (1 + rate.value * grid), "extended", case.name),),
        note=f"Every point is a moment of the records: the {name} that would explain how {state} "
        "changed.",
    )


def _over_correction(case, state):
    rate, samples = case.full.equations[state], case.samples
    new = {case.target: case.full.parameters[case.target].value}
    added = samples.mean(rate, **new) - samples.mean(rate)
    grid, unit = even_grid(added), _rate_unit(case, state)
    return Evidence(
        title=f"Missing rate of {state} over what the new {case.target} adds",
        x_label=label(f"added by the new {case.target}", unit),
        y_label=label(f"missing in {state}'", unit),
        points=(added, case.missing_rate(state)),
        lines=(Line(grid, grid, "extended", f"{case.target} as identified"),),
        note=f"On the line, the new value of {case.target} adds just what was missing; with the "
        f"prior value all points would have to lie at zero height.",
    )


def _rate_unit(case: Case, state: str) -> str:
    return f"{case.full.unit(state)}/s".replace("/s/s", "/s^2")


def _what_is_missing(model, state: str, unit: str) -> str:
    if state not in model.inertia:
        return "deceleration" if is_velocity(model, state) else "rate"
    return "torque" if unit.replace("*", " ").endswith("N m") else "force"


def _law(case: Case, force, over: str, x) -> Line:
    """Evaluate a force over one quantity, the others at their medians."""
    grid = even_grid(x)
    table = {n: np.full(GRID, np.nanmedian(v)) for n, v in case.samples.table.items()}
    return Line(grid, case.samples.value(force, **{**table, over: grid}), "extended", case.name)


def _course(case: Case, force, x) -> Line:
    """Follow a force through the record where it is largest: it is no function of one quantity."""
    values, bounds = case.samples.value(force), case.records.windows.bounds
    record = np.searchsorted(bounds, np.argmax(np.abs(values)), side="right") - 1
    rows = slice(bounds[record], bounds[record + 1])
    return Line(x[rows], values[rows], "extended", case.name)
