"""The diagnosis as an estimator: records in, verdict, causes and an extended model out."""

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from joblib import effective_n_jobs
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.diagnosis.beyond import Beyond
from sklearn_pgnn.diagnosis.data_quality import check_data_quality, clipped_outputs
from sklearn_pgnn.diagnosis.detectability import Bench, Detectability, detect_all
from sklearn_pgnn.diagnosis.disturbance import find_disturbance
from sklearn_pgnn.diagnosis.fitting import Fitter, Trial
from sklearn_pgnn.diagnosis.ground import (
    check_prior,
    fit_window_length,
    look_further,
    speaks_for_slopes,
)
from sklearn_pgnn.diagnosis.hypothesis import Cause, Hypothesis, check_targets, possible_causes
from sklearn_pgnn.diagnosis.injection import verified
from sklearn_pgnn.diagnosis.judge import Rules
from sklearn_pgnn.diagnosis.records import keep_records
from sklearn_pgnn.diagnosis.result import (
    NamedCause,
    Suspect,
    Tried,
    measure_gain,
    name_causes,
    parameter_errors,
    plain,
    retuned_parameters,
)
from sklearn_pgnn.diagnosis.search import Outcome, Search
from sklearn_pgnn.diagnosis.separation import Separation, are_same, plain_separation, separate
from sklearn_pgnn.diagnosis.setting import check_records, make_setting, with_prior_spreads
from sklearn_pgnn.diagnosis.unexplained import MissingPart
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.effects import SensorSaturation, read_catalogue
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.readings import reading
from sklearn_pgnn.simulation.record_windows import without_gaps
from sklearn_pgnn.simulation.simulate import HOLDS, simulate_records
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.trajectories import read_records, rows_in_order
from sklearn_pgnn.trajectories.validation import check_model, validate_table

#: what is left above the noise, as a share of the re-tuned prior's error power, when a cause
#: outside the catalogue must be at work
UNEXPLAINED = 0.1
#: experiments that are kept for two causes
SHOWN = 3


