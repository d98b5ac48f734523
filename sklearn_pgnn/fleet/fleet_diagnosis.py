"""The diagnosis of many machines as an estimator: run in parallel, saved as they finish."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import pandas as pd
from joblib import Parallel, delayed, effective_n_jobs
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn import __version__
from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.estimation.plain_data import finite
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.fleet.changes import Change, changes_between
from sklearn_pgnn.fleet.content_key import content_key, files_key, records_key, setting_key
from sklearn_pgnn.fleet.machine import Machine, common_causes
from sklearn_pgnn.fleet.one_machine import Job, Outcome, Store
from sklearn_pgnn.fleet.report import render_fleet
from sklearn_pgnn.fleet.spread import ParameterSpread, spread_of
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.result_files import as_strict_json
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.validation import check_model
from sklearn_pgnn.whole_file import write_whole

REPORT, SUMMARY = "index.html", "fleet.json"
#: machines per process in a batch where a backend does not return results one by one
AT_ONCE = 4


class FleetDiagnosis(BaseEstimator):
    """Diagnose many machines of one kind with one model.

    The machines share the model's equations; each has its own parameters and causes, exactly as
    `ModelDiagnosis` finds them for it alone. The fleet is evaluated from these results: which
    machine has which cause, which parameter values are usual and which machines are odd, and what
    changed.

    Parameters
    ----------
    model : PhysicsModel
        The prior of every machine.
    options : mapping, optional
        Options of `ModelDiagnosis` by name, the same for all machines; ``time_limit`` applies to
        each machine.
    folder : path-like, optional
        Folder in which finished machines and the report are saved; an interrupted fit resumes from
        there. By default nothing is saved, and there are no reports of single machines.
    earlier : path-like or FleetDiagnosis, optional
        The folder of an earlier fit, or the fit itself, to compare with.
    rate : float, default=0.01
        Largest expected share of chance findings among the reported odd parameters and among the
        reported changes of parameters and sizes.
    sample_time : float, optional
        Sample time [s] of files without a time.
    n_jobs : int, optional
        Machines diagnosed in parallel, each in a process of its own; -1 means as many as there are
        cores. Another backend, such as a cluster, is chosen by `joblib.parallel_config`.
    progress : callable, optional
        Called as ``progress("machines", done, total)`` when a machine is finished.

    Attributes
    ----------
    machines_ : dict of str to Machine
        The machines by name, the surest causes first, those without a diagnosis last.
    causes_ : tuple of FleetCause
        The causes that are named, the most frequent first.
    parameters_ : dict of str to ParameterSpread
        Every free parameter over the machines.
    changes_ : tuple of Change
        What changed since the earlier fit, the surest first; empty without one.
    new_, missing_ : tuple of str
        Machines that are not in the earlier fit, and machines that are only in the earlier fit.
    computed_ : tuple of str
        The machines that this fit has computed; the others were loaded from `folder`.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_pgnn import PhysicsModel, effects
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"},
    ...                     inertia={"v": "m"})
    >>> t = np.arange(0, 40, 0.02)
    >>> F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    >>> rng = np.random.default_rng(0)
    >>> def records(machine):
    ...     v = machine.simulate(t, F, substeps=5).y
    ...     return np.column_stack([t, F]), v + 1e-3 * rng.normal(size=v.shape)
    >>> rigs = {"left": cart, "right": cart + effects.CoulombFriction("v", level=0.4)}
    >>> fleet = FleetDiagnosis(cart, options={"catalogue": [effects.CoulombFriction]})
    >>> fleet = fleet.fit({name: records(machine) for name, machine in rigs.items()})
    >>> {name: machine.verdict for name, machine in fleet.machines_.items()}
    {'right': 'cause_named', 'left': 'model_adequate'}
    """

    def __init__(
        self,
        model: PhysicsModel,
        *,
        options: Mapping[str, Any] | None = None,
        folder: FilePath | None = None,
        earlier: Any = None,
        rate: float = 0.01,
        sample_time: float | None = None,
        n_jobs: int | None = None,
        progress: Callable[[str, int, int], None] | None = None,
    ):
        self.model = model
        self.options = options
        self.folder = folder
        self.earlier = earlier
        self.rate = rate
        self.sample_time = sample_time
        self.n_jobs = n_jobs
        self.progress = progress

    def fit(self, records: Mapping[str, Any], y: None = None) -> Self:
        """Diagnose the machines, or resume where an earlier fit was interrupted.

        A machine whose records cannot be used is marked in `machines_` and does not affect others.

        Parameters
        ----------
        records : mapping
            By the machine's name its records: a pair (X, y) as `ModelDiagnosis.fit` takes it, a
            file, or a list of files as `read_files` takes it.
        y : None
            Not used; the outputs are part of the records.

        Returns
        -------
        self : FleetDiagnosis
            The fitted fleet.

        Raises
        ------
        OptionError
            If an option is not one of `ModelDiagnosis`, or if `earlier` is not a fleet or is the
            same folder.
        RecordError
            If there are no machines, or a file does not exist.
        """
        check_model(self.model)
        options = self._checked_options()
        before = self._before()
        jobs = _as_jobs(records)
        setting = setting_key(self.model, options)
        keys = {name: content_key(setting, self._key(name, job)) for name, job in jobs.items()}
        store = None if self.folder is None else Store(self.folder)
        kept = {name: store.load(name, key) for name, key in keys.items()} if store else {}
        machines = {name: machine for name, machine in kept.items() if machine is not None}
        left = {name: job for name, job in jobs.items() if name not in machines}
        self._tell(len(machines), len(jobs))
        self.computed_ = tuple(left)
        for outcome in self._run(left, options, with_page=store is not None):
            name = outcome.machine.name
            if store and outcome.is_final:
                store.save(outcome, keys[name])
            machines[name] = outcome.machine
            self._tell(len(machines), len(jobs))
        self._conclude(machines, before)
        if store:
            write_whole(store.folder / SUMMARY, as_strict_json(self.to_dict()))
            self.to_html(store.folder / REPORT)
        return self

    def _checked_options(self) -> dict:
        options = dict(self.options or {})
        known = [name for name in ModelDiagnosis(self.model).get_params() if name != "model"]
        for name in options:
            if name not in known:
                raise OptionError(
                    f"options: expected options of ModelDiagnosis ({', '.join(known)}), got "
                    f"{name!r}."
                )
        if options.get("progress") is not None:
            raise OptionError(
                "options: progress: expected none, since machines are diagnosed in separate "
                "processes. Remedy: the progress of FleetDiagnosis."
            )
        if not 0 < self.rate < 1:
            raise OptionError(f"rate: expected a number between 0 and 1, got {self.rate!r}.")
        return options

    def _before(self) -> dict[str, Machine] | None:
        """Return the machines of the earlier fit, None if there is none to compare with."""
        if self.earlier is None:
            return None
        if isinstance(self.earlier, FleetDiagnosis):
            check_is_fitted(self.earlier)
            return dict(self.earlier.machines_)
        if self.folder is not None and Path(self.earlier).resolve() == Path(self.folder).resolve():
            raise OptionError(
                f"earlier: {self.earlier}: expected another folder than that of this fit. Remedy: "
                f"use a new folder for every fit."
            )
        store = Store(self.earlier)
        found = {name: machine for name in store.names() if (machine := store.load(name))}
        if not found:
            raise OptionError(
                f"earlier: {self.earlier}: expected the folder of an earlier fit, got one without "
                f"a finished machine."
            )
        return found

    def _key(self, name: str, job: tuple | list[str]) -> str:
        if isinstance(job, tuple):
            return records_key(*job)
        try:
            return files_key(job, self.sample_time)
        except OSError as error:
            raise RecordError(
                f"machine {name!r}: {error.filename}: {error.strerror or error}."
            ) from None

    def _run(self, jobs: Mapping, options: Mapping, with_page: bool) -> Iterator[Outcome]:
        """Yield the outcomes of the machines, as they finish."""
        run = Job(self.model, options, self.sample_time, with_page).run
        calls = [delayed(run)(name, records) for name, records in jobs.items()]
        if not calls:
            return
        shared = {"n_jobs": self.n_jobs, "batch_size": 1}
        try:
            parallel = Parallel(return_as="generator_unordered", **shared)
        except ValueError:  # the backend returns all results at once
            step = AT_ONCE * effective_n_jobs(self.n_jobs)
            for start in range(0, len(calls), step):
                yield from Parallel(**shared)(calls[start : start + step])
        else:
            yield from parallel(calls)

    def _tell(self, done: int, total: int) -> None:
        if self.progress is not None:
            self.progress("machines", done, total)

    def _conclude(self, machines: dict[str, Machine], before: dict[str, Machine] | None) -> None:
        """Set the fitted attributes: the machines in order, and the evaluation of the fleet."""
        ranked = sorted(machines.values(), key=lambda machine: machine.rank)
        self.machines_ = {machine.name: machine for machine in ranked}
        self.causes_ = common_causes(ranked)
        self.parameters_ = self._spreads(ranked)
        self.changes_: tuple[Change, ...] = ()
        self.new_: tuple[str, ...] = ()
        self.missing_: tuple[str, ...] = ()
        if before is not None:
            self.changes_ = changes_between(before, ranked, self.rate)
            self.new_ = tuple(name for name in self.machines_ if name not in before)
            self.missing_ = tuple(name for name in before if name not in self.machines_)

    def _spreads(self, machines: Iterable[Machine]) -> dict[str, ParameterSpread]:
        told = {m.name: m.found["parameters"] for m in machines if m.found is not None}
        found = {}
        for name in self.model.free_parameters:
            by_machine = {m: p[name] for m, p in told.items() if name in p}
            spread = spread_of(name, by_machine, self.rate)
            if spread is not None:
                found[name] = spread
        return found

    # -- what it says --------------------------------------------------------------------------

    @property
    def typical_model_(self) -> PhysicsModel:
        """The prior with the usual parameter values of the fleet, for one more machine."""
        check_is_fitted(self)
        usual = {name: spread.usual for name, spread in self.parameters_.items()}
        return self.model.with_parameters(**usual)

    def to_dict(self) -> dict:
        """Return the fleet as plain data, as in ``fleet.json``.

        Returns
        -------
        dict
            Machines with verdicts and causes, causes and parameters over the fleet, changes.
        """
        frame, told = self.to_frame(), ("unit", "prior", "usual", "spread", "shared")
        parameters = {
            name: {key: getattr(spread, key) for key in told} | {"odd": dict(spread.odd)}
            for name, spread in self.parameters_.items()
        }
        return finite(
            {
                "machines": frame.to_dict("records"),
                "causes": [asdict(cause) for cause in self.causes_],
                "parameters": parameters,
                "changes": [asdict(change) for change in self.changes_],
                "new": list(self.new_),
                "missing": list(self.missing_),
                "version": __version__,
            }
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the machines as a DataFrame, one row each, the surest first."""
        check_is_fitted(self)
        changes: dict[str, list[str]] = {}
        for change in self.changes_:
            changes.setdefault(change.machine, []).append(change.what)
        rows = [
            {
                "machine": name,
                "verdict": machine.verdict,
                "causes": ", ".join(cause_name(*pair) for pair in machine.named),
                "sure": machine.sure,
                "explained_share": machine.explained,
                "odd": ", ".join(p.name for p in self.parameters_.values() if name in p.odd),
                "changed": "; ".join(changes.get(name, ())),
                "seconds": machine.seconds,
                "failed": machine.failed,
            }
            for name, machine in self.machines_.items()
        ]
        return pd.DataFrame(rows)

    def parameters_frame(self) -> pd.DataFrame:
        """Return all parameters as a DataFrame, one row per machine and parameter."""
        check_is_fitted(self)
        rows = [
            (machine, name, value, low, high, spread.unit, spread.usual, machine in spread.odd)
            for name, spread in self.parameters_.items()
            for machine, (value, low, high) in spread.values.items()
        ]
        columns = ["machine", "parameter", "value", "low", "high", "unit", "usual", "odd"]
        return pd.DataFrame(rows, columns=columns)

    def causes_frame(self) -> pd.DataFrame:
        """Return all named causes as a DataFrame, one row per machine and cause."""
        check_is_fitted(self)
        told = ["probability", "gain_percent", "parameters"]
        rows = [
            (name, *pair, *(cause[key] for key in told))
            for name, machine in self.machines_.items()
            for pair, cause in machine.named.items()
        ]
        return pd.DataFrame(rows, columns=["machine", "effect", "target", *told])

    def changes_frame(self) -> pd.DataFrame:
        """Return the changes since the earlier fit as a DataFrame, one row per change."""
        check_is_fitted(self)
        columns = ["machine", "kind", "what", "sure"]
        return pd.DataFrame([asdict(change) for change in self.changes_], columns=columns)

    def to_html(self, path: FilePath) -> None:
        """Write the report of the fleet as HTML, one row per machine.

        Parameters
        ----------
        path : str or path-like
            Where to write. Next to the folder `machines` of a saved fit, each row links to the
            report of its machine.
        """
        check_is_fitted(self)
        write_whole(Path(path), render_fleet(self, Path(path).parent))


def _as_jobs(records: Any) -> dict[str, tuple | list[str]]:
    """Return the (X, y) of every machine, or the list of its files."""
    if not isinstance(records, Mapping) or not records:
        raise RecordError(
            f"records: expected a mapping from machines to their records, got {records!r:.60}."
        )
    return {str(name): _as_job(str(name), item) for name, item in records.items()}


def _as_job(name: str, item: Any) -> tuple | list[str]:
    several = [item] if isinstance(item, str | os.PathLike) else item
    if isinstance(several, list | tuple) and several:
        if all(isinstance(path, str | os.PathLike) for path in several):
            return [os.fspath(path) for path in several]
        if len(several) == 2:
            return tuple(several)
    raise RecordError(
        f"machine {name!r}: expected a pair (X, y), a file or a list of files, got {item!r:.60}."
    )
