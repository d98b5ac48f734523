"""The evidence for a cause, on the user's own records: what is missing without it, and its law.

Each function reads a `Case` and gives the evidence, or None where the records do not show it that
way; `find_evidence` takes the first that does.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy

from sklearn_pgnn.diagnosis.records import DiagnosisRecords
from sklearn_pgnn.inspection.balance import Samples, shown_states, starts
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.words import cause_name, missing_place
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.effects.inputs import ACTUATOR_STATES
from sklearn_pgnn.physics.effects.rates import force_unit, is_velocity, positions
from sklearn_pgnn.physics.expressions import TIME, parse_expression, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.windows import evaluate

GRID = 801


@dataclass(frozen=True)
class Line:
    """A curve of the evidence: its points, and whose it is."""

    x: np.ndarray
    y: np.ndarray
    whose: str
    label: str


@dataclass(frozen=True)
class Evidence:
    """What the records show of a cause.

    Parameters
    ----------
    title, x_label, y_label : str
        What is drawn.
    points : tuple of ndarray or None
        Abscissa and ordinate of the records' points.
    lines : tuple of Line
        What the models say.
    note : str
        One sentence: what to look at.
    """

    title: str
    x_label: str
    y_label: str
    points: tuple[np.ndarray, np.ndarray] | None
    lines: tuple[Line, ...]
    note: str


@dataclass(frozen=True)
class Case:
    """A cause, the extended model with it and without it, and the records.

    Parameters
    ----------
    records : DiagnosisRecords
        The records.
    full, without : PhysicsModel
        The extended model with all causes, and with all but this one, at the same values.
    effect, target : str
        The cause.
    fields : dict of str to str
        The model's name of every parameter of the effect.
    """

    records: DiagnosisRecords
    full: PhysicsModel
    without: PhysicsModel
    effect: str
    target: str
    fields: dict[str, str]

    @property
    def name(self) -> str:
        """The cause in words."""
        return cause_name(self.effect, self.target)

    @property
    def prior(self) -> PhysicsModel:
        """The model as it was given."""
        return self.records.fits["prior"].model

    @cached_property
    def samples(self) -> Samples:
        """The records with the parameters of both models."""
        return self._samples(self.without)

    def _samples(self, model) -> Samples:
        found = Samples.of(self.records, model, self.full)
        values = {name: p.value for name, p in self.full.parameters.items()}
        return Samples(self.records, model, {**values, **found.table})

    @property
    def seen(self) -> frozenset[str]:
        """The states that the records show."""
        return shown_states(self.prior)

    def missing_rate(self, state: str) -> np.ndarray:
        """Give the measured rate of a state minus the one without the cause."""
        samples = self.samples
        return samples.rate(state) - samples.mean(self.without.equations[state])


def find_evidence(diagnosis, cause) -> Evidence:
    """Give the evidence for a named cause.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis.
    cause : NamedCause
        One of its causes.

    Returns
    -------
    Evidence
        Points of the records and the law of the cause.
    """
    case = make_case(diagnosis, cause)
    found = (way(case) for way in WAYS)
    return next(evidence for evidence in found if evidence is not None)


def missing_evidence(diagnosis) -> Evidence:
    """Give the evidence for what has no name: its smoothed course over what its formula says.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis whose `missing_` is not None.

    Returns
    -------
    Evidence
        Points of the records, and the line on which the formula is right.
    """
    part, records = diagnosis.missing_, diagnosis.records_
    full = diagnosis.extended_model_ + part.effect
    known = (*full.states, *full.inputs)
    terms = (parse_expression(term, known) for term in part.effect.terms)
    said = sympy.Add(*(c * term for c, term in zip(part.effect.coefficients, terms, strict=True)))
    samples = Samples.of(records, diagnosis.extended_model_, diagnosis.extended_model_)
    x = samples.value(said)
    grid = _grid(x)
    return Evidence(
        title=f"What is missing in {missing_place(diagnosis)}",
        x_label=f"by the formula {part.formula}",
        y_label="as the records show it",
        points=(x, part.course),
        lines=(Line(grid, grid, "extended", "the formula"),),
        note="Every point is a moment of the records: the smoothed course of what is missing, over "
        "what its formula says. About the line, the formula describes it.",
    )


def known_effects(diagnosis) -> dict:
    """Give the effects that a diagnosis may name, by id."""
    return {effect.id: effect for effect in (*CATALOGUE, *(diagnosis.catalogue or ()))}


def make_case(diagnosis, cause) -> Case:
    """Build the extended model without a cause, and gather the records."""
    known = known_effects(diagnosis)
    full, without = diagnosis.extended_model_, diagnosis.model
    for other in diagnosis.causes_:
        if other is not cause:
            without = known[other.effect](other.target).apply(without)
    values = {n: p.value for n, p in full.parameters.items() if n in without.parameters}
    if cause.target in diagnosis.model.parameters:
        values.pop(cause.target)
    fields = known[cause.effect](cause.target).names()
    return Case(
        diagnosis.records_,
        full,
        without.with_parameters(**values),
        cause.effect,
        cause.target,
        {name: fields[name] for name in cause.parameters},
    )


# -- ways to show a cause --------------------------------------------------------------------------


def over_rate(case: Case) -> Evidence | None:
    """Show the measured rate over the one without the cause, where the cause cuts just that."""
    state = case.target
    if state not in case.seen:
        return None
    free, samples = symbol("_free"), case.samples
    without = case.without.equations[state]
    law = case.full.equations[state].subs(without, free)
    own = {symbol(parameter.name): parameter.value for parameter in _parameters(case)}
    if not isinstance(law, sympy.Max | sympy.Min) or law.free_symbols - {*own, free}:
        return None
    x = samples.mean(without)
    grid, unit = _grid(x), f"{case.full.unit(state)}/s".replace("/s/s", "/s^2")
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
        period = 1.0 / next(p.value for p in _parameters(case) if p.unit == "Hz")
        x = table["t"] % period
        return "the time within a period", x, _law(case, force, "t", x)
    position = positions(case.full).get(case.target)
    memory = set(map(str, symbols)) & set(case.full.states) - set(case.without.states)
    over = position if position and (memory or symbol(position) in symbols) else case.target
    x = table[over]
    others = set(map(str, symbols)) & {*case.full.states, *case.full.inputs} - {over}
    return over, x, _course(case, force, x) if others else _law(case, force, over, x)


def over_input(case: Case) -> Evidence | None:
    """Show the input that the machine behaves as if it had, over the commanded one."""
    if case.target not in case.full.inputs or _changes_in_time(case):
        return None
    acting = _acting_input(case)
    if acting is None:
        return None
    state, felt = acting
    u = case.samples.mean(symbol(case.target))
    grid = _grid(u)
    law = _seen_input(case, state, grid)
    unit = case.full.unit(case.target)
    return Evidence(
        title=f"What the machine feels of {case.target}",
        x_label=label(f"{case.target} as commanded", unit),
        y_label=label(f"{case.target} as felt", unit),
        points=(u, felt),
        lines=(
            Line(grid, grid, "prior", "as the model has it"),
            Line(grid, law, "extended", case.name),
        ),
        note=f"Every point is a moment of the records: the {case.target} that would explain the "
        f"measured motion, over the one that was commanded.",
    )


def over_time(case: Case) -> Evidence | None:
    """Show commanded and felt input about the largest change of the command."""
    if case.target not in case.full.inputs or not _changes_in_time(case):
        return None
    acting = _acting_input(case)
    if acting is None:
        return None
    _, felt = acting
    late = next(p for p in _parameters(case) if p.unit == "s")
    rows = _about_largest_change(case.records.windows, _column(case, case.target), late.value)
    t, unit = case.records.windows.t[rows], case.full.unit(case.target)
    commanded = _column(case, case.target)[rows]
    return Evidence(
        title=f"{case.target} about its largest change",
        x_label=label("t", "s"),
        y_label=label(case.target, unit),
        points=(t, felt[rows]),
        lines=(
            Line(t, commanded, "prior", "commanded"),
            Line(t, _late_input(case)[rows], "extended", f"with {case.name}"),
        ),
        note=f"The points are the {case.target} that would explain the measured motion: they "
        f"follow the command late.",
    )


def late_output(case: Case) -> Evidence | None:
    """Show what a late sensor shows about its quickest change."""
    if case.target not in case.full.outputs or not _changes_in_time(case):
        return None
    windows, column = case.records.windows, list(case.full.outputs).index(case.target)
    late, y = next(p for p in _parameters(case) if p.unit == "s"), windows.y[:, column]
    rows = _about_largest_change(windows, y, late.value)
    t, unit = windows.t[rows], case.prior.unit(case.target)
    at_once, with_delay = (
        (y - _window_residual(case, model)[:, column])[rows] for model in (case.without, case.full)
    )
    return Evidence(
        title=f"{case.target} about its quickest change",
        x_label=label("t", "s"),
        y_label=label(case.target, unit),
        points=(t, y[rows]),
        lines=(
            Line(t, at_once, "prior", "without delay"),
            Line(t, with_delay, "extended", f"with {case.name}"),
        ),
        note=f"The points are what {case.target} showed: it comes late.",
    )


def over_output(case: Case) -> Evidence | None:
    """Show the error of a sensor over what it should show."""
    if case.target not in case.full.outputs or case.target in case.full.equations:
        return None
    column = list(case.full.outputs).index(case.target)
    residual = _window_residual(case, case.without)[:, column]
    unit = case.prior.unit(case.target)
    true = case.records.windows.y[:, column] - residual
    added = residual - _window_residual(case, case.full)[:, column]
    order = np.argsort(true)
    return Evidence(
        title=f"Error of {case.target} over its true value",
        x_label=label(f"{case.target} as simulated without this cause", unit),
        y_label=label("measured minus simulated", unit),
        points=(true, residual),
        lines=(Line(true[order], added[order], "extended", case.name),),
        note="Every point is a sample of the records: what the sensor shows too much, over what "
        "it should show.",
    )


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
    value, (rate,) = case.full.parameters[name], _parameters(case)
    telling = np.abs(slope) > np.nanmedian(np.abs(slope))
    implied = samples.value(symbol(name)) + case.missing_rate(state) / slope
    t = samples.table["t"][telling]
    grid = _grid(t)
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
    grid, unit = _grid(added), f"{case.full.unit(state)}/s".replace("/s/s", "/s^2")
    return Evidence(
        title=f"Missing rate of {state} over what the new {case.target} adds",
        x_label=label(f"added by the new {case.target}", unit),
        y_label=label(f"missing in {state}'", unit),
        points=(added, case.missing_rate(state)),
        lines=(Line(grid, grid, "extended", f"{case.target} as identified"),),
        note=f"On the line, the new value of {case.target} adds just what was missing; with the "
        f"prior value all points would have to lie at zero height.",
    )


def residual_over_time(case: Case) -> Evidence:
    """Show what is left on the windows with and without the cause, where it matters most."""
    windows, column = case.records.windows, _worst_output(case)
    without = _window_residual(case, case.without)[:, column]
    left = case.records.fits["extended"].residual[:, column]
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
        note="The error on short windows, each started from the record, where the cause tells "
        "most; both models have the same parameters.",
    )


#: tried in this order; the last always answers
WAYS = (
    over_rate,
    over_motion,
    over_input,
    over_time,
    late_output,
    over_output,
    over_correction,
    residual_over_time,
)


# -- helpers ---------------------------------------------------------------------------------------


def _what_is_missing(model, state: str, unit: str) -> str:
    if state not in model.inertia:
        return "deceleration" if is_velocity(model, state) else "rate"
    return "torque" if unit.replace("*", " ").endswith("N m") else "force"


def _column(case: Case, name: str) -> np.ndarray:
    return case.records.windows.u[:, list(case.full.inputs).index(name)]


def _grid(x) -> np.ndarray:
    low, high = np.nanmin(x), np.nanmax(x)
    return np.linspace(low, high, GRID)


def _law(case: Case, force, over: str, x) -> Line:
    """Evaluate a force over one quantity, the others at their medians."""
    grid = _grid(x)
    table = {n: np.full(GRID, np.nanmedian(v)) for n, v in case.samples.table.items()}
    return Line(grid, case.samples.value(force, **{**table, over: grid}), "extended", case.name)


def _course(case: Case, force, x) -> Line:
    """Follow a force through the record where it is largest: it is no function of one quantity."""
    values, bounds = case.samples.value(force), case.records.windows.bounds
    record = np.searchsorted(bounds, np.argmax(np.abs(values)), side="right") - 1
    rows = slice(bounds[record], bounds[record + 1])
    return Line(x[rows], values[rows], "extended", case.name)


def _parameters(case: Case):
    """Give the parameters of the effect."""
    return [case.full.parameters[name] for name in case.fields.values()]


def _changes_in_time(case: Case) -> bool:
    return case.full.delays != case.without.delays or set(case.full.states) != set(
        case.without.states
    )


def _acting_input(case: Case):
    """Solve a state's equation without the cause for the input; None where it cannot be."""
    u = symbol(case.target)
    for state, rate in case.without.equations.items():
        slope = rate.diff(u)
        if state in case.seen and slope != 0 and u not in slope.free_symbols:
            samples = case.samples
            felt = samples.mean(u) + case.missing_rate(state) / samples.mean(slope)
            return state, felt
    return None


