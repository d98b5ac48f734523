"""A first look: a model simulated on records as given, before any diagnosis."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning, code_of
from sklearn_pgnn.inspection.numbers import measured, number
from sklearn_pgnn.inspection.runs import fit_percentage, run_from_starts
from sklearn_pgnn.physics.effects.differences import is_mark
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.checks import find_repeats
from sklearn_pgnn.record_quality.finding import Finding, finding_of
from sklearn_pgnn.record_quality.identifiability import Identifiability, percent
from sklearn_pgnn.record_quality.wiring import find_wiring
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, window_records
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.measured import remarks_on_dead_outputs, spans_of

_TABLES = ("records", "quantities", "outputs")


@dataclass(frozen=True)
class SeenRecord:
    """One record: its duration [s], median sample time [s], and the fit of the model as given."""

    name: str
    samples: int
    duration: float
    sample_time: float
    fit: dict[str, float]


@dataclass(frozen=True)
class SeenQuantity:
    """An input or an output over all records, its missing samples, and its kind."""

    name: str
    role: str
    unit: str
    low: float
    high: float
    missing: int
    channel: str = ""


@dataclass(frozen=True)
class FirstFit:
    """The free-run fit of an output by the model as given, its error and noise [output]."""

    output: str
    unit: str
    error: float
    noise: float
    fit: float


@dataclass(frozen=True)
class FirstLook:
    """The results of a first look at a model and records.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    records : tuple of SeenRecord
        The records.
    quantities : tuple of SeenQuantity
        Inputs and outputs.
    outputs : tuple of FirstFit
        The fit of every output by the model as given.
    findings : tuple of Finding
        What looks wrong, each with its remedy.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 20, 401)
    >>> run = lag.simulate(t, np.sin(t)).y
    >>> look = first_look(lag, np.column_stack([t, np.sin(t)]), run)
    >>> look
    <FirstLook at ...: fit y 100 %; warnings: 0>
    """

    model: PhysicsModel
    records: tuple[SeenRecord, ...]
    quantities: tuple[SeenQuantity, ...]
    outputs: tuple[FirstFit, ...]
    findings: tuple[Finding, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """The findings in sentences."""
        return tuple(finding.said for finding in self.findings)

    def __repr__(self):
        fits = ", ".join(f"{o.output} {o.fit:.0f} %" for o in self.outputs)
        return f"<FirstLook at {self.model.name!r}: fit {fits}; warnings: {len(self.findings)}>"

    def to_dict(self) -> dict:
        """Return all but the model as plain data."""
        rows = {n: [asdict(row) for row in getattr(self, n)] for n in _TABLES}
        findings = [finding.to_dict() for finding in self.findings]
        return {"model": self.model.name, **rows, "findings": findings}


def first_look(model: PhysicsModel, X, y) -> FirstLook:
    """Check a model against records in seconds: their contents, and a first simulation.

    Parameters
    ----------
    model : PhysicsModel
        The model, as it is given.
    X : DataFrame or array of shape (n_samples, n_columns)
        Time [s], inputs and, where known, initial states; see `ModelDiagnosis.fit`.
    y : array-like of shape (n_samples, n_outputs) or (n_samples,)
        Measured outputs.

    Returns
    -------
    FirstLook
        Records, ranges, the fit of the first simulation, and what looks wrong.

    Raises
    ------
    RecordError
        If X or y cannot be read as records of the model.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 20, 401)
    >>> run = lag.simulate(t, np.sin(t)).y
    >>> look = first_look(lag, np.column_stack([t, np.sin(t)]), -run)
    >>> "reversed polarity of y" in look.warnings[0]
    True
    """
    records = read_records(model, X, y)
    windowed = window_records(model, records)
    windows, runs = windowed.windows, run_from_starts(model, windowed)
    quantities = _quantities(model, windows.u, windows.y)
    outputs = _fits(model, windows, np.concatenate([run.y for run in runs]))
    findings = (
        *_constant(model, quantities),
        *(finding_of("dead sensor", said) for said in remarks_on_dead_outputs(model, records)),
        *find_repeats(records),
        *_gaps(records),
        *_diverged(records, runs),
        *_odd(model, records, outputs),
    )
    return FirstLook(model, _seen(model, records, windows, runs), quantities, outputs, findings)


# -- what is there ---------------------------------------------------------------------------------


def _seen(model, records, windows, runs) -> tuple[SeenRecord, ...]:
    seen = []
    for record, (a, b), run in zip(records, pairwise(windows.bounds), runs, strict=True):
        t, fit = record.t, fit_percentage(windows.y[a:b], run.y).tolist()
        times = t.size, float(t[-1] - t[0]), float(np.median(np.diff(t)))
        seen.append(SeenRecord(record.name, *times, dict(zip(model.outputs, fit, strict=True))))
    return tuple(seen)


def _quantities(model, u, y) -> tuple[SeenQuantity, ...]:
    columns = [(name, "input", u[:, i]) for i, name in enumerate(model.inputs)]
    columns += [(name, "output", y[:, i]) for i, name in enumerate(model.outputs)]
    return tuple(
        SeenQuantity(
            name,
            role,
            model.unit(name),
            float(np.nanmin(values)),
            float(np.nanmax(values)),
            int(np.isnan(values).sum()),
            model.channels.get(name, ""),
        )
        for name, role, values in columns
    )


def _fits(model, windows, simulated) -> tuple[FirstFit, ...]:
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.sqrt(np.nanmean((windows.y - simulated) ** 2, axis=0))
    percent = fit_percentage(windows.y, simulated)
    still = spans_of(windows.y) == 0
    noise = np.where(still, np.nan, windows.scale)  # nothing is known of it
    return tuple(
        FirstFit(name, model.unit(name), float(errors[i]), float(noise[i]), float(percent[i]))
        for i, name in enumerate(model.outputs)
    )


# -- what looks wrong ------------------------------------------------------------------------------


def _constant(model: PhysicsModel, quantities) -> Iterator[Finding]:
    kinds = {"input": "poor excitation", "output": "dead sensor"}
    for q in quantities:
        if q.low == q.high and not is_mark(model, q.name):
            yield Finding(
                kinds[q.role],
                q.name,
                f"{q.role} {q.name!r} is {f'{number(q.low)} {q.unit}'.rstrip()} in every sample: "
                f"nothing that depends on its changes can be found",
                q.low,
                "a record in which it changes",
            )


def _gaps(records) -> Iterator[Finding]:
    """Yield findings on gaps in time, the longest of every record."""
    for record in records:
        steps = np.diff(record.t)
        usual, longest = np.median(steps), int(np.argmax(steps))
        if steps[longest] > MIN_SAMPLES * usual:
            yield Finding(
                "dropped samples",
                record.name,
                f"record {record.name!r}: no sample for {number(steps[longest])} s from "
                f"t = {number(record.t[longest])} s on, where others are {number(usual)} s apart; "
                f"what the inputs did there is unknown",
                float(steps[longest]),
                "none is needed, a diagnosis cuts a record at long gaps",
            )


def _diverged(records, runs) -> Iterator[Finding]:
    kind = code_of(SimulationWarning).replace("_", " ")
    for record, run in zip(records, runs, strict=True):
        if run.message:
            yield finding_of(kind, f"record {record.name!r}: {run.message}", record.name)


def _odd(model, records, outputs) -> list[Finding]:
    """Return findings on a wiring that the model follows, else on outputs that it does not."""
    wiring = find_wiring(model, records)
    if wiring is not None:
        return [wiring.finding(model)]
    return [
        Finding(
            "poor fit",
            o.output,
            f"{o.output!r}: the first simulation predicts the records no better than their mean "
            f"does, nor clearly better with another sign, order or unit of a channel",
            o.fit,
            "check values and equations; a diagnosis re-tunes a parameter only within its spread",
        )
        for o in outputs
        if o.fit < 0
    ]


def told_table(told: Identifiability) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the titles and rows of a table of what records tell of every parameter."""
    title = "if the model were right" if told.is_doubtful else "identifiable"
    rows: list[tuple[str, ...]] = [
        (p.name, measured(e.value, e.low, e.high, e.unit), percent(p.half_width), p.verdict)
        for p, e in ((p, p.estimate) for p in told.parameters)
    ]
    return ("", "fitted (95 % interval)", "half-width", title), rows