class ModelDiagnosis(MultiOutputMixin, RegressorMixin, BaseEstimator):
    r"""Name the physical causes of a model's error and extend the model by them.

    Every cause of the catalogue is fitted together with the model's free parameters and the
    initial states on short windows of the records. Causes are added while they lower the error of
    windows that their parameters have not seen, and dropped when others make them needless; the
    search ends where only noise is left.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    catalogue : sequence of type[Effect] or str, optional
        Effects to think of, or their ids; by default `sklearn_pgnn.effects.CATALOGUE`.
    targets : sequence of str, optional
        States, inputs, outputs and parameters to suspect; by default all.
    max_causes : int, default=4
        Causes named at most.
    window : float, optional
        Window length [s]; by default the records tell.
    noise : array-like of shape (n_outputs,), optional
        Standard deviation of the outputs' noise; by default the records tell.
    significance : float, default=3
        A cause's held-out gain must be so many of its standard errors.
    hold : {"auto", "zoh", "foh"}, default="auto"
        Whether an input is held between two samples (``"zoh"``) or runs straight from one to the
        next (``"foh"``); by default held, unless the records speak against it.
    substeps : int, optional
        Integration steps from sample to sample; by default as many as accuracy needs.
    time : int or str, optional
        Column of X that holds the time; by default the first, or ``"t"``.
    n_jobs : int, optional
        Threads to simulate on; -1 means all.
    random_state : int, RandomState or None, default=0
        Draws the resampled windows of the gain's interval.
    progress : callable, optional
        Called as ``progress(stage, done, total)`` while fitting.

    Attributes
    ----------
    verdict_ : {"model_adequate", "cause_named", "ambiguous", "unexplained"}
        What the records say.
    causes_ : tuple of NamedCause
        What is missing, the most telling first.
    extended_model_ : PhysicsModel
        The prior, re-tuned and extended by the causes.
    refitted_model_ : PhysicsModel
        The prior, re-tuned only.
    parameters_ : dict of str to RetunedParameter
        The prior's free parameters in the extended model.
    gain_ : dict of str to Gain
        Held-out error of every output before, after re-tuning and after extending.
    window_ : float
        Window length used [s].
    substeps_ : int
        Integration steps from sample to sample.
    hold_ : {"zoh", "foh"}
        How the inputs were taken to run between samples.
    missing_ : MissingPart or None
        With the verdict ``"unexplained"``: where something is missing that the catalogue has no
        name for, what it depends on, and a formula for it.
    disturbance_ : Disturbance or None
        Where there is neither name nor formula: .target and .share of what acts like a slow
        disturbance from outside, if most of what is left does.
    tried_ : tuple of Tried
        Every suspect, the best first: .effect, .target and .left, the share of the re-tuned
        prior's error power it leaves alone.
    data_quality_ : tuple of Finding
        What in the records stands in the way: clipping, lost samples, feedback, poor excitation.
    separations_ : tuple of Separation
        For causes that these records cannot tell apart, the experiments that would.
    records_ : DiagnosisRecords
        The records and what the models make of them, for pictures.
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

    def __init__(
        self,
        model: PhysicsModel,
        *,
        catalogue=None,
        targets=None,
        max_causes=4,
        window=None,
        noise=None,
        significance=3.0,
        hold="auto",
        substeps=None,
        time=None,
        n_jobs=None,
        random_state=0,
        progress=None,
    ):
        self.model = model
        self.catalogue = catalogue
        self.targets = targets
        self.max_causes = max_causes
        self.window = window
        self.noise = noise
        self.significance = significance
        self.hold = hold
        self.substeps = substeps
        self.time = time
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.progress = progress

    def __sklearn_tags__(self):
        """Say that states may be NaN and that random numbers follow no physical model."""
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.regressor_tags.poor_score = True
        return tags

    def fit(self, X, y):
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
            If X or y cannot be read as records of the model, or hold too little; if the model
            cannot be simulated on them; if `hold` is none of its choices, or a target is
            none of the model's.
        """
        check_model(self.model)
        read_catalogue(self.catalogue)
        _check_hold(self.hold)
        check_targets(self.model, self.targets)
        if y is None:
            raise ValueError(
                f"{type(self).__name__} requires y to be passed, but the target y is None."
            )
        X = validate_table(self, X, reset=True)
        whole = read_records(self.model, X, y, time=self.time)
        records = without_gaps(whole, self.window)
        check_records(self.model, records)
        found = self._investigate(records)
        search, outcome, self.missing_, formula = found
        fitter = search.fitter
        self.verdict_ = _verdict(found)
        self._keep(fitter, search, outcome)
        self._warn_of_clocks(whole)
        nameless = self.verdict_ == "unexplained" and self.missing_ is None
        self.disturbance_ = find_disturbance(search.judge, outcome.final) if nameless else None
        self.data_quality_ = check_data_quality(
            fitter.setting,
            [record.name for record in records],
            whole,
            outcome.base.fit,
            outcome.final.fit,
            formula,
        )
        self.records_ = keep_records(fitter, outcome, (record.name for record in records))
        self.separations_ = self._separate()
        self.causes_ = tuple(self._with_equivalent(cause) for cause in self.causes_)
        self._single_output = np.asarray(y).ndim == 1
        return self

    def _warn_of_clocks(self, records) -> None:
        """Warn where the extended model alone contains the time, and a clock did not begin at 0."""
        counted = self.model.is_autonomous and not self.extended_model_.is_autonomous
        late = [record for record in records if record.origin]
        if counted and late:
            warnings.warn(
                f"the time in the equations of the extended model counts from the first sample of "
                f"each trajectory, but the clock of {late[0].name!r} begins at "
                f"{late[0].origin:.12g} s. Remedy: take the first time off each trajectory before "
                f"the extended model is simulated on it.",
                UserWarning,
                stacklevel=3,
            )

    def _investigate(self, records) -> "_Found":
        """Search with inputs that run between samples as the user says, or else as records do."""
        found = self._search(self._ground(records, "zoh" if self.hold == "auto" else self.hold))
        if self.hold == "auto" and speaks_for_slopes(found.search.fitter, found.outcome.final):
            again = self._search(self._ground(records, "foh"))
            found = min(found, again, key=_error)
        return self._further(found)

    def _further(self, found: "_Found") -> "_Found":
        """Search again in longer windows what stays unexplained, if slow states are hidden."""
        little = _verdict(found) == "unexplained" and _explained(found) < 1.0 - UNEXPLAINED
        further = look_further(found.search.fitter) if little and self.window is None else None
        return found if further is None else max(found, self._search(further), key=_explained)

    def _search(self, fitter: Fitter) -> "_Found":
        """Search the catalogue, and what it has no name for."""
        suspects = possible_causes(self.model, read_catalogue(self.catalogue), self.targets)
        rules = Rules(significance=self.significance, max_causes=self.max_causes)
        beyond = Beyond()
        shown = frozenset((SensorSaturation, output) for output in clipped_outputs(fitter.setting))
        search = Search(fitter, suspects, rules, self.progress or _silent, beyond.is_enough, shown)
        outcome, missing = beyond.judge(search, search.run())
        return _Found(search, outcome, missing, beyond.fit)

    def _ground(self, records, hold: str) -> Fitter:
        """Cut the records into windows, as long as the user or the records say."""
        setting = make_setting(
            self.model,
            records,
            window=self.window,
            noise=self.noise,
            hold=hold,
            substeps=self.substeps,
            threads=effective_n_jobs(self.n_jobs),
        )
        fitter = Fitter(setting) if self.window is not None else fit_window_length(setting)
        check_prior(fitter, [record.name for record in records])
        return fitter

    def _keep(self, fitter: Fitter, search: Search, outcome: Outcome) -> None:
        """Turn the outcome of the search into learned attributes."""
        setting, final = fitter.setting, outcome.final
        errors = parameter_errors(setting, final)
        self.causes_ = name_causes(fitter, outcome, search.judge.folds, errors)
        self.gain_ = measure_gain(
            fitter, outcome, search.judge.folds, np.random.default_rng(_seed(self.random_state))
        )
        self.parameters_ = retuned_parameters(setting, final.fit, errors)
        self.refitted_model_ = outcome.base.fit.model
        self.extended_model_ = with_prior_spreads(final.fit.model, self.model)
        self.window_ = setting.scales.window
        self.substeps_, self.hold_ = setting.windows.substeps, setting.windows.hold
        tried = [Tried(e.id, target, float(left)) for (e, target), left in outcome.tried.items()]
        self.tried_ = tuple(sorted(tried, key=lambda suspect: suspect.left))

    def _separate(self) -> tuple[Separation, ...]:
        """Tell every cause from those that are the same, and from the first that is not."""
        found = []
        for cause in self.causes_:
            mine, others = self._cause(cause), cause.confused_with
            same = [o for o in others if are_same(self.records_, mine, self._cause(o))]
            rest = [other for other in others if other not in same]
            for other in [*same, *rest[:1]]:
                whole = self.separating_experiment(cause, other)
                found.append(replace(whole, experiments=whole.experiments[:SHOWN]))
        return tuple(found)

    def _with_equivalent(self, cause: NamedCause) -> NamedCause:
        """Note which causes are the same as one, so that no record tells them apart."""
        mine = Suspect(cause.effect, cause.target)
        same = {f.other for f in self.separations_ if f.cause == mine and f.equivalent}
        return replace(cause, equivalent=tuple(o for o in cause.confused_with if o in same))

    def _cause(self, named) -> Cause:
        """Give an effect's class and its target for what names them."""
        effect, target = (named.effect, named.target) if hasattr(named, "effect") else named
        catalogue = read_catalogue(self.catalogue)
        for kind in catalogue:
            if effect in (kind, kind.id):
                return kind, target
        raise ValueError(
            f"cause: expected an effect of the catalogue "
            f"({', '.join(kind.id for kind in catalogue)}), got {effect!r}."
        )

    def predict(self, X):
        """Simulate the extended model in free run from every trajectory's initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and initial states.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Simulated outputs.
        """
        check_is_fitted(self)
        records = read_records(self.model, validate_table(self, X, reset=False), time=self.time)
        outputs = simulate_records(
            self.extended_model_, records, hold=self.hold_, substeps=self.substeps_
        )
        outputs = rows_in_order(records, outputs)
        return outputs.ravel() if self._single_output else outputs

    def to_dict(self) -> dict:
        """Give the diagnosis as plain data, as ``diagnosis.json`` holds it.

        Returns
        -------
        dict
            Verdict, data quality, causes, how to separate them, parameters and gain.
        """
        check_is_fitted(self)
        causes = []
        for cause in self.causes_:
            causes.append(
                {
                    "effect": cause.effect,
                    "target": cause.target,
                    "parameters": {k: plain(v) for k, v in cause.parameters.items()},
                    "gain_percent": cause.gain,
                    "confused_with": [
                        {**plain(other), "equivalent": other in cause.equivalent}
                        for other in cause.confused_with
                    ],
                }
            )
        return {
            "verdict": self.verdict_,
            "data_quality": [plain(finding) for finding in self.data_quality_],
            "causes": causes,
            "separations": [plain_separation(found) for found in self.separations_],
            "parameters": {name: plain(p) for name, p in self.parameters_.items()},
            "gain": {name: plain(gain) for name, gain in self.gain_.items()},
            "unexplained": None if self.missing_ is None else self.missing_.to_dict(),
            "disturbance": None if self.disturbance_ is None else plain(self.disturbance_),
            "window": self.window_,
            "hold": self.hold_,
        }

    def to_html(self, path) -> None:
        """Write the report, one self-contained file.

        Parameters
        ----------
        path : str or path-like
            Where to write.
        """
        reading("write_report")(self, path)

    def detectability(
        self,
        effects=None,
        targets=None,
        *,
        power=0.9,
        sizes=(0.25, 0.5, 1.0, 2.0),
        noise="residual",
        n_repeats=200,
        verify=False,
        random_state=0,
    ):
        r"""Tell how large an effect must be before records like these would show it.

        Every effect is put into the extended model, with the records' own inputs, initial states
        and noise; the model is re-tuned, and the diagnosis' own rules judge what is left.

        Parameters
        ----------
        effects : sequence of type[Effect] or str, optional
            The effects, or their ids; by default the catalogue of the diagnosis.
        targets : sequence of str, optional
            What they act on; by default all that is possible.
        power : float, default=0.9
            Chance with which the smallest size shall be named.
        sizes : sequence of float, default=(0.25, 0.5, 1, 2)
            Multiples of the smallest size at which the table tells the power.
        noise : {"residual", "white"}, default="residual"
            Noise as correlated as what the extended model leaves, or white of the same power.
        n_repeats : int, default=200
            Draws of the noise for every size.
        verify : bool, default=False
            Whether to run the diagnosis itself on simulated records with every effect at its
            smallest size; as dear as that many diagnoses.
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
        check_targets(self.model, targets)
        _check_detectability(power, noise)
        rules = Rules(significance=self.significance, max_causes=self.max_causes)
        seed = _seed(random_state)
        bench = Bench(self.records_, noise == "white", rules, int(n_repeats), seed)
        catalogue = read_catalogue(self.catalogue if effects is None else effects)
        rows = detect_all(bench, possible_causes(self.model, catalogue, targets), power)
        if verify:
            rows = tuple(verified(self, bench, row, catalogue) for row in rows)
        return Detectability(rows, float(power), tuple(map(float, sizes)))

    def separating_experiment(self, cause=None, other=None, *, reach=1.0):
        """Find the experiment that would tell a cause from another one.

        Both causes are fitted and simulated under designed inputs: steps, slow ramps, pulses with
        a long rest, sines and a sweep, each at several amplitudes. Each model is re-tuned to what
        the other shows; what it leaves is what the experiment would tell. Experiments that would
        drive an output beyond twice its range in the records are left out.

        Parameters
        ----------
        cause : NamedCause, Suspect or (str, str), optional
            A named cause, or its effect and target; by default the first.
        other : Suspect or (str, str), optional
            The cause to tell it from; by default the first that it is confused with.
        reach : float, default=1
            Largest amplitude, as a multiple of the records'.

        Returns
        -------
        Separation
            Whether the two are the same in the equations, and if not the experiments, the most
            telling first.

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
        if cause is None and not causes:
            raise ValueError("cause: expected a cause, but the diagnosis names none.")
        mine = self._cause(self.causes_[0] if cause is None else cause)
        if mine not in causes:
            named = ", ".join(f"{kind.id} of {target}" for kind, target in causes) or "nothing"
            raise ValueError(
                f"cause: expected one that was named ({named}), got {mine[0].id} of {mine[1]}."
            )
        confused = causes[mine].confused_with
        if other is None and not confused:
            raise ValueError(
                f"other: expected a cause, got none, and {mine[0].id} of {mine[1]} is confused "
                f"with nothing. Remedy: name the cause to tell it from."
            )
        theirs = self._cause(confused[0] if other is None else other)
        return separate(self.records_, mine, theirs, reach)

    def plot(self):
        """Draw measured against prior and extended simulation.

        Returns
        -------
        DiagnosisDisplay
            The figure and its axes.
        """
        return reading("plot_diagnosis")(self)


