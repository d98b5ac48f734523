"""A physical model whose parameters are fitted to records."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, MultiOutputMixin
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import ArrayLike, Column, RandomState, Table
from sklearn_pgnn.estimators.parameter_search import (
    SEARCHES,
    ParameterFit,
    Search,
    find_beside_free_run,
    find_in_free_run,
)
from sklearn_pgnn.estimators.profile import Profile
from sklearn_pgnn.estimators.progress import progress_printer
from sklearn_pgnn.estimators.simulated_predictions import SimulatingMixin
from sklearn_pgnn.exceptions import FitWarning, OptionError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_bounds
from sklearn_pgnn.simulation.finite_run import FreeRuns, limits_of
from sklearn_pgnn.simulation.intervals import (
    check_coverage,
    interval_around,
    output_variance,
    quantile_of,
)
from sklearn_pgnn.simulation.noise_option import read_noise_std
from sklearn_pgnn.simulation.record_windows import (
    WHOLE,
    median_window_length,
    output_noise,
    window_records,
    without_gaps,
)
from sklearn_pgnn.simulation.substeps import usual_step
from sklearn_pgnn.simulation.uncertainty import (
    NORMAL_95,
    Estimate,
    estimate_of,
    parameter_covariance,
    standard_errors,
    trusted_spread,
)
from sklearn_pgnn.threads import local_threads, one_thread_each
from sklearn_pgnn.trajectories.contradicted_states import (
    told_in_all,
    warn_of_contradicted_states,
    warn_of_missing_starts,
    warn_of_unknown_starts,
)
from sklearn_pgnn.trajectories.lost_units import refuse_standardised, warn_of_standardised_outputs
from sklearn_pgnn.trajectories.measured import of_measured, warn_of_constant_outputs
from sklearn_pgnn.trajectories.reader import read_records, rows_in_order
from sklearn_pgnn.trajectories.record import warn_of_repeats
from sklearn_pgnn.trajectories.validation import (
    GapScoreMixin,
    check_model,
    refuse_fit_params,
    require_target,
    tags_of_records,
    validate_table,
)
from sklearn_pgnn.user_line import warn_user

#: rise of a free run's squares, as a share of those before and of the noise's, that is told
WORSE, NOTABLE = 0.1, 0.25
#: half-width of an interval, as a share of the value, from which on its profile is looked at
HARDLY = 0.5
#: least share of the free-run error that another initial state has to remove
LEAST_SHARE = 0.05
#: ratio of its ends from which on an interval that reaches to a bound is open
FAR = 10.0
#: what a fit to windows can do about it
FREE_RUN = 'minimise the error of the free run (window_length="trajectory", option --free-run), '


class PhysicsModelRegressor(SimulatingMixin, MultiOutputMixin, GapScoreMixin, BaseEstimator):
    r"""Fit a model's free parameters to records; predict by simulation in free run.

    The records are cut into windows, each restarted from its own initial state (multiple
    shooting), and the parameters minimise the squared error over all windows. For poor starting
    values the range between the bounds can be searched first, as the particle swarm of [1]_ does.

    Parameters
    ----------
    model : PhysicsModel
        The model; its values are the start.
    free : sequence of str, optional
        Parameters to fit; by default all that are not fixed.
    within_spread : bool, default=False
        Whether parameters stay within their `Parameter.spread`, where all values are equally
        likely, as in a diagnosis and in the training with a network. By default they may take any
        value between their bounds.
    search : {"local", "global", "auto"}, default="auto"
        Whether to start from the model's values only, to search between the parameters' bounds
        first, or to do so if the local fit leaves more than three times the noise. A parameter
        without a bound is searched up to ten times its value away.
    window_length : float or "trajectory", optional
        Window length [s]; by default a third of the dominant period of the outputs. With
        ``"trajectory"`` every trajectory is one window: the error of the free run is minimised,
        from the model's values and from those of a fit to short windows; an initial state given
        in the first rows of all trajectories is kept, others are fitted.
    noise_std : array-like of shape (n_outputs,), optional
        Standard deviation of each output's noise, in its unit, as the weight of the output: finite
        and above 0. A single number is accepted where there is one output. By default estimated.
    hold : {"zoh", "foh"}, optional
        Whether an input is held between two samples or interpolated linearly; by default as the
        model's `simulation` says, else held.
    substeps : int, optional
        Integration steps from sample to sample; by default as the model's `simulation` says, else
        as many as accuracy needs.
    time_column : int or str, optional
        Column of X that holds the time; by default the first, or ``"t"``.
    n_jobs : int, optional
        Threads to simulate on; -1 means all cores of this computer. None means 1, unless a
        `joblib.parallel_config` that works on this computer says otherwise.
    random_state : int, RandomState instance or None, default=0
        Controls the random numbers of the global search.
    verbose : int, default=0
        Whether to print a line for every stage of the fit.

    Attributes
    ----------
    model_ : PhysicsModel
        The model at the fitted values; its `simulation` says how it was simulated for the fit. In
        states that X gives nowhere it starts where the trajectories did on average, if that lowers
        its free-run error notably.
    parameters_ : dict of str to Estimate
        Value, 95 % interval and unit of every fitted parameter. The interval holds also where the
        residuals are not white; it reaches to the bound on a side on which the records carry no
        information.
    initial_states_ : ndarray of shape (n_trajectories, n_states)
        Fitted state at the start of every trajectory, in the order of their first rows.
    window_ : float
        Median length of the windows [s].
    noise_ : ndarray of shape (n_outputs,)
        Standard deviation of the training records' noise, by which `predict_ahead` weighs outputs.
    hold_ : {"zoh", "foh"}
        How the inputs were assumed to vary between samples.
    substeps_ : int
        Integration steps for the sample interval of `fit`; longer intervals take more.
    method_ : {"rk4", "rosenbrock"}
        Scheme of a step: the second for models too fast for the first.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    ModelDiagnosis : Also finds what the model lacks.

    References
    ----------
    .. [1] R.-S. Goette, J. Timmermann, "Composed Physics- and Data-driven System Identification
       for Non-autonomous Systems in Control Engineering", 2021, arXiv:2112.08148.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 20, 401)
    >>> X = np.column_stack([t, np.sin(t)])
    >>> y = lag.with_parameters(T=3.0).simulate(t, X[:, 1]).y
    >>> print(round(PhysicsModelRegressor(lag).fit(X, y).parameters_["T"].value, 6))
    3.0
    """

    def __init__(
        self,
        model: PhysicsModel,
        *,
        free: Sequence[str] | str | None = None,
        within_spread: bool = False,
        search: str = "auto",
        window_length: float | str | None = None,
        noise_std: ArrayLike | Mapping[str, float] | None = None,
        hold: str | None = None,
        substeps: int | None = None,
        time_column: Column | None = None,
        n_jobs: int | None = None,
        random_state: RandomState = 0,
        verbose: int = 0,
    ):
        self.model = model
        self.free = free
        self.within_spread = within_spread
        self.search = search
        self.window_length = window_length
        self.noise_std = noise_std
        self.hold = hold
        self.substeps = substeps
        self.time_column = time_column
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose

    def fit(self, X: Table, y: Table, **fit_params: Any) -> Self:
        """Fit the free parameters.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and, where known, the states in each trajectory's first row.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs; NaN where there is none.
        **fit_params
            Nothing else: weights of samples are refused.

        Returns
        -------
        self : PhysicsModelRegressor
            The fitted regressor. A `FitWarning` names parameters that the records do not determine,
            another one says where the free run has become worse; and it is told where trajectories
            begin elsewhere than predictions do.

        Raises
        ------
        ValueError
            If X and y cannot be read as records of the model, or a parameter is unknown or
            invalid.
        """
        refuse_fit_params(self, fit_params)
        check_model(self.model)
        told = read_noise_std(self.noise_std, list(self.model.outputs))
        require_target(self, X, y)
        X = validate_table(self, X, reset=True)
        names = self._free_names()
        if self.search not in SEARCHES:
            raise ValueError(f"search: expected one of {', '.join(SEARCHES)}, got {self.search!r}.")
        records = read_records(self.model, X, y, time_column=self.time_column)
        refuse_standardised(self.model, records)
        warn_of_standardised_outputs(self.model, records)
        warn_of_contradicted_states(self.model, records)
        warn_of_constant_outputs(self.model, records, noise_is_told=told is not None)
        warn_of_repeats(records)
        pieces = without_gaps(records, self.window_length)
        found = self._find(pieces, names)
        windows = found.windowed.windows
        self.model_ = self._keep_model(found, records)
        loose = self._keep_estimates(found)
        _warn_of_loose(self.parameters_, loose)
        _warn_of_ends(found.fit.freedoms, self.model_, loose)
        firsts = found.fit.x0[np.searchsorted(windows.starts, windows.bounds[:-1])]
        starts = {piece.rows[0]: x0 for piece, x0 in zip(pieces, firsts, strict=True)}
        unknown = np.full(len(self.model.states), np.nan)
        self.initial_states_ = np.array([starts.get(record.rows[0], unknown) for record in records])
        self.window_ = median_window_length(windows)
        self.noise_ = output_noise(records) if told is None else told
        self.model_ = _with_usual_start(
            self.model_, records, self.initial_states_, self._runs, self.noise_
        )
        warn_of_unknown_starts(self.model_, records)
        self._told = told_in_all(records)
        self._single_output = np.asarray(y).ndim == 1
        self._keep_errors(found, records)
        self._warn_of_worse(records)
        return self

    def predict(self, X: Table) -> Any:
        """Simulate every trajectory in free run from its initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`; of the states only the first row of a trajectory is read, and a state that
            X lacks starts at ``model_.initial_state``.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Simulated outputs. All rows of a trajectory whose simulation diverges, to more than 1000
            times what was measured or to no number at all, get the values of the first row, which a
            `SimulationWarning` reports. A `RecordWarning` tells of a trajectory without the initial
            value of a state that every trajectory of `fit` had.
        """
        return self._shaped(self._simulate(self._read_new(X), self.model_.outputs))

    def predict_interval(self, X: Table, coverage: float = 0.9) -> tuple[np.ndarray, np.ndarray]:
        r"""Return the interval in which the measured outputs of a free run are expected.

        .. math:: \hat y_k \pm q \sqrt{J_k C J_k^T + s^2}

        with the sensitivities :math:`J_k` of the simulation to the parameters, their covariance
        :math:`C`, the root mean square :math:`s` of the fitted model's free-run error on the
        training records, and the quantile :math:`q` of that error in units of the square root. It
        holds for machines operated as in the training records, from initial states that are known
        equally well.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        coverage : float, default=0.9
            Share of the measurements that should lie in the interval.

        Returns
        -------
        low, high : ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Bounds of the interval.

        Raises
        ------
        OptionError
            If `coverage` is not a share between 0 and 1.

        Examples
        --------
        >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
        >>> t = np.linspace(0, 40, 801)
        >>> X = np.column_stack([t, np.sin(t)])
        >>> y = lag.simulate(t, X[:, 1]).y + 0.1 * np.random.default_rng(0).normal(size=(801, 1))
        >>> low, high = PhysicsModelRegressor(lag).fit(X, y).predict_interval(X)
        >>> print(round(float(np.mean((low <= y) & (y <= high))), 2))
        0.9
        """
        check_coverage(coverage)
        records = self._read_new(X)
        predicted = self._simulate(records, self.model_.outputs)
        variance = rows_in_order(records, self._variance(records))
        low, high = interval_around(
            predicted, quantile_of(self._left, coverage) * np.sqrt(variance)
        )
        return self._shaped(low), self._shaped(high)

    def _read(self, X, y=None):
        """Read the records of a table; y need not be enough for a fit."""
        check_is_fitted(self)
        X = validate_table(self, X, reset=False)
        records = read_records(self.model, X, y, time_column=self.time_column, to_fit=False)
        refuse_standardised(self.model, records)
        return records

    def _read_new(self, X):
        """Read the records of a table to be predicted without y, and tell what starts it lacks."""
        records = self._read(X)
        warn_of_missing_starts(self.model_, self._told, records)
        return records

    def _states_of(self, X) -> np.ndarray:
        return self._simulate(self._read_new(X), self.model_.states)

    def _simulate(self, records, names) -> np.ndarray:
        return self._runs.simulate(self.model_, records, list(names))

    def _variance(self, records) -> np.ndarray:
        """Return the variance of measurements about a free run, records concatenated."""
        names = tuple(self.parameters_)
        parts = [
            output_variance(
                self._runs.model_along(self.model_, each), each, names, self._covariance
            )
            for each in records
        ]
        return np.concatenate(parts) + self._error**2

    @one_thread_each()
    def _keep_errors(self, found, records) -> None:
        """Keep the free-run errors of predictions for the fit's records, for intervals."""
        self._covariance = parameter_covariance(found.fit, found.expected, found.spread)
        runs = [self._runs.run(self.model_, record) for record in records]
        with np.errstate(over="ignore", invalid="ignore"):
            left = np.concatenate([run.y - r.y for run, r in zip(runs, records, strict=True)])
            square = of_measured(np.nanmean, left**2)
            self._error = np.sqrt(np.maximum(square, np.finfo(float).tiny))
            self._left = np.sort(np.abs(left) / np.sqrt(self._variance(records)), axis=0)

    @one_thread_each()
    def _find(self, records, names) -> ParameterFit:
        """Cut the records into windows and fit the parameters."""
        options: dict[str, Any] = {
            "noise_std": self.noise_std,
            "hold": self.hold,
            "substeps": self.substeps,
            "threads": local_threads(self.n_jobs),
        }
        progress = progress_printer(self)
        search = Search(
            self.model, names, self.search, self.random_state, progress, bool(self.within_spread)
        )
        windowed = window_records(self.model, records, window_length=self.window_length, **options)
        windows = windowed.windows
        progress(
            f"{len(records)} trajectories, {windows.t.size} samples, {len(windows)} windows, "
            f"{windows.substeps} substeps; free: {', '.join(names) or 'none'}"
        )
        if self.window_length != WHOLE:
            whole = partial(window_records, self.model, records, window_length=WHOLE, **options)
            return find_beside_free_run(search, windowed, whole)
        short = window_records(self.model, records, **options)
        return find_in_free_run(search, short, windowed)

    def _free_names(self) -> tuple[str, ...]:
        if isinstance(self.free, str):
            raise OptionError(
                f"free: expected a sequence of parameters among "
                f"{', '.join(self.model.parameters)}, got {self.free!r}. Remedy: "
                f"free=[{self.free!r}]."
            )
        names = self.model.free_parameters if self.free is None else tuple(self.free)
        unknown = [name for name in names if name not in self.model.parameters]
        if unknown:
            raise ValueError(
                f"free: expected parameters among {', '.join(self.model.parameters)}, "
                f"got {unknown[0]!r}."
            )
        if not self.within_spread:
            return names
        still = [name for name in names if self.model.parameters[name].reach == 0]
        if still and self.free is not None:
            raise ValueError(
                f"free: expected parameters that can be fitted, got {still[0]!r}, whose value is "
                f"0, with a spread relative to the value. Remedy: spread=inf for it in the model, "
                f"or within_spread=False."
            )
        return tuple(name for name in names if name not in still)

    def _keep_model(self, found: ParameterFit, records) -> PhysicsModel:
        """Keep how the fitted model is simulated, and return it."""
        windows = found.windowed.windows
        self.hold_, self.substeps_, self.method_ = windows.hold, windows.substeps, windows.method
        limits = limits_of(np.concatenate([record.y for record in records]))
        interval = usual_step(records)
        self._simulated = (interval, self.substeps_, limits, self.hold_, self.method_)
        said = {"hold": self.hold_, **windows.steps.settings}
        return found.fit.model.replace(simulation=said)

    def _keep_estimates(self, found: ParameterFit) -> list[str]:
        """Keep values with intervals; return the names of those that are not determined."""
        spread = trusted_spread(found.fit, found.expected, found.spread)
        errors = standard_errors(found.fit, found.expected, spread)
        self.parameters_ = {name: estimate_of(self.model_, name, errors) for name in errors}
        loose = [name for name, error in errors.items() if not np.isfinite(error)]
        for name, error in errors.items():
            value = abs(self.model_.parameters[name].value)
            if np.isfinite(error) and NORMAL_95 * error > HARDLY * value > 0:
                low, high = Profile(found, name, error).interval()
                self.parameters_[name] = replace(self.parameters_[name], low=low, high=high)
                loose += [name] if self._is_wide(name) else []
        return loose

    def _is_wide(self, name: str) -> bool:
        """Return whether an interval is open, or wider than the parameter is large."""
        found, prior = self.parameters_[name], abs(self.model.parameters[name].value)
        size = max(prior, abs(found.value)) if prior else np.inf
        low, high = self.model_.parameters[name].bounds
        is_open = found.high == high or found.low == low > 0
        is_far = not 0 < found.high <= FAR * found.low
        return (is_open and is_far) or found.high - found.low > 2 * size

    def _warn_of_worse(self, records) -> None:
        """Warn where the given values are nearer to the records in free run than fitted ones."""
        given = self.model.replace(initial_state=self.model_.initial_state)
        before, after = (
            _free_run_error(each, records, self._runs, self.noise_) for each in (given, self.model_)
        )
        count = max(1, sum(int(np.isfinite(record.y).sum()) for record in records))
        if not after - before > max(WORSE * before, NOTABLE * count):
            return
        own = "" if self.window_length == WHOLE else FREE_RUN
        warn_user(
            f"in free run the fitted model is further from the records than the given one: the "
            f"error is {np.sqrt(after / count):.4g} times the noise, before "
            f"{np.sqrt(before / count):.4g}. Remedy: {own}give values nearer to the truth, or "
            f"narrower bounds; if no value fits, physics is missing: ModelDiagnosis(model) looks "
            f"for it.",
            FitWarning,
        )

    def __sklearn_tags__(self):
        return tags_of_records(super().__sklearn_tags__())


def _warn_of_loose(found: dict[str, Estimate], loose: list[str]) -> None:
    """Warn of parameters that the records do not determine, and say where they may lie."""
    if not loose:
        return
    said = [
        f"{name} from {each.low:.3g} to {each.high:.3g} {each.unit}".rstrip()
        for name, each in ((name, found[name]) for name in loose)
        if np.isfinite([each.low, each.high]).any()
    ]
    where = f" ({', '.join(said)})" if said else ""
    warn_user(
        f"the records do not determine {', '.join(loose)}: other values fit equally well{where}. "
        f"Remedy: fix known parameters (leave them out of 'free'), or excite the machine more "
        f"richly.",
        FitWarning,
    )


def _warn_of_ends(freedoms, model, loose: list[str]) -> None:
    """Warn of parameters that ended at a limit of their spread, or, if determined, at a bound."""
    values = {each.name: model.parameters[each.name].value for each in freedoms}
    ends = [
        each.name
        for each in freedoms
        if np.isfinite(each.spread) and values[each.name] in (each.low, each.high)
    ]
    if ends:
        warn_user(
            f"{', '.join(ends)} ended at a limit of the spread or bounds. Remedy: a larger spread "
            f"in the model, or within_spread=False; if they compensate for missing physics, "
            f"ModelDiagnosis(model) looks for it.",
            FitWarning,
        )
    fitted = {each.name for each in freedoms} - {*ends, *loose}
    for name in (name for name in at_bounds(model) if name in fitted):
        low, high = model.parameters[name].bounds
        warn_user(
            f"{name} ended at a bound ({low:g} to {high:g}): the records want a value beyond it, "
            f"or tell it only together with others. Remedy: widen the bounds, if the machine may "
            f"be so; else the model lacks something, and ModelDiagnosis(model) looks for it.",
            FitWarning,
        )


def _with_usual_start(
    model: PhysicsModel, records, found: np.ndarray, runs: FreeRuns, noise: np.ndarray
) -> PhysicsModel:
    """Return a model that starts where its records did on average, if that describes them better.

    A machine at rest stays exactly there: what noise adds to a fitted state changes no error.
    """
    told = np.isfinite(np.array([record.x0 for record in records])).any(axis=0).tolist()
    means = {
        state: float(np.mean(column[np.isfinite(column)]))
        for state, column, is_told in zip(model.states, found.T, told, strict=True)
        if not is_told and state not in model.settled and np.isfinite(column).any()
    }
    if not means:
        return model
    other = model.replace(initial_state={**model.initial_state, **means})
    own, moved = (_free_run_error(each, records, runs, noise) for each in (model, other))
    return other if moved < (1 - LEAST_SHARE) * own else model


def _free_run_error(model, records, runs: FreeRuns, noise) -> float:
    """Return the sum of squares of a free run's errors, infinite where one diverges."""
    total = 0.0
    for record in records:
        with np.errstate(all="ignore"):
            left = (runs.run(model, record).y - record.y) / noise
            total += float(np.sum(left**2, where=np.isfinite(record.y)))
    return total if np.isfinite(total) else np.inf
