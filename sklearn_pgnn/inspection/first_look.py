"""A first look: a model simulated on records as given, before any diagnosis."""

import math
from dataclasses import asdict, dataclass, replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.inspection.fit_percentage import fit_percentage
from sklearn_pgnn.inspection.numbers import number
from sklearn_pgnn.inspection.prefixed_unit import prefixed_unit
from sklearn_pgnn.inspection.start_runs import run_from_starts
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, window_records
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.constant_outputs import remarks_on_dead_outputs
from sklearn_pgnn.trajectories.measured import spans_of

#: factors between two units of a quantity that differ by a prefix, and their powers of ten
PREFIXES = {1e3: 3, 1e6: 6, 1e-3: -3, 1e-6: -6}
#: seconds in another unit that a file's time may have
CLOCKS = {"ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}
#: and by the model's unit, what else a file may hold
OTHERS = {
    "m": {100.0: "cm"},
    "m/s": {100.0: "cm/s", 3.6: "km/h"},
    "rad": {180 / math.pi: "deg"},
    "rad/s": {180 / math.pi: "deg/s", 30 / math.pi: "rpm"},
}
#: how near to such a factor a scale must be, and the share of the power that it must then explain
NEAR, TELLING = 1.3, 0.5
#: a simulation that is larger than what was measured by more than any prefix has run away
SMALLEST = 1e-9
#: how near it is where the model follows so badly that there is no such share
ROUGHLY = 5.0


@dataclass(frozen=True)
class SeenRecord:
    """One record.

    Parameters
    ----------
    name : str
        Its name.
    samples : int
        Number of samples.
    duration, sample_time : float
        Time from the first to the last sample, and the median sample time [s].
    fit : dict of str to float
        By output, the fit of the model as given to this record; see `fit_percentage`.
    """

    name: str
    samples: int
    duration: float
    sample_time: float
    fit: dict[str, float]


@dataclass(frozen=True)
class SeenQuantity:
    """An input or an output over all records.

    Parameters
    ----------
    name, role, unit : str
        Its name, its role (``"input"`` or ``"output"``), and its unit in the model.
    low, high : float
        Smallest and largest value [unit].
    missing : int
        Samples without a value.
    """

    name: str
    role: str
    unit: str
    low: float
    high: float
    missing: int


@dataclass(frozen=True)
class FirstFit:
    """The free-run fit of one output by the model as given, from the start of the records.

    Parameters
    ----------
    output, unit : str
        The output and its unit.
    error, noise : float
        Root mean square error, and the noise estimated from the records [unit]; NaN for an output
        that never changes.
    fit : float
        See `fit_percentage`.
    """

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
    warnings : tuple of str
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
    warnings: tuple[str, ...]

    def __repr__(self):
        fits = ", ".join(f"{o.output} {o.fit:.0f} %" for o in self.outputs)
        return f"<FirstLook at {self.model.name!r}: fit {fits}; warnings: {len(self.warnings)}>"

    def to_dict(self) -> dict:
        """Return all but the model as plain data."""
        rows = {n: [asdict(row) for row in getattr(self, n)] for n in _TABLES}
        return {"model": self.model.name, **rows, "warnings": list(self.warnings)}


_TABLES = ("records", "quantities", "outputs")


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
    >>> look = first_look(lag, np.column_stack([t, np.sin(t)]), 1000 * run)
    >>> "as if it were recorded in mV" in look.warnings[0]
    True
    """
    records = read_records(model, X, y)
    windowed = window_records(model, records)
    windows = windowed.windows
    runs = run_from_starts(model, windowed)
    simulated = np.concatenate([run.y for run in runs])
    quantities = _quantities(model, windows.u, windows.y)
    outputs = _fits(model, windows, simulated)
    failed = [
        f"record {record.name!r}: {run.message}"
        for record, run in zip(records, runs, strict=True)
        if run.message
    ]
    return FirstLook(
        model,
        _seen(model, records, windows, runs),
        quantities,
        outputs,
        (
            *_constant(quantities),
            *remarks_on_dead_outputs(model, records),
            *_gaps(records),
            *failed,
            *_odd(model, records, windows, outputs),
        ),
    )


# -- what is there ---------------------------------------------------------------------------------


def _seen(model, records, windows, runs) -> tuple[SeenRecord, ...]:
    seen = []
    for record, (a, b), run in zip(records, pairwise(windows.bounds), runs, strict=True):
        t, fit = record.t, fit_percentage(windows.y[a:b], run.y)
        times = t.size, float(t[-1] - t[0]), float(np.median(np.diff(t)))
        by_output = zip(model.outputs, map(float, fit), strict=True)
        seen.append(SeenRecord(record.name, *times, dict(by_output)))
    return tuple(seen)


def _quantities(model, u, y) -> tuple[SeenQuantity, ...]:
    columns = {name: ("input", u[:, i]) for i, name in enumerate(model.inputs)}
    columns |= {name: ("output", y[:, i]) for i, name in enumerate(model.outputs)}
    return tuple(
        SeenQuantity(
            name,
            role,
            model.unit(name),
            float(np.nanmin(values)),
            float(np.nanmax(values)),
            int(np.isnan(values).sum()),
        )
        for name, (role, values) in columns.items()
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


def _constant(quantities) -> list[str]:
    return [
        f"{q.role} {q.name!r} is {number(q.low)} {q.unit}".rstrip()
        + (
            " in every sample: nothing that depends on its changes can be found. Remedy: a record "
            "in which it changes."
        )
        for q in quantities
        if q.low == q.high
    ]


def _gaps(records) -> list[str]:
    """Return remarks on gaps in time, the longest of every record."""
    said = []
    for record in records:
        steps = np.diff(record.t)
        usual, longest = np.median(steps), int(np.argmax(steps))
        if steps[longest] > MIN_SAMPLES * usual:
            said.append(
                f"record {record.name!r}: no sample for {number(steps[longest])} s from "
                f"t = {number(record.t[longest])} s on, where others are {number(usual)} s apart; "
                f"what the inputs did there is unknown. Remedy: none is needed, a diagnosis cuts a "
                f"record at long gaps."
            )
    return said


def _odd(model, records, windows, outputs) -> list[str]:
    """Return remarks on outputs in another unit, reversed, or not followed at all.

    The runs begin in the model's initial state: the sensors' values may be in another unit.
    """
    told = _tells(np.array([output.fit for output in outputs])).any()
    if not told and (unit := _clock(model, records, windows)):
        title = model.columns.get("t", "t").split(" [")[0]
        return [
            f"the model follows the records if their time is in {unit}. Remedy: if so, say it in "
            f'the model file, columns: {{t: "{title} [{unit}]"}}; else check units and values.'
        ]
    y, simulated, said = windows.y, _simulated(model, records, windows), []
    if not np.isfinite(simulated).all():
        return []  # what diverges tells neither signs nor units, and is told as such
    for i, output in enumerate(outputs):
        seen = np.isfinite(y[:, i]) & np.isfinite(simulated[:, i])
        if seen.any():
            scale, share = _scale(y[seen, i], simulated[seen, i])
            spreads = _spreads(windows.bounds, y[:, i], simulated[:, i])
            said += _about(model, output, scale, share, spreads)
    return said


def _simulated(model, records, windows, second=1.0) -> np.ndarray:
    """Return the outputs of free runs, with the time of the records in another unit."""
    runs = [
        simulate_record(
            model,
            replace(record, t=second * record.t),
            hold=windows.hold,
            **windows.steps._asdict(),
        )
        for record in records
    ]
    return np.concatenate([run.y for run in runs])


def _clock(model, records, windows) -> str:
    """Return the unit of time in which the model tells much of every output, if there is one."""
    for unit, second in CLOCKS.items():
        fit = fit_percentage(windows.y, _simulated(model, records, windows, second))
        if _tells(fit).all():
            return unit
    return ""


def _tells(fit: np.ndarray) -> np.ndarray:
    """Return where a fit [%] explains a telling share of the power."""
    return (1.0 - fit / 100.0) ** 2 < 1.0 - TELLING


def _scale(y, simulated) -> tuple[float, float]:
    """Return the best scale factor of a simulation, and the share of power it then explains."""
    y, simulated = y - y.mean(), simulated - simulated.mean()
    with np.errstate(over="ignore"):
        power, both = float(simulated @ simulated), float(simulated @ y)
    if not (0 < power < math.inf and y.any() and abs(both) > SMALLEST * power):
        return 1.0, 0.0
    return both / power, both**2 / (power * float(y @ y))


def _spreads(bounds, y, simulated) -> list[float]:
    """Return the variation of an output over that of its simulation, by halves of records.

    In another unit it is much the same everywhere, but not where a simulation diverges.
    """
    middles = (bounds[:-1] + bounds[1:]) // 2
    ends = np.sort(np.concatenate([bounds, middles]))
    return [_spread(y[a:b], simulated[a:b]) for a, b in pairwise(ends)]


def _spread(y, simulated) -> float:
    seen = np.isfinite(y)
    theirs = float(np.std(simulated[seen])) if seen.any() else 0.0
    ours = float(np.std(y[seen])) if seen.any() else 0.0
    return ours / theirs if ours > 0 and 0 < theirs < math.inf else 1.0


def _about(model, output, scale, share, spreads) -> list[str]:
    name, expression = output.output, model.outputs[output.output]
    if share > TELLING and scale < 0:
        return [
            f"{name!r} has the opposite sign of the simulation ({number(scale, 3)} times it). "
            f"Remedy: check the signs of the sensor, of the inputs and of the equations."
        ]
    factor, unit = _unit_factor(output.unit, scale) if share > TELLING else (1.0, "")
    if factor != 1.0:
        recorded = f", as if it were recorded in {unit}" if unit else ""
        return [
            f"{name!r} is {number(scale)} times what the model simulates{recorded}. Remedy: "
            f"convert the column, or say in the model file outputs: "
            f'{{{name}: "{number(factor, 6)}*({expression})"}}.'
        ]
    if output.fit < 0 and (unit := _perhaps(output.unit, spreads)):
        title = model.columns.get(name, name).split(" [")[0]
        return [
            f"{name!r} varies {number(_typical(spreads), 3)} times as much as the simulation: "
            f"is it recorded in {unit}? Remedy: if so, say it in the model file, columns: "
            f'{{{name}: "{title} [{unit}]"}}; else check the values.'
        ]
    if output.fit < 0:
        return [
            f"{name!r}: the first simulation predicts the records no better than their mean does. "
            f"Remedy: check units, signs and values; a diagnosis re-tunes a parameter only within "
            f"its spread."
        ]
    return []


def _unit_factor(unit: str, scale: float) -> tuple[float, str]:
    """Return the factor between units that a scale is near, and the unit of the file.

    Examples
    --------
    >>> _unit_factor("m/s", 3.58), _unit_factor("m", 1.2)
    ((3.6, 'km/h'), (1.0, ''))
    """
    units = {factor: prefixed_unit(unit, power) for factor, power in PREFIXES.items()}
    units |= OTHERS.get(unit, {})
    for factor, recorded in units.items():
        if 1 / NEAR < scale / factor < NEAR:
            return factor, recorded
    return 1.0, ""


def _perhaps(unit: str, spreads: list[float]) -> str:
    """Return the unit with the prefix that roughly matches scales; empty where none does.

    Every scale must be nearer to it than to 1: where a simulation diverges, its beginning is not.

    Examples
    --------
    >>> _perhaps("m", [400.0, 700.0]), _perhaps("m", [20.0]), _perhaps("m", [1.0, 0.1, 1e-6])
    ('mm', '', '')
    """
    size = np.log([_typical(spreads), *spreads])
    for factor, power in PREFIXES.items():
        far = abs(size - math.log(factor))
        if far[0] < math.log(ROUGHLY) and (far < abs(size)).all():
            return prefixed_unit(unit, power)
    return ""


def _typical(spreads: list[float]) -> float:
    return float(np.exp(np.mean(np.log(spreads))))
