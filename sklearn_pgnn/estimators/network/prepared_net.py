"""A network that reads tables, and defines its step before it is trained."""

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import validate_data

from sklearn_pgnn.estimators.network import structure
from sklearn_pgnn.estimators.network.free_parameters import names_of
from sklearn_pgnn.estimators.network.physics_loss import (
    ADAPTIVE,
    PhysicsLoss,
    as_terms,
    check_lambda,
    own_parameters,
    with_dissipation,
)
from sklearn_pgnn.estimators.network.records import (
    TrainingData,
    TrainingRecord,
    TrainingWindows,
    estimate_states,
    open_loop,
    prepare,
    rows_of,
    split_for_validation,
    told_samples,
)
from sklearn_pgnn.estimators.network.sample_interval import (
    FilledRecord,
    fill,
    holds_at_one_interval,
    warn_of_other_intervals,
)
from sklearn_pgnn.estimators.network.structure import ON_THE_MODEL
from sklearn_pgnn.estimators.network.trajectory_net import TrajectoryNet
from sklearn_pgnn.estimators.simulated_predictions import one_simulation_warning
from sklearn_pgnn.estimators.table_names import plain_model
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import steps_for
from sklearn_pgnn.simulation.record_windows import dominant_period, output_noise
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.substeps import EXPLICIT, usual_step
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.contradicted_states import (
    warn_of_contradicted_states,
    warn_of_unknown_starts,
)
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.measured import (
    constant_outputs,
    of_measured,
    warn_of_constant_outputs,
)
from sklearn_pgnn.trajectories.reader import TRAJECTORY
from sklearn_pgnn.trajectories.tables import (
    SIMULATED,
    TIME,
    as_pandas,
    is_named,
    once,
    read_numbers,
    time_name,
)
from sklearn_pgnn.trajectories.validation import check_model, validate_table

REFINEMENTS = ("auto", "lm", "lbfgs", None)


def _is_integer(least: int):
    return lambda value: isinstance(value, Integral) and int(value) >= least


#: what a parameter must be, as a test and in words
EXPECTED: dict[str, tuple[Callable[[Any], bool], str]] = {
    "overlap": (lambda v: isinstance(v, Real) and 0 <= float(v) < np.inf, "a number >= 0"),
    "refine": (lambda v: v in REFINEMENTS, f"one of {REFINEMENTS}"),
    "horizon": (_is_integer(1), "an integer >= 1"),
    "rollout_epochs": (_is_integer(0), "an integer >= 0"),
    "refine_max_iter": (_is_integer(0), "an integer >= 0"),
    "n_iter_no_change": (_is_integer(1), "an integer >= 1"),
    "max_epochs": (_is_integer(0), "an integer >= 0"),
    "batch_size": (lambda v: v == -1 or _is_integer(1)(v), "an integer >= 1 or -1 for all"),
    "lr": (lambda v: isinstance(v, Real) and 0 < float(v) < np.inf, "a number above 0"),
    "module": (callable, "a class such as FeedForward"),
    "criterion": (callable, "a class such as torch.nn.MSELoss"),
    "optimizer": (callable, "a class such as torch.optim.Adam"),
    "scaled": (lambda v: isinstance(v, bool | np.bool_), "True or False"),
    "validation_fraction": (
        lambda v: isinstance(v, Real) and 0 <= float(v) < 1, "a share from 0 to below 1",
    ),
}  # fmt: skip
#: comparisons of the outputs per dominant period in the last phase
PER_PERIOD = 100


@dataclass
class Runs:
    """Trajectories as the loop needs them, where their own samples are, and free runs."""

    records: tuple
    ready: list
    kept: list
    x: list


