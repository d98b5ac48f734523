"""The evidence in a report: characteristics of causes, maps and tests of what is left."""

from dataclasses import replace

import numpy as np
from markupsafe import Markup
from scipy.stats import norm

from sklearn_pgnn.inspection.case import Case, Samples, make_case, missing_rate_of
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.display import binned_median, known_points, limits
from sklearn_pgnn.inspection.evidence import (
    Evidence,
    Line,
    effort_name,
    evidence_of,
    missing_evidence,
    said_by_formula,
)
from sklearn_pgnn.inspection.numbers import number
from sklearn_pgnn.inspection.report.causes import Member
from sklearn_pgnn.inspection.report.formula import FoundFormula
from sklearn_pgnn.inspection.run_displays import ResidualDisplay, expected_autocorrelation
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.svg import Plot, Scale
from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.model_units import rate_unit
from sklearn_pgnn.physics.places import is_effort
from sklearn_pgnn.physics.port import inertia_at
from sklearn_pgnn.physics.shown_states import shown_states

#: points of a cloud that are drawn
CLOUD = 1500
#: what a map shows first
SHOWN = "as the records show it"
#: cells of a side, samples that a cell needs, and shades of a colour
CELLS, LEAST, SHADES = 34, 3, 8
#: bins of the histogram, and how far it reaches in standard deviations
BINS, REACH = 41, 4.0


def characteristics(diagnosis, members: dict[int, list[Member]]) -> list[dict]:
    """Return the characteristics of the causes, and of what no cause explains."""
    drawn = []
    for place, cause in enumerate(diagnosis.causes_):
        case = make_case(diagnosis, cause)
        evidence, rivals = evidence_of(case), members.get(place, [])[1:]
        beside = [line for rival in rivals for line in _beside(evidence, case, rival)]
        drawn.append(_draw(cause_name(cause.effect, cause.target), evidence, beside))
    if diagnosis.discrepancy_ is not None:
        drawn.append(_draw("what no cause explains", missing_evidence(diagnosis), []))
    return drawn


def _beside(evidence: Evidence, case: Case, rival: Member) -> list[Line]:
    """Return the law of a rival, where it is drawn over the same."""
    model = rival.fit.model
    if list(model.states) != list(case.full.states):
        return []
    known = {n: p.value for n, p in model.parameters.items() if n in case.without.parameters}
    records = replace(case.records, fits={**case.records.fits, "extended": rival.fit})
    other = evidence_of(Case(records, model, case.without.with_parameters(**known), rival.effect))
    if (other.x_label, other.y_label) != (evidence.x_label, evidence.y_label):
        return []
    return [replace(other.lines[-1], whose="rival", label=rival.name)]


