"""Grey-box recipe as an estimator: diagnose, fit, learn the rest; the depth is cross-validated."""

from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, MultiOutputMixin
from sklearn.utils.validation import check_is_fitted, check_memory

from sklearn_pgnn.annotations import Column, Table
from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis
from sklearn_pgnn.estimators.progress import progress_printer, silence, with_progress
from sklearn_pgnn.estimators.simulated_predictions import SimulatingMixin
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.grey_box.cross_validation import (
    DepthJudge,
    check_window,
    is_unseen,
    training_error,
)
from sklearn_pgnn.grey_box.depth import FittedDepth, find_unknown_starts, fit_chosen, states_met
from sklearn_pgnn.grey_box.diagnosed_models import (
    diagnose,
    diagnosed_models,
    prepare_diagnosis,
)
from sklearn_pgnn.grey_box.folds import hidden_parts
from sklearn_pgnn.grey_box.options import (
    DIAGNOSED,
    NETWORKS,
    check_options,
    diagnosis_or_default,
    network_as_trained,
    network_or_default,
    warn_if_useless,
    warn_of_no_finding,
    warn_of_spreads,
)
from sklearn_pgnn.grey_box.tables import PlainTable, plain_table, starts_for, usual_starts
from sklearn_pgnn.grey_box.time_limit import TimeLimit, said_of
from sklearn_pgnn.model_selection.search_space import searched_parts
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.intervals import check_coverage, interval_around, quantile_of
from sklearn_pgnn.trajectories.contradicted_states import (
    told_in_all,
    warn_of_missing_starts,
    warn_of_unknown_starts,
)
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.reader import read_records, rows_in_order
from sklearn_pgnn.trajectories.validation import (
    GapScoreMixin,
    refuse_fit_params,
    require_target,
    tags_of_records,
    validate_table,
)