class PreparedNet(TrajectoryNet):
    """The preparation of the training of `PGNNLRegressor`: reading, checks and the step."""

    # -- reading -----------------------------------------------------------------------------------

    def _check_parameters(self) -> None:
        check_model(self.model, optional=True)
        check_lambda(self.lambda_phy)
        structure.check_structure(self.structure, self.guide, self.model is not None)
        self._free_names = names_of(self.model, self.free)
        on_the_model = self.structure in ("auto", *ON_THE_MODEL)
        if self._free_names and self.guide == "simulation" and on_the_model:
            raise OptionError(
                f"guide='simulation' does not go with free={self.free!r}: expected a guide that "
                f"follows the state, for the simulation is that of the model before its parameters "
                f"are trained. Remedy: guide='terms', guide='step' or guide=None."
            )
        for name, (is_valid, expected) in EXPECTED.items():
            value = getattr(self, name)
            if not is_valid(value):
                raise OptionError(f"{name}: expected {expected}, got {value!r}.")

    def _check_rows(self, X, y=None, *, reset):
        """Check a table whose rows are independent."""
        targets = {} if y is None else {"y": y, "multi_output": True, "y_numeric": True}
        return validate_data(self, X, reset=reset, dtype=np.float64, **targets)

    def _named(self, X):
        """Name the columns of X where they have no names, and the one that holds the time."""
        if self.model is not None:
            named = with_names(self.model, X, self.time_column)
            return named, self.time_column if named is X else None
        if not is_named(X):
            X = pd.DataFrame(X).set_axis([f"column {i}" for i in range(X.shape[1])], axis=1)
        return X, time_name(X.columns, self.time_column) or TIME

    def _read_ready(self, X, y=None):
        """Read X as trajectories that the loop can run along; y need not be enough for a fit."""
        X = validate_table(self, X, reset=False)
        X, time_column = self._named(X)
        y = y if y is None or self.model is not None else np.asarray(y)
        records = read_records(self.model_, X, y, time_column=time_column, to_fit=False)
        if self.model is not None:
            refuse_standardised(self.model, records)
        filled = self._fill(records)
        return Runs(records, self._prepare(X, filled), [each.kept for each in filled], [])

    def _fill(self, records) -> list[FilledRecord]:
        """Divide the records' long steps into the network's, and tell of other steps."""
        filled = [fill(record, self.interval_, self.hold_) for record in records]
        self._warn_of_intervals(filled)
        return filled

    def _warn_of_intervals(self, filled) -> None:
        if holds_at_one_interval(self.structure_, self.module):
            warn_of_other_intervals(filled, self.interval_, self.structure_)

    def _prepare(self, X, filled):
        further = self.further_columns_
        features = _numbers(X, further) if further else np.zeros((len(X), 0))
        if self._guide != "simulation":
            simulated = np.zeros((len(X), 0))
        else:
            simulated = simulated_states(self.model_, X)
        return prepare(
            self.model_,
            [each.record for each in filled],
            [each.along(features[each.rows], self.hold_) for each in filled],
            None if simulated is None else [self._along(each, simulated) for each in filled],
            hold=self.hold_,
            substeps=self.substeps_,
        )

    def _along(self, each: FilledRecord, simulated) -> np.ndarray:
        """Return simulated columns of X at all samples; in between the model is simulated."""
        given = simulated[each.rows]
        if each.is_whole or not given.shape[1]:
            return each.along(given, "zoh")
        slope, offset = self.guide_line_
        found = open_loop(self.model_, each.record, self.hold_, self.substeps_) * slope + offset
        found[each.kept] = given
        return found

    # -- preparing ---------------------------------------------------------------------------------

    def _prepare_training(self, X, y, random, anew) -> TrainingData:
        """Read the records, estimate their states, and define the network's step."""
        table = validate_table(self, X, reset=anew)
        y = as_pandas(y)
        outputs = y if hasattr(y, "iloc") else np.asarray(y)
        X, given = self._read_training(table, y, anew)
        measured = [record for record in given if record.is_measured]
        warn_of_constant_outputs(self.model_, measured)
        self.hold_ = hold_of(self.model_, self.hold)
        if anew:
            self.interval_ = usual_step(measured)
        filled = [fill(record, self.interval_, self.hold_) for record in measured]
        records: tuple[Any, ...] = tuple(each.record for each in filled)
        self.noise_ = output_noise(records)
        steps = steps_for(self.model_, records, self.substeps, EXPLICIT, self.hold_)
        self.substeps_ = steps.substeps
        options: dict[str, Any] = {"hold": self.hold_, "substeps": self.substeps_}
        states = estimate_states(self.model_, records, **options)
        if anew:
            self._settle_structure(records, states, options)
        self._warn_of_intervals(filled)
        self.guide_line_ = self._find_guide_line(X, filled)
        parts = zip(self._prepare(X, filled), states, records, told_samples(records), strict=True)
        whole = [TrainingRecord(ready, x, record.y, told=told) for ready, x, record, told in parts]
        training, validation = split_for_validation(whole, self.validation_fraction, random)
        unmeasured = self._prepare_unmeasured(X, given, options)
        windows = self._cut_windows([*training, *unmeasured], options)
        if anew:
            self.step_ = structure.make_step(
                self.model_,
                windows,
                self.structure_,
                self._guide,
                corrects=self.corrects,
                sees=self.sees,
                further=self.further_columns_,
                middle=self._middle,
                **options,
            )
        self._settle_physics(windows)
        held = [any(each is other for other in validation) for each in whole]
        rows = rows_of(table, outputs, measured, held)
        scales = self._scales(records)
        return TrainingData(training, validation, unmeasured, windows, *scales, rows)

    def _scales(self, records) -> tuple[np.ndarray, int]:
        """Return the deviations of the outputs, and at which samples these are compared."""
        spread = of_measured(np.nanstd, np.concatenate([record.y for record in records]))
        spread = np.where(constant_outputs(records).all(axis=0), 1.0, spread)
        if any(np.isnan(record.y).any() for record in records):
            return spread, 1  # else those that were measured may be skipped
        return spread, max(1, int(dominant_period(records) / self.interval_ / PER_PERIOD))

    def _read_training(self, X, y, anew):
        """Name the columns of X, and read it with y as records of the model."""
        self._single_output = np.asarray(y).ndim == 1
        self.model_ = self.model if anew else self.model_
        X, time_column = self._named(X)
        if self.model is None:
            y = np.asarray(y)  # it names nothing that a model knows
            self.model_ = plain_model(X, y, time_column, self.states)
        terms = as_terms(self.physics_loss, self.model) if self.lambda_phy != 0 else []
        self._balance_names = own_parameters(self.model, terms)
        self._prior = with_dissipation(self.model, terms)
        self.model_ = with_dissipation(self.model_, terms)
        given = read_records(self.model_, X, y, time_column=time_column, allow_unmeasured=True)
        if self.model is not None:
            refuse_standardised(self.model, given, energies=self.lambda_phy != 0)
            warn_of_contradicted_states(self.model, given)
            warn_of_unknown_starts(self.model, given)
        self.further_columns_ = further_columns(self.model_, X, time_column)
        return X, given

    def _cut_windows(self, records, options) -> TrainingWindows:
        windows = TrainingWindows(
            records,
            self.model_,
            needs_prior=self.structure_ in ON_THE_MODEL or self._guide == "step",
            needs_terms=self._guide == "terms",
            terms_from=self.model,
            seen_at=1.0 if self.structure_ == "dissipative" else 0.5 * self._middle,
            **options,
        )
        if not len(windows.pairs):
            raise RecordError(
                "y: expected two samples one after the other with a measured output, or with "
                "measured ones near on both sides; got none in the trajectories to train on."
            )
        return windows

    @one_simulation_warning()
    def _prepare_unmeasured(self, X, records, options) -> list[TrainingRecord]:
        """Prepare the trajectories without any output, if a physical loss needs them."""
        blind = [record for record in records if not record.is_measured]
        if self.lambda_phy == 0 or not blind:
            return []
        filled, found = self._fill(blind), []
        for each, ready in zip(filled, self._prepare(X, filled), strict=True):
            record: Any = each.record
            x = open_loop(self.model_, record, **options)  # no error is taken from it
            found.append(TrainingRecord(ready, x, record.y, told=np.zeros(len(x), bool)))
        return found

    def _settle_structure(self, records, states, options) -> None:
        plain = self.model is None
        self.structure_ = self.structure
        if self.structure == "auto" and (self._free_names or self.corrects is not None):
            self.structure_ = "correction"
        elif self.structure == "auto":
            self.structure_ = (
                "increment"
                if plain
                else structure.find_structure(self.model_, records, states, **options)
            )
        self._guide = self.guide
        if self.guide == "auto":
            by_structure = "terms" if self.structure_ in ON_THE_MODEL else "simulation"
            unseen = plain or (self.sees is not None and by_structure == "simulation")
            self._guide = None if unseen else by_structure
        with_parameters = bool(self._free_names) and self.structure_ == "correction"
        self._middle = with_parameters and self._guide != "step"
        structure.check_features(
            self.model_, self.structure_, self._guide, self.corrects, self.sees,
            self.further_columns_,
        )  # fmt: skip
        if self.structure_ == "dissipative":
            structure.lossy_states(self.model_, self.corrects, self._free_names)
        if self._free_names and self.structure_ not in ON_THE_MODEL and self.lambda_phy == 0:
            raise ValueError(
                f"free={self.free!r}: the loss does not depend on the model's parameters where "
                f"structure={self.structure_!r} and lambda_phy=0. Remedy: structure='correction', "
                f"or weigh an energy balance that holds them (lambda_phy=0.01)."
            )

    def _settle_physics(self, windows) -> None:
        """Bind the physical terms, if there are any or if they have a weight."""
        self._physics, self.lambda_phy_ = None, 0.0
        wanted = self.lambda_phy != 0 or self.physics_loss is not None
        if wanted or "stored" in self.model_.energy:
            terms = as_terms(self.physics_loss, self.model)
            self._physics = PhysicsLoss(terms, self.model_, windows.motion(), self.scaled)
        if self.lambda_phy != ADAPTIVE:
            self.lambda_phy_ = float(self.lambda_phy)

    def _find_guide_line(self, X, filled):
        """Find the line of the simulated columns of X over the simulation, for other samples."""
        nx = len(self.model_.states)
        simulated = simulated_states(self.model_, X) if self._guide == "simulation" else None
        if simulated is None:
            return np.ones(nx), np.zeros(nx)
        options = self.hold_, self.substeps_
        runs = [open_loop(self.model_, each.record, *options)[each.kept] for each in filled]
        own = np.concatenate(runs)
        given = simulated[np.concatenate([each.rows for each in filled])]
        lines = [
            np.polyfit(a, b, 1) if np.ptp(a) else (1.0, b[0] - a[0])
            for a, b in zip(own.T, given.T, strict=True)
        ]
        slope, offset = np.array(lines).T
        return slope, offset