def _draw(name: str, evidence: Evidence, beside: list[Line]) -> dict:
    """Return a characteristic as it is drawn; its legend has class and name of everything."""
    lines = [*beside, *evidence.lines]
    legend = [(line.whose, line.label) for line in lines]
    x_values, y_values = [line.x for line in evidence.lines], [line.y for line in lines]
    if evidence.points is not None:
        x, y = known_points(*evidence.points)
        x_values.append(x)
        y_values = [np.array(limits(y, lines))]
    plot = Plot(Scale.over(*x_values, room=0.02), Scale.over(*y_values, room=0.02), evidence.title)
    if evidence.points is not None:
        few = slice(None, None, max(1, x.size // CLOUD))
        plot.points(x[few], y[few], "cloud", "records")
        legend.insert(0, ("cloud", "records"))
    for line in lines:
        plot.line(line.x, line.y, line.whose, line.label)
    if evidence.points is not None and np.any(np.diff(x) <= 0):
        plot.points(*binned_median(x, y), "median", "their median")
        legend.append(("median", "their median"))
    return {
        "name": name,
        "title": evidence.title,
        "x_label": evidence.x_label,
        "y_label": evidence.y_label,
        "note": evidence.note,
        "legend": legend,
        "plot": plot.html(),
    }


def residual_maps(diagnosis, formula: FoundFormula | None) -> list[dict]:
    """Return the maps of what is missing."""
    if formula is not None:
        return [_of_formula(diagnosis, formula)]
    prior, model, records = diagnosis.model, diagnosis.extended_model_, diagnosis.records_
    samples, residual = Samples.of(records, model, model), records.fits["extended"].residual
    seen, positions = shown_states(prior), set(prior.kinematic_pairs.values())
    flows = {name: {*map(str, port.flow.free_symbols)} for name, port in prior.ports.items()}
    at = [n for n, flow in flows.items() if flow & {*prior.states} <= seen and n not in positions]
    if at:
        return [_of_port(diagnosis, samples, name) for name in at]
    return [
        _maps(diagnosis, samples, f"Error of {o}", prior.unit(o), o, [(SHOWN, residual[:, i])])
        for i, o in enumerate(prior.outputs)
    ]


def _of_formula(diagnosis, formula: FoundFormula) -> dict:
    target, samples, left = formula.part.target, formula.samples, formula.part.left
    said = said_by_formula(diagnosis)
    panels = [(SHOWN, said + left), ("what the formula says", said), ("left over", left)]
    is_rate = target in formula.model.states and not is_effort(formula.model, target)
    title = f"Missing in {target}" + ("'" if is_rate else "")
    return _maps(diagnosis, samples, title, formula.unit, target, panels)


def _of_port(diagnosis, samples: Samples, name: str) -> dict:
    model = diagnosis.extended_model_
    port = model.port(name)
    missing = missing_rate_of(
        port, model, lambda state: samples.rate(state) - samples.mean(model.equations[state])
    )
    if not port.is_power(model):
        unit, panels = rate_unit(model.unit(name)), [("by the records", missing)]
        return _maps(diagnosis, samples, f"Missing in {name}'", unit, name, panels)
    force = missing * samples.value(inertia_at(port, model))
    place = f"on {name}" if name in model.states else f"at the {name}"
    title = f"{effort_name(model, port).capitalize()} that is missing {place}"
    return _maps(diagnosis, samples, title, port.unit, name, [(SHOWN, force)])


def _maps(diagnosis, samples: Samples, title, unit, target, panels) -> dict:
    over = telling_quantities(diagnosis, target)
    axes = [samples.value(symbol(name)) if name != "t" else samples.table["t"] for name in over]
    names = [label(n, "s" if n == "t" else diagnosis.extended_model_.unit(n)) for n in over]
    grids = [_grid(axis) for axis in axes]
    cells = [_cells(np.asarray(values, dtype=float), axes, *grids) for _, values in panels]
    most = max(
        float(np.percentile(np.abs(found), 98)) if found.size else 0.0 for *_, found in cells
    )
    drawn = [
        _panel(f"{title}: {what}", what, each, grids, most, unit)
        for (what, _), each in zip(panels, cells, strict=True)
    ]
    return {"title": title, "x_label": names[0], "y_label": names[1], "panels": drawn}


def telling_quantities(diagnosis, target: str) -> tuple[str, str]:
    """Return the two quantities over which what is missing at a place is mapped."""
    model, part = diagnosis.extended_model_, diagnosis.discrepancy_
    known = [*model.states, *model.inputs]
    told = [] if part is None else list(part.quantities)
    told += [name for name in diagnosis.remaining_.law.depends_on if name in known]
    port = model.ports.get(target)
    at = (target,) if port is None else (port.position, to_text(port.flow))
    own = [name for name in at if name in known]
    every = list(dict.fromkeys([*told, *own, *known, "t"]))
    first, second = every[:2]
    order = {name: place for place, name in enumerate(own)}
    return tuple(sorted((first, second), key=lambda name: order.get(name, -1)))


def _panel(title: str, what: str, cells, grids, most: float, unit: str) -> dict:
    """Draw one of the maps that share a scale; what is less than half a shade stays blank."""
    (x, y), (rows, columns, found) = grids, cells
    plot = Plot(Scale(x[0], x[-1]), Scale(y[0], y[-1]), title, "map")
    plot.band(y[0], y[-1], "ground")
    shade = np.rint(np.clip(np.abs(found) / (most or 1.0), 0, 1) * SHADES).astype(int)
    for css, sign in (("above", 1), ("below-zero", -1)):
        for level in range(1, SHADES + 1):
            chosen = (shade == level) & (np.sign(found) == sign)
            if chosen.any():
                corners = x[columns[chosen]], y[rows[chosen]]
                plot.cells(*corners, x[1] - x[0], y[1] - y[0], css, level / SHADES)
    said = label(f"±{number(most, 2)}", unit).replace("[", "").replace("]", "").replace(" -", "")
    return {"title": what, "scale": said, "plot": plot.html()}


def _grid(values) -> np.ndarray:
    low, high = np.nanpercentile(values, [0.5, 99.5])
    reach = (high - low) or 1.0
    return np.linspace(low - 0.01 * reach, high + 0.01 * reach, CELLS + 1)


def _cells(values, axes, x, y):
    """Return row, column and median of every cell that holds enough samples."""
    column, row = (np.digitize(axis, grid) - 1 for axis, grid in zip(axes, (x, y), strict=True))
    inside = np.isfinite(values) & (column >= 0) & (column < CELLS) & (row >= 0) & (row < CELLS)
    key = row[inside] * CELLS + column[inside]
    order = np.argsort(key, kind="stable")
    key, sorted_values = key[order], values[inside][order]
    cells, first, count = np.unique(key, return_index=True, return_counts=True)
    full = count >= LEAST
    medians = np.array(
        [np.median(sorted_values[a : a + n]) for a, n in zip(first[full], count[full], strict=True)]
    )
    return cells[full] // CELLS, cells[full] % CELLS, medians


def residual_tests(diagnosis) -> dict[str, list[dict]]:
    """Return by output the tests of what the model with all that was found leaves over windows."""
    records = diagnosis.records_
    windows = records.windows
    fit = records.fits[records.best]
    rows = [slice(a, a + n) for a, n in zip(windows.starts, windows.lengths, strict=True)]
    lags = int(min(25, np.median(windows.lengths) // 3))
    inputs = {n: [windows.u[r, i] for r in rows] for i, n in enumerate(diagnosis.model.inputs)}
    expected, found = expected_autocorrelation(records, fit, lags), {}
    for column, output in enumerate(diagnosis.model.outputs):
        residuals, about = [fit.residual[r, column] for r in rows], expected[:, column]
        display = ResidualDisplay(residuals, inputs, output=output, n_lags=lags, expected=about)
        found[output] = _tests(display, np.concatenate(residuals), output)
    return found


def _tests(display: ResidualDisplay, residual, output: str) -> list[dict]:
    later, lag = display.lags_ > 0, "lag [samples]"
    auto = _stems(
        display,
        display.autocorrelation_[later],
        f"autocorrelation of what is left of {output}",
        display.lags_[later],
        display.expected_[later],
    )
    tests = [("Autocorrelation", lag, auto)]
    for name, values in display.cross_correlation_.items():
        title = f"correlation of what is left of {output} with {name}"
        plot = _stems(display, values, title, display.lags_, np.zeros(values.size))
        tests.append((f"Cross-correlation with {name}", lag, plot))
    tests.append(("Histogram", "in standard deviations", _histogram(residual, output)))
    return [dict(zip(("title", "x_label", "plot"), test, strict=True)) for test in tests]


def _stems(display: ResidualDisplay, values, label: str, lags, expected) -> Markup:
    low, high = expected - display.band_, expected + display.band_
    reach = 1.1 * float(max(np.abs([values, low, high]).max(initial=0.0), 2.0 * display.band_))
    plot = Plot(Scale.over(lags, room=0.02), Scale(-reach, reach), label, "low small")
    plot.between(lags, low, high, "noise-band", "white noise stays within")
    plot.stems(lags, values, "extended")
    return plot.html()


def _histogram(residual, output: str) -> Markup:
    known = residual[np.isfinite(residual)]
    scaled = (known - np.mean(known)) / (np.std(known) or 1.0)
    edges = np.linspace(-REACH, REACH, BINS + 1)
    density, _ = np.histogram(np.clip(scaled, -REACH, REACH), edges, density=True)
    x = np.linspace(-REACH, REACH, 201)
    plot = Plot(
        Scale(-REACH, REACH),
        Scale(0.0, 1.05 * max(density.max(), 0.4)),
        f"histogram of what is left of {output}, and the normal distribution",
        "low small",
    )
    plot.line(np.repeat(edges, 2)[1:-1], np.repeat(density, 2), "extended", "what is left")
    plot.line(x, norm.pdf(x), "measured", "normal distribution")
    return plot.html()
