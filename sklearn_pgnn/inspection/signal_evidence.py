"""Evidence at an input or an output: the effective input of the machine, and the sensor's output.

Each function draws a `Characteristic` for a `Case`, or returns None where the records do not show
it.
"""

import numpy as np

from sklearn_pgnn.inspection.case import Case, window_residual
from sklearn_pgnn.inspection.curves import GRID, Evidence, Line, even_grid
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.simulation.source import differentiate


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
    return (_over_truth if curve.over is None else _output_in_time)(case, curve.of, column)


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
    windows, column = case.records.windows, _worst_output(case)
    without = window_residual(case, case.without)[:, column]
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


def _worst_output(case: Case) -> int:
    scaled = window_residual(case, case.without) / case.records.windows.scale
    return int(np.argmax(np.nanmean(scaled**2, axis=0)))


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