def _seen_input(case: Case, state: str, grid) -> np.ndarray:
    """Give what the extended model makes of the commanded input."""
    u = symbol(case.target)
    slope = case.without.equations[state].diff(u)
    seen = u + (case.full.equations[state] - case.without.equations[state]) / slope
    table = {n: np.full(GRID, np.nanmedian(v)) for n, v in case.samples.table.items()}
    return case.samples.value(seen, **{**table, case.target: grid})


def _late_input(case: Case) -> np.ndarray:
    """Give the input as it acts in the extended model: delayed, or lagged."""
    for ending in ACTUATOR_STATES:
        if case.target + ending in case.samples.table:
            return case.samples.table[case.target + ending]
    acting = case.records.windows.acting_inputs(case.full)
    return acting[:, list(case.full.inputs).index(case.target)]


def _about_largest_change(windows, u, late: float) -> slice:
    """Give some delays before and after the largest change of an input within a delay."""
    step = float(np.median(np.diff(windows.t)))
    reach = max(1, round(late / step))
    change = np.abs(u[reach:] - u[:-reach])
    for b in windows.bounds[1:-1]:
        change[max(b - reach, 0) : b] = 0.0
    at = int(np.argmax(change)) + reach // 2
    record = np.searchsorted(windows.bounds, at, side="right") - 1
    a, b = windows.bounds[record], windows.bounds[record + 1]
    width = max(4 * reach, 20)
    return slice(max(a, at - width), min(b, at + 2 * width))


def _window_residual(case: Case, model: PhysicsModel) -> np.ndarray:
    """Simulate the windows with or without the cause, from the initial states found with it."""
    return evaluate(model, case.records.windows, starts(case.records, model), ()).residual


def _worst_output(case: Case) -> int:
    scaled = _window_residual(case, case.without) / case.records.windows.scale
    return int(np.argmax(np.nanmean(scaled**2, axis=0)))


def _worst_rows(windows, residual, count: int = 6) -> slice:
    """Give some windows of one record about the one with the largest error."""
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