# -- columns of a table besides the model's own quantities -----------------------------------------


def with_names(model: PhysicsModel, X, time_column=None):
    """Name the columns of an array that `PhysicsModelTransformer` gave.

    They are time, inputs, states or none, and the simulated states and outputs.
    """
    if isinstance(X, pd.DataFrame) or isinstance(time_column, str):
        return X
    known = dict.fromkeys([*model.states, *model.outputs])
    simulated = [name + SIMULATED for name in known]
    for given in ([*model.inputs], [*model.inputs, *model.states]):
        names = [*given, *simulated]
        width = 1 + len(names)
        if X.shape[1] == width != 1 + len(model.inputs) + len(model.states):
            names.insert((time_column or 0) % (1 + len(given)), TIME)
            return pd.DataFrame(X, columns=names)
    return X


def simulated_states(model: PhysicsModel, X) -> np.ndarray | None:
    """Return the columns of the simulated states, or None where a table lacks one."""
    names = [state + SIMULATED for state in model.states]
    if not isinstance(X, pd.DataFrame) or not set(names) <= set(X.columns):
        return None
    return _numbers(X, names)


def further_columns(model: PhysicsModel, X, time_column) -> list[str]:
    """Name the columns that are neither time, trajectory, quantity of the model nor simulation.

    A column with the name of an output is never one: it would reveal what is to be predicted.
    """
    if not isinstance(X, pd.DataFrame):
        return []
    own = [TIME, TRAJECTORY, *model.inputs, *model.states, *model.outputs]
    taken = {
        time_name(X.columns, time_column),
        *own,
        *(model.columns.get(name, name) for name in own),
    }
    taken |= {name + SIMULATED for name in (*model.states, *model.outputs)}
    return [name for name in X.columns if name not in taken]


def _numbers(X: pd.DataFrame, names) -> np.ndarray:
    """Read columns as finite numbers."""
    values = np.column_stack([_column(X, name) for name in names])
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise RecordError(
            f"X: column {names[column]!r} is {values[row, column]} in row {row}; expected a finite "
            f"number. Remedy: if it is an initial state, name it in the model's 'columns' or in "
            f"'states'; else fill the gap or leave the column out."
        )
    return values


def _column(X: pd.DataFrame, name: str) -> np.ndarray:
    column = once(X, name, "X: column")
    try:
        return read_numbers(column, f"X: column {name!r}")
    except RecordError as error:
        raise RecordError(
            f"X: column {name!r} is not numeric. Remedy: encode it, or leave it out."
        ) from error
