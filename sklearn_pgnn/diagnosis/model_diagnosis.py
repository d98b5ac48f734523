"""The diagnosis as an estimator: records in, verdict, causes and an extended model out."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, MultiOutputMixin, clone
from sklearn.utils import Tags, check_random_state
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import ArrayLike, Column, FilePath, RandomState, Table
from sklearn_pgnn.diagnosis import frames
from sklearn_pgnn.diagnosis.description import describe
from sklearn_pgnn.diagnosis.free_run import free_run_errors
from sklearn_pgnn.diagnosis.investigation import Findings, Investigation
from sklearn_pgnn.diagnosis.marks import marked_records, split_marks
from sklearn_pgnn.diagnosis.noise_units import error_together
from sklearn_pgnn.diagnosis.options import (
    check_detectability,
    check_max_causes,
    check_options,
    check_time_limit,
)
from sklearn_pgnn.diagnosis.plain_diagnosis import plain_diagnosis
from sklearn_pgnn.diagnosis.result import (
    Tried,
    measure_gain,
    name_causes,
    retuned_parameters,
)
from sklearn_pgnn.diagnosis.separations import (
    Named,
    effect_named,
    pair_of,
    two_to_separate,
    with_equivalent,
)
from sklearn_pgnn.diagnosis.size import parameter_errors
from sklearn_pgnn.diagnosis.unexplained import MissingPart
from sklearn_pgnn.estimation.budgets import KEPT
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_records import as_judged, keep_records
from sklearn_pgnn.estimation.possible_causes import (
    check_targets,
    possible_causes,
    warn_of_taken_names,
)
from sklearn_pgnn.estimation.problem import check_records
from sklearn_pgnn.estimation.progress import Progress
from sklearn_pgnn.estimators.progress import with_progress
from sklearn_pgnn.exceptions import DiagnosisWarning, RecordWarning
from sklearn_pgnn.experiment_design.detectability import (
    Detectability,
    Detectable,
    detect_all,
    in_last_record,
    with_verdict,
)
from sklearn_pgnn.experiment_design.power import PowerAnalysis
from sklearn_pgnn.experiment_design.separation import (
    Separation,
    are_same,
    separate,
)
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import read_catalogue
from sklearn_pgnn.physics.effects.differences import DIFFERENCES
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.readings import reading
from sklearn_pgnn.record_quality.checks import check_data_quality
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.simulation.finite_run import simulate_quantities
from sklearn_pgnn.simulation.noise_option import read_noise_std
from sklearn_pgnn.simulation.record_windows import without_gaps
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.threads import local_threads, one_thread_each, other_processes
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.trajectories.validation import (
    GapScoreMixin,
    check_model,
    require_target,
    tags_of_records,
    validate_table,
)
from sklearn_pgnn.user_line import warn_user


class ModelDiagnosis(MultiOutputMixin, GapScoreMixin, BaseEstimator):
    r"""Name the physical causes of a model's error and extend the model by them.

    Every cause of the catalogue is fitted together with the model's free parameters and the
    initial states on short windows of the records (multiple shooting). Hypotheses are compared by
    one statistic, a held-out likelihood ratio,

    .. math:: \Lambda = \sum_o \frac{n_o}{2 \tau_o} \log \frac{S_{o,0}}{S_{o,1}} - (V_1 - V_0),

    see `sklearn_pgnn.estimation.criterion`. With :math:`N` candidates and the overdispersion
    :math:`\phi` of the residuals along it, a cause is named if
    :math:`\Lambda > \phi \log(N/\alpha)`, if it explains `smallest_share` of an output's error,
    and if the free-run simulation does not contradict it; a cause that adds states must also
    improve the free run, since the initial values of these states are free in every window. A free
    run that is not informative, such as that of a chaotic machine, does not count.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    catalogue : sequence of type[Effect] or str, optional
        Effects to consider, or their ids; by default `sklearn_pgnn.effects.CATALOGUE`.
    targets : sequence of str, optional
        Ports, states, inputs, outputs and parameters that may be targets; by default all.
    max_causes : int, default=4
        Largest number of causes named.
    window_length : float, optional
        Window length [s], used as given; by default selected from the records. At least 20
        samples, and at most so long that four windows are left.
    noise_std : array-like of shape (n_outputs,), optional
        Standard deviation of each output's noise, in its unit: finite and above 0. A single number
        is accepted if there is one output. By default estimated from the records.
    alpha : float, default=0.01
        False-alarm rate: the chance that a cause is named where nothing is missing.
    smallest_share : float, default=0.05
        Smallest share of an output's error power, over windows or in free run, that matters.
    hold : {"auto", "zoh", "foh"}, default="auto"
        Whether an input is held constant between two samples (``"zoh"``) or interpolated linearly
        (``"foh"``); by default as the model's `simulation` specifies, else held, unless the records
        contradict it.
    substeps : int, optional
        Integration steps per sample; by default as the model's `simulation` specifies, else as many
        as accuracy needs.
    time_column : int or str, optional
        Column of X that holds the time; by default the first, or ``"t"``.
    n_jobs : int, optional
        Processes that fit hypotheses in parallel, if the fits take longer than starting the
        processes, and threads for simulation; -1 means all cores. None means 1, unless a
        `joblib.parallel_config` says otherwise; its backend decides where the processes run, the
        threads run on this computer. No result depends on it.
    random_state : int, RandomState or None, default=0
        Draws the resampled windows for the gain's interval.
    progress : callable, optional
        Called as ``progress(stage, done, total)`` while fitting, before every step of every fit;
        `done` is at most `total`. An intermediate stage that begins with
        ``"best candidate so far: "`` names the causes that leave the least error until then.
        `detectability` calls it, too, after every effect.
    time_limit : float, optional
        Time [s] for everything, from the call of `fit` on. The search leaves a fifth of it, at most
        a minute, for what follows: whether what it has found until then is named beside the other
        causes, errors and intervals. It stops at the next step of a fit, what it holds is
        provisional, and fits that the result needs end after two steps where all the time is up.
    compare_records : bool, default=True
        Whether what differs between records, or since some time, may be a cause. The extended model
        then has a further input, see `groups_`.
    verbose : int, default=0
        Whether to show the stage and the best so far: in a terminal by a bar, elsewhere, as in a
        notebook or a file, by a line at every stage and every few seconds.

    Attributes
    ----------
    verdict_ : str
        One of ``"cause_named"``, ``"ambiguous"``, ``"unexplained"``, ``"provisional"``,
        ``"predicts_nothing"``, ``"nothing_found"`` and ``"model_adequate"``, see :ref:`left`.
    causes_ : tuple of NamedCause
        The missing causes, the most important first, each with its probability and those of its
        rivals.
    extended_model_ : PhysicsModel
        The prior, re-tuned and extended by the causes. Its `simulation` holds the hold and the
        substeps with which it was judged, its `initial_state` the estimated state at the start of
        the first record.
    refitted_model_ : PhysicsModel
        The prior, re-tuned only.
    parameters_ : dict of str to RetunedParameter
        The prior's free parameters in the extended model, the formula included if there is one.
    gain_ : dict of str to Gain
        Held-out error of every output for the prior as given, re-tuned, extended, and, where there
        is a formula, with it, over windows and in free run.
    free_run_ : dict of str to FreeRunError
        Error of every output over whole records: .prior, .refitted, .extended and .formula,
        simulated without restarts, each from initial states found as in `initial_states_`;
        infinite where a simulation becomes non-finite.
        Its .tells is false where the free run of a chaotic or unstable machine is not informative.
    initial_states_ : ndarray of shape (n_trajectories, n_states)
        State of the extended model at the start of every trajectory: as given in X, for `settled`
        states as the first input determines it, and otherwise as fitted to the trajectory's
        beginning: its first window, or twice as long, and so on, while that makes it more certain.
    window_ : float
        Window length used [s].
    substeps_ : int
        Integration steps per sample.
    hold_ : {"zoh", "foh"}
        How inputs were interpolated between samples.
    remaining_ : Remaining
        The residuals that the causes leave: .kind, one of ``"noise"``, ``"disturbance"`` (coloured
        noise of a sensor, or an external disturbance: no law that was tried predicts it) and
        ``"structure"``, with .times_noise of every output, and in .law where a law without a name
        acts, what it depends on, its memory [s] and the share of the error that it explains;
        .in_free_run what the fit's errors do not explain there; .predicts_nothing if no output is
        predicted better than without a model.
    discrepancy_ : MissingPart or None
        A missing part that is not in the catalogue: where it acts, what it depends on, and a
        formula for it.
    candidates_ : tuple of Tried
        Every candidate, the best first: .effect, .target and .left, the share of the re-tuned
        prior's error power that remains with this candidate alone.
    data_quality_ : tuple of Finding
        Faults of the records: clipping, lost samples, feedback, poor excitation.
    separations_ : tuple of Separation
        For causes that these records cannot distinguish, the experiments that would.
    unusable_ : tuple of Unusable
        Candidates that could not be fitted for numerical reasons: .effect, .target, .reason.
    stopped_ : str or None
        Why the diagnosis ended early, and at what stage.
    complete_ : bool
        Whether the search ran to completion; otherwise the results are the best so far.
    tested_ : bool
        Whether every cause was tested against the rest of the catalogue; otherwise, after an early
        end, the causes are provisional and have no probabilities.
    groups_ : dict of str to tuple of str
        The records of every column, an input, that the extended model has beyond the prior: it is
        one in these records, which differ from the others, and zero in all others.
    records_ : DiagnosisRecords
        The records and the fits of the models, for plots.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Their names, if X has any.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_pgnn import PhysicsModel, effects
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"},
    ...                     inertia={"v": "m"})
    >>> t = np.arange(0, 60, 0.02)
    >>> F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    >>> rig = cart + effects.CoulombFriction("v", level=0.4)
    >>> v = rig.simulate(t, F, substeps=5).y + 1e-3 * np.random.default_rng(0).normal(
    ...     size=(t.size, 1))
    >>> diagnosis = ModelDiagnosis(cart).fit(np.column_stack([t, F]), v)
    >>> diagnosis.causes_[0].effect
    'coulomb_friction'
    """

    #: reports stages while a method runs
    _show: Callable[..., None] | None = None

    def __init__(
        self,
        model: PhysicsModel,
        *,
        catalogue: Sequence[type[Effect] | str] | None = None,
        targets: Sequence[str] | None = None,
        max_causes: int = 4,
        window_length: float | str | None = None,
        noise_std: ArrayLike | Mapping[str, float] | None = None,
        alpha: float = 0.01,
        smallest_share: float = 0.05,
        hold: str = "auto",
        substeps: int | None = None,
        time_column: Column | None = None,
        n_jobs: int | None = None,
        random_state: RandomState = 0,
        progress: Callable[[str, int, int], None] | None = None,
        time_limit: float | None = None,
        compare_records: bool = True,
        verbose: int = 0,
    ):
        self.model = model
        self.catalogue = catalogue
        self.targets = targets
        self.max_causes = max_causes
        self.window_length = window_length
        self.noise_std = noise_std
        self.alpha = alpha
        self.smallest_share = smallest_share
        self.hold = hold
        self.substeps = substeps
        self.time_column = time_column
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.progress = progress
        self.time_limit = time_limit
        self.compare_records = compare_records
        self.verbose = verbose

    def __sklearn_is_fitted__(self) -> bool:
        """Return whether the diagnosis has a verdict."""
        return hasattr(self, "verdict_")

    def __sklearn_tags__(self) -> Tags:
        """Return tags: X may hold NaN, and scores on random data are poor."""
        return tags_of_records(super().__sklearn_tags__())

    @with_progress
    @one_thread_each()
    def fit(self, X: Table, y: Table) -> Self:
        """Diagnose the model on records.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and, where known, initial states; see `read_records`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs.

        Returns
        -------
        self : ModelDiagnosis
            The fitted diagnosis.

        Raises
        ------
        ValueError
            If X or y cannot be read as records of the model, or hold too few data; if the model
            cannot be simulated on them; if an option has an invalid value.

        Notes
        -----
        A stage that fails once there is a result is left out: a `DiagnosisWarning` is issued in
        place of the error, and `stopped_` says what failed. An interrupt is raised again after the
        best result so far is kept: there is one if there is a `verdict_`.
        """
        check_model(self.model)
        check_options(self.hold, self.alpha, self.smallest_share)
        check_max_causes(self.max_causes)
        check_time_limit(self.time_limit)
        progress = Progress(self._show, self.time_limit)
        check_targets(self.model, self.targets, read_catalogue(self.catalogue))
        read_noise_std(self.noise_std, list(self.model.outputs))
        require_target(self, X, y)
        X = validate_table(self, X, reset=True)
        whole = read_records(self.model, X, y, time_column=self.time_column)
        refuse_standardised(self.model, whole)
        records = without_gaps(whole, self.window_length)
        check_records(self.model, records)
        self._single_output = np.asarray(y).ndim == 1
        self._forget()
        progress.begin("reading the records")
        said = self.model.simulation.get("hold") if self.hold == "auto" else self.hold
        investigation = self._investigation(records, progress)
        try:
            investigation.run(hold_of(self.model, said), is_told=said is not None)
            self._keep_best(investigation)
            self._conclude(investigation, whole)
        except (Exception, KeyboardInterrupt) as error:
            self._rescue(investigation, error)
            raise
        self._warn_of_clocks(whole)
        self._warn_of_failure(progress)
        return self

    def _warn_of_failure(self, progress: Progress) -> None:
        """Warn if a stage failed; what was found without it is kept."""
        if progress.failed is not None:
            message = (
                f"a stage of the diagnosis failed ({self.stopped_}); the results without it are "
                f"kept, and stopped_ says so. Remedy: report it as a bug of sklearn-pgnn."
            )
            warning = DiagnosisWarning(message)
            warning.__cause__ = progress.failed
            warn_user(warning, DiagnosisWarning)

    def _warn_of_clocks(self, records: Sequence[Record]) -> None:
        """Warn if only the extended model depends on time and a record does not begin at t = 0."""
        counted = self.model.is_autonomous and not self.extended_model_.is_autonomous
        late = [record for record in records if record.origin]
        if counted and late:
            warn_user(
                f"the time in the equations of the extended model counts from the first sample of "
                f"each trajectory, but the clock of {late[0].name!r} begins at "
                f"{late[0].origin:.12g} s. Remedy: subtract each trajectory's first time before "
                f"simulating the extended model on it.",
                RecordWarning,
            )

    def _forget(self) -> None:
        """Delete the fitted attributes of an earlier fit, so that none is taken for this one's."""
        for name in list(vars(self)):
            if name.endswith("_") and name not in ("n_features_in_", "feature_names_in_"):
                delattr(self, name)

    def _investigation(self, records: tuple[Record, ...], progress: Progress) -> Investigation:
        """Return the search, ready to run on records."""
        catalogue = read_catalogue(self.catalogue)
        warn_of_taken_names(self.model, catalogue, self.targets)
        return Investigation(
            self.model,
            records,
            possible_causes(self.model, catalogue, self.targets, progress.tick),
            self.alpha,
            self.smallest_share,
            self.max_causes,
            progress,
            {
                "window_length": self.window_length,
                "noise_std": self.noise_std,
                "substeps": self.substeps,
                "threads": local_threads(self.n_jobs),
                "n_processes": other_processes(self.n_jobs),
            },
            compares_records=self.compare_records,
        )

    def _rescue(self, investigation: Investigation, error: BaseException) -> None:
        """Keep the best so far where an error ends the fit."""
        investigation.progress.end(error)
        with suppress(Exception):  # what has failed once may fail again: the first error is raised
            if not hasattr(self, "verdict_"):
                self._keep_best(investigation)
            self.stopped_: str | None = investigation.progress.ended

    def _keep_best(self, investigation: Investigation) -> None:
        """Keep the best of what was found of which all results can be computed."""
        progress = investigation.progress
        progress.counts = False
        progress.begin("held-out error")
        for found in investigation.from_the_best():
            with progress.kept():
                return self._keep(found, investigation, progress)
        raise progress.failed or LookupError("nothing was found")

    def _keep(self, found: Findings, investigation: Investigation, progress: Progress) -> None:
        """Set the fitted attributes from what was found; the verdict is set last."""
        names = [record.name for record in investigation.records]
        fitter, result = found.search.fitter, found.result
        problem, final = fitter.problem, result.final
        errors = parameter_errors(problem, final)
        proposal, trials = found.proposal, found.trials
        part = None if proposal is None else describe(problem, proposal)
        self.causes_ = name_causes(found.search, result, errors)
        self.gain_ = measure_gain(fitter, trials, _seed(self.random_state))
        if proposal is not None:  # parameters are those of the model with the formula
            errors = parameter_errors(problem, proposal.trial)
        whole = final if proposal is None else proposal.trial
        self.parameters_ = retuned_parameters(problem, whole.fit, errors)
        self.refitted_model_ = as_judged(problem, result.base.fit)
        self.extended_model_ = as_judged(problem, final.fit)
        self.window_ = problem.scales.window
        self.substeps_, self.hold_ = problem.windows.substeps, problem.windows.hold
        tried = [Tried(c.id, c.target, *share) for c, share in result.alone.items()]
        self.candidates_ = tuple(sorted(tried, key=lambda candidate: candidate.left))
        self._keep_runs(found, names, part)
        self.groups_ = dict(investigation.groups)
        self.data_quality_: tuple[Finding, ...] = found.of_wiring
        self.separations_: tuple[Separation, ...] = ()
        self.unusable_, self.complete_ = fitter.unusable, result.complete
        self.tested_, self.stopped_ = result.complete, progress.ended
        self.remaining_ = found.remaining
        self.verdict_ = found.verdict  # the last: it says that all is there

    def _keep_runs(self, found: Findings, names: list[str], part: MissingPart | None) -> None:
        """Set the records, and what the models leave of them."""
        fitter, trials = found.search.fitter, found.trials
        fits = {"prior": fitter.prior, **{which: trial.fit for which, trial in trials.items()}}
        causes = found.result.final.hypothesis.order
        self.records_ = keep_records(fitter.problem, fits, causes, names)
        error = math.nan if part is None else error_together(self.gain_, self.records_, "formula")
        self.discrepancy_ = part and replace(part, error=error)
        self.initial_states_ = self.records_.starts["extended"]
        tells = np.any([fitter.held_out(trial).tells for trial in trials.values()], axis=0)
        self.free_run_ = free_run_errors(self.records_, tells)

    def _conclude(self, investigation: Investigation, whole: tuple[Record, ...]) -> None:
        """Compute the remaining results, as far as the time allows."""
        progress, found = investigation.progress, investigation.so_far()
        failures = found.search.fitter.failures
        for stage, what in (
            ("quality of the records", lambda: self._check_data_quality(found, whole)),
            ("experiments that separate", lambda: self._separate(found.search.criterion, progress)),
        ):
            with progress.spare_time(), failures.tolerate(stage, stage, ""):
                progress.begin(stage)
                what()
        self.unusable_, self.stopped_ = failures.entries(), progress.ended

    def _check_data_quality(self, found: Findings, whole: tuple[Record, ...]) -> None:
        result, proposal = found.result, found.proposal
        findings = check_data_quality(
            found.search.fitter.problem,
            list(self.records_.names),
            whole,
            result.base.fit,
            result.final.fit,
            None if proposal is None else proposal.trial.fit,
            found.search.progress.tick,
        )
        for finding in findings:  # what was found until the time is up is kept
            self.data_quality_ = (*self.data_quality_, finding)

    def _separate(self, criterion: SelectionCriterion, progress: Progress) -> None:
        """Find experiments that separate each cause from its equivalents and its next rival."""
        try:
            self._separate_all(criterion, progress)
        finally:  # also of those that the time sufficed for
            self.causes_ = tuple(with_equivalent(each, self.separations_) for each in self.causes_)

    def _separate_all(self, criterion: SelectionCriterion, progress: Progress) -> None:
        for cause in self.causes_:
            mine, others = self._cause(cause), cause.confused_with
            same = [o for o in others if are_same(self.records_, mine, self._cause(o))]
            rest = [other for other in others if other not in same]
            for other in [*same, *rest[:1]]:
                theirs, tick = self._cause(other), progress.tick
                whole = separate(self.records_, mine, theirs, criterion, each_step=tick)
                shown = replace(whole, experiments=whole.experiments[:KEPT])
                self.separations_ = (*self.separations_, shown)
                progress.step()

    def _criterion(self) -> SelectionCriterion:
        """Return the rule by which this diagnosis names causes."""
        candidates = possible_causes(self.model, read_catalogue(self.catalogue), self.targets)
        return SelectionCriterion(self.alpha, self.smallest_share, len(candidates))

    def _cause(self, named: Named) -> Effect:
        """Return the effect of the catalogue with a given id and target."""
        return effect_named(named, read_catalogue(self.catalogue))

    def predict(self, X: Table) -> Any:
        """Simulate the extended model in free run from every trajectory's initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and initial states; where records were found to differ, a DataFrame
            may also have the columns of `groups_`.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Simulated outputs. If a simulation becomes non-finite, all rows of that trajectory get
            the values of its first row, and a `SimulationWarning` is issued.

        Warns
        -----
        RecordWarning
            If X does not say whether its trajectories belong to a group of `groups_`: they are
            taken not to.
        """
        check_is_fitted(self)
        X, marks = split_marks(X, self.groups_)
        records = read_records(
            self.model, validate_table(self, X, reset=False), time_column=self.time_column
        )
        refuse_standardised(self.model, records)
        records = marked_records(records, marks)
        names = list(self.extended_model_.outputs)
        outputs = simulate_quantities(self.extended_model_, records, names)
        return outputs.ravel() if self._single_output else outputs

    def to_dict(self) -> dict:
        """Return the diagnosis as plain data, as in ``diagnosis.json``.

        Returns
        -------
        dict
            Verdict, data quality, causes with their probabilities and how to separate them, the
            remaining residuals, parameters, gain and free runs. Non-finite numbers are None.
        """
        check_is_fitted(self)
        return plain_diagnosis(self)

    def causes_frame(self) -> pd.DataFrame:
        """Return the named causes as a DataFrame, one row per parameter."""
        return frames.causes_frame(self)

    def parameters_frame(self) -> pd.DataFrame:
        """Return the prior's re-tuned parameters as a DataFrame, one row each."""
        return frames.parameters_frame(self)

    def gain_frame(self) -> pd.DataFrame:
        """Return the errors before and after extending as a DataFrame, one row per output."""
        return frames.gain_frame(self)

    def _html_repr(self) -> str:
        return reading("diagnosis_html")(self)

    def _repr_latex_(self) -> str | None:
        return reading("diagnosis_latex")(self)

    def to_html(self, path: FilePath) -> None:
        """Write the report, one self-contained file.

        Parameters
        ----------
        path : str or path-like
            Where to write.
        """
        reading("write_report")(self, path)

    @with_progress
    def detectability(
        self,
        effects: Sequence[type[Effect] | str] | None = None,
        targets: Sequence[str] | None = None,
        *,
        power: float = 0.9,
        sizes: Sequence[float] = (0.25, 0.5, 1.0, 2.0),
        noise: str = "residual",
        n_repeats: int = 200,
        verify: bool = False,
        random_state: RandomState = 0,
    ) -> Detectability:
        r"""Return the smallest size at which records like these would reveal each effect.

        Every effect is added to the extended model, which is simulated with the records' own
        inputs, initial states and noise; the model is then re-tuned, and the residuals are judged
        by the evidence, the share and the free run that a cause needs to be named. What may differ
        between records (``"parameter_difference"`` and the like) is another in the last of them.

        Parameters
        ----------
        effects : sequence of type[Effect] or str, optional
            The effects, or their ids; by default the catalogue of the diagnosis, and of several
            records what may differ between them.
        targets : sequence of str, optional
            The targets they act on; by default all that are possible.
        power : float, default=0.9
            Probability with which an effect of the smallest size is to be named.
        sizes : sequence of float, default=(0.25, 0.5, 1, 2)
            Multiples of the smallest size at which the table gives the power.
        noise : {"residual", "white"}, default="residual"
            Noise as correlated as the residuals of the extended model, or white of the same power.
        n_repeats : int, default=200
            Draws of the noise for every size.
        verify : bool, default=False
            Whether to run the diagnosis itself on simulated records, one run for every effect at
            its smallest size; as costly as that many diagnoses.
        random_state : int, RandomState or None, default=0
            Draws the noise.

        Returns
        -------
        Detectability
            Smallest sizes, powers and reasons: ``to_frame()``, ``plot()``.

        Raises
        ------
        ValueError
            If `power` is not between 0 and 1, or `noise` is unknown.

        Examples
        --------
        >>> import numpy as np
        >>> from sklearn_pgnn import PhysicsModel, effects
        >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5},
        ...                     {"F": "N"}, inertia={"v": "m"})
        >>> t = np.arange(0, 60, 0.02)
        >>> F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
        >>> v = cart.simulate(t, F).y + 1e-2 * np.random.default_rng(0).normal(size=(t.size, 1))
        >>> diagnosis = ModelDiagnosis(cart, catalogue=()).fit(np.column_stack([t, F]), v)
        >>> table = diagnosis.detectability([effects.CoulombFriction]).to_frame()
        >>> table[["effect", "parameter", "unit"]].values.tolist()
        [['coulomb_friction', 'level', 'm/s^2']]
        >>> bool(table["smallest"][0] < 0.05)
        True
        """
        check_is_fitted(self)
        several = DIFFERENCES if len(self.records_.names) > 1 else ()
        catalogue = read_catalogue(self.catalogue if effects is None else effects)
        catalogue = (*catalogue, *several) if effects is None else catalogue
        check_targets(self.model, targets, catalogue)
        check_detectability(power, noise)
        seed, white = _seed(random_state), noise == "white"
        analysis = PowerAnalysis(self.records_, white, self._criterion(), int(n_repeats), seed)
        asked = [(analysis, possible_causes(self.model, catalogue, targets))]
        if several and (kinds := [kind for kind in catalogue if kind in DIFFERENCES]):
            asked.append(in_last_record(analysis, kinds, targets))

        def diagnose(X: pd.DataFrame, y: pd.DataFrame) -> list[set[tuple[str, str]]]:
            settings = {"model": self.extended_model_, "catalogue": catalogue}
            silent = {"time_column": None, "progress": None, "verbose": 0}
            named = clone(self).set_params(**settings, **silent).fit(X, y).causes_
            return [{c[:2] for c in (pair_of(cause), *cause.confused_with)} for cause in named]

        rows: tuple[Detectable, ...] = ()
        for each, candidates in asked:
            of = detect_all(each, candidates, power, sizes, self.n_jobs, self._show)
            rows += tuple(with_verdict(each, row, diagnose) for row in of) if verify else of
        return Detectability(rows, float(power), tuple(map(float, sizes)))

    @one_thread_each()
    def separating_experiment(
        self, cause: Any = None, other: Any = None, *, reach: float = 1.0
    ) -> Separation:
        """Find the experiment that would separate a cause from another one.

        Both causes are fitted and simulated under designed inputs: steps, slow ramps, pulses with
        a long pause, sines and a sweep, each at several amplitudes. Each model is re-tuned to the
        outputs of the other; the remaining difference is the information of the experiment.
        Experiments that would drive an output beyond twice its range in the records are left out.

        Parameters
        ----------
        cause : NamedCause, Candidate or (str, str), optional
            A named cause, or its effect and target; by default the first.
        other : Candidate or (str, str), optional
            The cause to separate it from; by default the first that it is confused with.
        reach : float, default=1
            Largest amplitude, as a multiple of that in the records.

        Returns
        -------
        Separation
            Whether the two are equivalent in the equations, and if not the experiments, the most
            informative first.

        Raises
        ------
        ValueError
            If `cause` was not named, or there is no other.

        Examples
        --------
        >>> import numpy as np
        >>> from sklearn_pgnn import PhysicsModel, effects
        >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5},
        ...                     {"F": "N"}, inertia={"v": "m"})
        >>> t = np.arange(0, 60, 0.02)
        >>> F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
        >>> rig = cart + effects.InputBias("F", bias=0.3)
        >>> v = rig.simulate(t, F).y + 1e-3 * np.random.default_rng(0).normal(size=(t.size, 1))
        >>> catalogue = (effects.InputBias, effects.ConstantLoad)
        >>> diagnosis = ModelDiagnosis(cart, catalogue=catalogue).fit(np.column_stack([t, F]), v)
        >>> diagnosis.separating_experiment().equivalent
        True
        """
        check_is_fitted(self)
        causes = {self._cause(named): named for named in self.causes_}
        mine, theirs = two_to_separate(causes, read_catalogue(self.catalogue), cause, other)
        return separate(self.records_, mine, theirs, self._criterion(), reach)

    def plot(self) -> Any:
        """Plot the measured outputs with the simulations of the prior and the extended model.

        Returns
        -------
        DiagnosisDisplay
            The figure and its axes.
        """
        return reading("plot_diagnosis")(self)


def _seed(random_state: RandomState) -> int:
    return int(check_random_state(random_state).randint(2**31 - 1))