class GreyBoxRegressor(MultiOutputMixin, SimulatingMixin, GapScoreMixin, BaseEstimator):
    r"""Grey-box model: as much physics as the records support, and a network only if it helps.

    .. math:: \hat e_d = \exp \frac{1}{n} \sum_{f, r} \log e_{d, f, r}, \qquad
              d^* = \min \{d : \hat e_d \le (1 + g) \min_{d'} \hat e_{d'}\}

    with the free-run error :math:`e_{d,f,r}` of depth :math:`d`, fitted without the hidden
    samples of fold :math:`f`, on those of trajectory :math:`r`, and the `least_gain` :math:`g`.
    The depths, in order, are

    ``"prior"``
        the model as it is;
    ``"fitted"``
        its parameters fitted to whole trajectories in free run;
    ``"extended"``
        the model extended by the causes that `ModelDiagnosis` names, and fitted likewise;
    ``"formula"``
        in addition, the formula that the diagnosis proposes for what is not in its catalogue;
    ``"state_network"``
        the best of these, and a network trained on its error, which sees the states only: the
        inputs act where the model says;
    ``"network"``
        the same with a network that also sees the inputs.

    The diagnosis is made once, on all training records, and re-tunes parameters within their
    spread; the parameters of a fold are fitted without its hidden samples, between their bounds. If
    several parameters end at the limits of their spreads, a warning says so. Folds hide whole
    trajectories; with fewer trajectories than folds, they hide blocks of time of each, never the
    first, and, in as many additional folds, ranges of operation: groups of samples with similar
    outputs, changes of the outputs and inputs, found by k-means, all but the most central one [1]_.
    Errors on blocks stand for a continuation of this experiment, errors on ranges for another one.
    ``predict`` is the free run from each trajectory's first row.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    depths : sequence of str, optional
        Depths to choose from; by default all, without the networks where their extra is not
        installed.
    diagnosis : ModelDiagnosis, optional
        Settings of the diagnosis: its parameters are used, its model is not; by default
        ``ModelDiagnosis(model)``, without the causes that are functions of the time, unless folds
        hide whole trajectories: such a cause describes how one record went, and only another one
        can show whether it is a law.
    network : estimator, optional
        Learns the rest: any regressor that has a parameter ``model``, itself or in an estimator
        inside it, such as `PGNNLRegressor`, `ResidualRegressor` or an `EnsembleRegressor` of one;
        by default ``PGNNLRegressor(model)``. A regressor without a parameter ``sees``, or with one
        that is set, has no depth ``"state_network"``.
    n_splits : int, default=3
        Number of folds.
    by : {"auto", "trajectory", "time", "range"}, default="auto"
        Whether folds hide whole trajectories, blocks of time, or ranges of operation.
    initial_window : int, default=0
        Number of first samples of a hidden trajectory from which an initial state that X does not
        give is estimated; they do not count, so that the trajectory has to be longer. With 0 it
        starts as the model says.
    least_gain : float, default=0.01
        Share by which a deeper model must lower the error.
    time_column : int or str, optional
        Column of X that holds the time; by default ``"t"``, of an array the first.
    n_jobs : int, optional
        Number of folds that are fitted in parallel, and ``n_jobs`` of the diagnosis, unless it has
        its own, and of the final fit; -1 means all processors.
    memory : str or joblib.Memory, optional
        Where the diagnosis and the cross-validation of the physical depths are kept, so that a
        search over the network's parameters does not repeat them on the same records; a str is a
        folder. The stored files are pickles, which are code: let nobody else write there. The
        diagnosis warns only when it is actually made.
    time_limit : float, optional
        Time [s] after which nothing further is begun: half of it at most goes to the diagnosis,
        and once a depth is judged, those whose folds are not all fitted by then are left out. The
        depth chosen among the others is fitted in any case; a warning and `stopped_` tell.
    verbose : int, default=0
        Whether to show the stage and the best so far: in a terminal by a bar, elsewhere by lines;
        the error of every depth is a line of its own.

    Attributes
    ----------
    depth_ : str
        The depth that was chosen.
    errors_ : dict of str to float
        Cross-validated error of every depth that was tried, in standard deviations of the outputs;
        infinite for a network whose training became non-finite, which a warning reports.
    estimator_ : estimator
        The estimator that predicts: a `PhysicsModelRegressor`, or the network.
    model_ : PhysicsModel
        The fitted physical model in `estimator_`; fitted with the network where that tunes it
        (``network=PGNNLRegressor(free=...)``). It starts where the trajectories did on average, if
        that describes their free runs better, in states that X never gives.
    parameters_ : dict of str to Estimate
        Fitted parameters of `model_` with their 95 % intervals; for those that the network tunes,
        the network's.
    diagnosis_ : ModelDiagnosis
        The diagnosis, where `depths` asks for one.
    stopped_ : str or None
        What the time limit cut short.
    initial_states_ : ndarray of shape (n_trajectories, n_states)
        State of `model_` at the start of every trajectory.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    ModelDiagnosis : Finds what the model lacks, and how certain that is.
    make_pgnn_pipeline : A network alone.

    References
    ----------
    .. [1] B. Meredig, E. Antono, C. Church, et al., "Can machine learning identify the next
       high-temperature superconductor? Examining extrapolation performance for materials
       discovery", Molecular Systems Design & Engineering 3, 2018, :doi:`10.1039/C8ME00012C`:
       leave-one-cluster-out cross-validation.

    Examples
    --------
    >>> from sklearn_pgnn import effects
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"},
    ...                     inertia={"v": "m"})
    >>> t = np.arange(0, 60, 0.02)
    >>> F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    >>> rig = cart + effects.CoulombFriction("v", level=0.4)
    >>> v = rig.simulate(t, F, substeps=5).y + 1e-3 * np.random.default_rng(0).normal(
    ...     size=(t.size, 1))
    >>> grey_box = GreyBoxRegressor(cart, depths=("prior", "fitted", "extended"))
    >>> grey_box.fit(np.column_stack([t, F]), v).depth_
    'extended'
    >>> round(grey_box.model_.parameters["Fc_v"].value, 2)
    0.4
    """

    #: reports stages while the fit runs
    _show: Callable[..., None] | None = None

    def __init__(
        self,
        model: PhysicsModel,
        *,
        depths: Sequence[str] | None = None,
        diagnosis: ModelDiagnosis | None = None,
        network: Any = None,
        n_splits: int = 3,
        by: str = "auto",
        initial_window: int = 0,
        least_gain: float = 0.01,
        time_column: Column | None = None,
        n_jobs: int | None = None,
        memory: Any = None,
        time_limit: float | None = None,
        verbose: int = 0,
    ):
        self.model = model
        self.depths = depths
        self.diagnosis = diagnosis
        self.network = network
        self.n_splits = n_splits
        self.by = by
        self.initial_window = initial_window
        self.least_gain = least_gain
        self.time_column = time_column
        self.n_jobs = n_jobs
        self.memory = memory
        self.time_limit = time_limit
        self.verbose = verbose

    def set_params(self, **params: Any) -> Self:
        """Set parameters; if the diagnosis or network is None, those of the default one.

        Parameters
        ----------
        **params
            Parameters, such as ``network__lr`` or ``diagnosis__max_causes``.

        Returns
        -------
        self : GreyBoxRegressor
            The regressor.

        Raises
        ------
        ValueError
            If there is no such parameter.
        ImportError
            If a parameter of the default network is set, and its extra is not installed.

        Examples
        --------
        >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
        >>> GreyBoxRegressor(lag).set_params(diagnosis__max_causes=1).diagnosis.max_causes
        1
        """
        for name in ("diagnosis", "network"):
            nested = any(each.startswith(f"{name}__") for each in params)
            if nested and params.get(name, getattr(self, name)) is None:
                params[name] = self._part(name)
        return super().set_params(**params)

    def _part(self, name: str):
        """Return the diagnosis or the network, by default the usual one."""
        if name == "diagnosis":
            return diagnosis_or_default(self.diagnosis, self.model)
        return network_or_default(self.network)

    @with_progress
    def fit(self, X: Table, y: Table, **fit_params: Any) -> Self:
        """Diagnose, fit every depth in every fold, and the chosen one to all records.

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
        self : GreyBoxRegressor
            The fitted regressor.

        Raises
        ------
        ValueError
            If X and y cannot be read as records of the model, or a parameter is invalid.
        ImportError
            If the network is asked for and its extra is not installed.
        """
        refuse_fit_params(self, fit_params)
        depths, time = check_options(self), TimeLimit(self.time_limit)
        require_target(self, X, y)
        records, table = self._read(validate_table(self, X, reset=True), y)
        self._single_output = np.asarray(y).ndim == 1
        folds = hidden_parts(records, self.n_splits, self.by)
        check_window(table, folds, self.initial_window)
        self.__dict__.pop("diagnosis_", None)  # of an earlier fit
        whole = any(is_unseen(table, hidden).any() for hidden in folds)
        candidates = self._candidates(depths, table, time, judges_new_records=whole)
        judged = self._judge(table, folds, time).judge_all(candidates, depths, self.network)
        self.errors_, chosen = judged.errors, judged.choose(self.least_gain)
        tried = set(NETWORKS).intersection(depths).difference(judged.skipped)
        self.errors_ |= {each: np.inf for each in depths if each in tried - set(judged.results)}
        diagnosis = getattr(self, "diagnosis_", None)
        self.stopped_ = said_of(self.time_limit, diagnosis, judged.skipped)
        (self._show or silence)("final fit")
        warn_if_useless(chosen, self.errors_[chosen])
        self.depth_, self._fitted = fit_chosen(
            chosen, judged.base, candidates, self.network, table, self.n_jobs
        )
        if self.depth_ != chosen:
            self.errors_[chosen] = np.inf
        self._left = judged.left(self.depth_)
        self._tell(self._fitted, table)
        self._told = told_in_all(records)
        if not self.initial_window:
            warn_of_unknown_starts(self._starting_prior(), records)
        return self

    def _starting_prior(self) -> PhysicsModel:
        """Return the prior, whose states the records have, starting where predictions do."""
        said = {state: self.model_.initial_state[state] for state in self.model.states}
        return self.model.replace(initial_state=said)

    def _warn_of_missing_starts(self, records) -> None:
        """Tell what starts a table to be predicted without y lacks."""
        warn_of_missing_starts(self._starting_prior(), self._told, records)

    def predict(self, X: Table) -> Any:
        """Simulate every trajectory in free run from its initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`; of the states only the first row of a trajectory is read, and states that
            it does not give start as `model_` says; a `RecordWarning` tells of those that every
            trajectory of `fit` had.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.
        """
        records, table = self._read_new(X)
        self._warn_of_missing_starts(records)
        starts = usual_starts(self.model_, table)
        return self._shaped(rows_in_order(records, self._fitted.predict(table, starts)))

    def predict_from(self, X: Table, y: Table) -> np.ndarray:
        """Simulate every trajectory from an initial state fitted to its first measured samples.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs; the first `initial_window` samples of every trajectory are read,
            others may be NaN.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.

        Raises
        ------
        OptionError
            If `initial_window` is 0.
        """
        check_is_fitted(self)
        if not self.initial_window:
            raise OptionError(
                "initial_window: predict_from needs the number of samples from which to estimate "
                "the initial states, got 0. Remedy: set initial_window and fit again, or use "
                "predict."
            )
        records, table = self._read_new(X, y)
        known = starts_for(self.model_, table)
        starts = find_unknown_starts(
            self._fitted, table, known, self._met, self.initial_window, self._noise
        )
        return self._shaped(rows_in_order(records, self._fitted.predict(table, starts)))

    def predict_interval(
        self, X: Table, coverage: float = 0.9, y: Table = None
    ) -> tuple[np.ndarray, np.ndarray]:
        r"""Return the interval in which the measured outputs of a free run are expected.

        .. math:: \hat y_k \pm q

        with the quantile :math:`q`, for every output, of the errors on the held-out samples of
        the cross-validation. It holds for machines operated as in the training records, from
        initial states that are known equally well: if `initial_window` is set and X does not give
        them, as estimated from the first samples of y.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        coverage : float, default=0.9
            Share of the measurements that should lie in the interval.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,), optional
            Measured outputs, from which `predict_from` estimates the initial state; the interval is
            around its prediction. Without y it is around that of `predict`.

        Returns
        -------
        low, high : ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Bounds of the interval.

        Raises
        ------
        OptionError
            If `coverage` is not a share between 0 and 1, or y is given and `initial_window` is 0.
        """
        check_coverage(coverage)
        predicted = self.predict(X) if y is None else self.predict_from(X, y)
        return interval_around(predicted, quantile_of(self._left, coverage))

    # -- what `SimulatingMixin` asks for -----------------------------------------------------------

    def _states_of(self, X) -> np.ndarray:
        records, table = self._read_new(X)
        self._warn_of_missing_starts(records)
        started = table.starting(self.model_, usual_starts(self.model_, table))
        return rows_in_order(records, self.estimator_.predict_states(started))

    def _outputs_ahead(self, X, y, steps: int) -> np.ndarray:
        records, table = self._read_new(X, y, to_fit=False)
        started = table.starting(self.model_, usual_starts(self.model_, table))
        ahead = self.estimator_.predict_ahead(started, table.y, steps)
        return rows_in_order(records, np.asarray(ahead).reshape(table.y.shape))

    # -- reading -----------------------------------------------------------------------------------

    def _read(self, X, y=None, *, to_fit=True) -> tuple[tuple, PlainTable]:
        """Return the records of a checked table, and the same as one plain table."""
        records = read_records(self.model, X, y, time_column=self.time_column, to_fit=to_fit)
        refuse_standardised(self.model, records)
        return records, plain_table(self.model, records)

    def _read_new(self, X, y=None, *, to_fit=True) -> tuple[tuple, PlainTable]:
        """Return records to be predicted, and the same as one plain table."""
        check_is_fitted(self)
        return self._read(validate_table(self, X, reset=False), y, to_fit=to_fit)

    # -- fitting -----------------------------------------------------------------------------------

    def _candidates(self, depths, table, time, *, judges_new_records) -> dict[str, PhysicsModel]:
        """Return the model of every physical depth, to start its fits from."""
        models = dict.fromkeys(("prior", "fitted"), self.model)
        if set(DIAGNOSED) & set(depths):
            whole = {"judges_new_records": judges_new_records}
            self.diagnosis_ = prepare_diagnosis(self.diagnosis, self.model, time, **whole)
            own, kept = getattr(self.diagnosis, "n_jobs", None), check_memory(self.memory)
            n_jobs = self.n_jobs if own is None else own
            self.diagnosis_ = diagnose(self.diagnosis_, table, kept, n_jobs, self._show)
            warn_of_spreads(self.model, self.diagnosis_.extended_model_)
            models |= diagnosed_models(self.diagnosis_, self.model, **whole)
        found = {depth: model for depth, model in models.items() if depth in depths}
        if not found:
            warn_of_no_finding(depths)
        return found or {"fitted": models["fitted"]}

    def _judge(self, table, folds, time) -> DepthJudge:
        """Return what cross-validates the depths."""
        kept, shown = check_memory(self.memory), (progress_printer(self), self._show or silence)
        return DepthJudge(table, folds, self.initial_window, self.n_jobs, kept, *shown, time)

    def _tell(self, fitted: FittedDepth, table) -> None:
        """Keep what the chosen depth, fitted to all records, tells."""
        everything = np.ones(len(table.X), dtype=bool)
        self._met = states_met(fitted, table)
        self._noise = training_error(fitted, table, everything)
        self.estimator_, self.model_ = fitted.estimator, fitted.model
        self.initial_states_, self.parameters_ = fitted.starts, fitted.parameters
        progress_printer(self)(f"chosen: {self.depth_}")

    def __sklearn_tags__(self):
        return tags_of_records(super().__sklearn_tags__())


@searched_parts.register
def _network_searched(regressor: GreyBoxRegressor) -> dict:
    """Return the network as `search_space` searches it."""
    trained = network_as_trained(regressor.network, regressor.model, regressor.depths)
    return {"network": trained}