class _Found(NamedTuple):
    """A search, what it found, what has no name, and the fit of a formula for that."""

    search: Search
    outcome: Outcome
    missing: MissingPart | None
    formula: WindowFit | None


def _verdict(found: _Found) -> str:
    """Say in a word what a search came to."""
    judge, outcome = found.search.judge, found.outcome
    if found.missing is not None:
        return "unexplained"
    left, before = judge.excess(outcome.final), judge.excess(outcome.base)
    if not outcome.steps:
        enough = left < judge.rules.share * outcome.base.squares
        return "model_adequate" if enough else "unexplained"
    if left > UNEXPLAINED * before:
        return "unexplained"
    return "ambiguous" if any(outcome.alternatives.values()) else "cause_named"


def _explained(found: _Found) -> float:
    """Give the share of the error above the noise that causes, and a formula, explain."""
    judge, outcome = found.search.judge, found.outcome
    before = judge.excess(outcome.base)
    last = outcome.final if found.formula is None else Trial(Hypothesis(), found.formula)
    return 1.0 - judge.excess(last) / before if before > 0 else 0.0


def _error(found: _Found) -> float:
    """Give what the causes leave, a sample."""
    return found.outcome.final.squares / found.search.fitter.setting.n_samples


def _check_hold(hold) -> None:
    if hold not in ("auto", *HOLDS):
        raise OptionError(f"hold: expected one of auto, {', '.join(HOLDS)}, got {hold!r}.")


def _check_detectability(power, noise) -> None:
    if not 0 < power < 1:
        raise ValueError(f"power: expected a number between 0 and 1, got {power!r}.")
    if noise not in ("residual", "white"):
        raise ValueError(f"noise: expected 'residual' or 'white', got {noise!r}.")


def _silent(stage: str, done: int, total: int) -> None:
    """Show nothing."""


def _seed(random_state) -> int:
    return int(check_random_state(random_state).randint(2**31 - 1))
