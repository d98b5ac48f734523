"""Grey-box recipe as an estimator: diagnose, fit, learn the rest; the depth is cross-validated."""

import warnings
from functools import partial
from numbers import Integral, Real

import numpy as np
from joblib import Parallel, delayed
from sklearn.base import BaseEstimator, MultiOutputMixin, clone
from sklearn.utils.validation import check_is_fitted, check_memory

from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.estimators.progress import progress_printer
from sklearn_pgnn.exceptions import OptionError, TrainingError
from sklearn_pgnn.extras import is_installed, needed_by
from sklearn_pgnn.grey_box.cross_validation import (
    FoldResult,
    check_window,
    is_unseen,
    judge,
    mean_error,
    training_error,
)
from sklearn_pgnn.grey_box.depth import (
    FittedDepth,
    find_unknown_starts,
    fit_network,
    fit_physics,
    states_met,
)
from sklearn_pgnn.grey_box.hidden_parts import WAYS, hidden_parts
from sklearn_pgnn.grey_box.spread_warning import warn_of_spreads
from sklearn_pgnn.grey_box.tables import plain_table, starts_for, usual_starts
from sklearn_pgnn.grey_box.time_functions import depends_on_time, time_invariant_causes
from sklearn_pgnn.model_selection.nested_parameters import parameters_named
from sklearn_pgnn.model_selection.search_space import searched_parts
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.intervals import check_coverage, interval_around, quantile_of
from sklearn_pgnn.trajectories import read_records, rows_in_order
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.scoring import GapScoreMixin
from sklearn_pgnn.trajectories.tags import tags_of_records
from sklearn_pgnn.trajectories.validation import check_model, require_target, validate_table

#: from the shallowest to the deepest
DEPTHS = ("prior", "fitted", "extended", "formula", "state_network", "network")
NETWORKS = DEPTHS[-2:]


class GreyBoxRegressor(MultiOutputMixin, GapScoreMixin, BaseEstimator):
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
    verbose : int, default=0
        Whether to print a line for every stage.

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
        (``network=PGNNLRegressor(free=...)``). Its initial state is that of the first trajectory.
    parameters_ : dict of str to Estimate
        Fitted parameters of `model_` with their 95 % intervals; for those that the network tunes,
        the network's.
    diagnosis_ : ModelDiagnosis
        The diagnosis, where `depths` asks for one.
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

    def __init__(
        self,
        model,
        *,
        depths=None,
        diagnosis=None,
        network=None,
        n_splits=3,
        by="auto",
        initial_window=0,
        least_gain=0.01,
        time_column=None,
        n_jobs=None,
        memory=None,
        verbose=0,
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
        self.verbose = verbose

    def set_params(self, **params):
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
        for name, default in (("diagnosis", self._diagnosis), ("network", self._network)):
            nested = any(each.startswith(f"{name}__") for each in params)
            if nested and params.get(name, getattr(self, name)) is None:
                params[name] = default()
        return super().set_params(**params)

    def fit(self, X, y):
        """Diagnose, fit every depth in every fold, and the chosen one to all records.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and, where known, the states in each trajectory's first row.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs; NaN where there is none.

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
        depths = self._check_parameters()
        require_target(self, y)
        records = self._records(validate_table(self, X, reset=True), y)
        table = plain_table(self.model, records)
        self._single_output = np.asarray(y).ndim == 1
        folds = hidden_parts(records, self.n_splits, self.by)
        check_window(table, folds, self.initial_window)
        vars(self).pop("diagnosis_", None)  # of an earlier fit
        whole = any(is_unseen(table, hidden).any() for hidden in folds)
        candidates = self._candidates(depths, table, judges_new_records=whole)
        results = self._judge_all(candidates, depths, table, folds)
        self.errors_ = {depth: mean_error(found) for depth, found in results.items()}
        enough = (1 + self.least_gain) * min(self.errors_.values())
        self.depth_ = next(d for d, error in self.errors_.items() if error <= enough)
        self.errors_ |= {
            each: np.inf for each in depths if each in NETWORKS and each not in results
        }
        self._warn_if_useless()
        self._fit_chosen(candidates, table)
        self._left = np.sort(np.concatenate([r.left for r in results[self.depth_]]), axis=0)
        return self

    def predict(self, X):
        """Simulate every trajectory in free run from its initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`; of the states only the first row of a trajectory is read, and states that
            it does not give start as `model_` says.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.
        """
        check_is_fitted(self)
        records = self._records(validate_table(self, X, reset=False))
        table = plain_table(self.model, records)
        outputs = rows_in_order(
            records, self._fitted.predict(table, usual_starts(self.model_, table))
        )
        return outputs.ravel() if self._single_output else outputs

    def predict_states(self, X):
        """Simulate the states of every trajectory in free run from its initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.

        Returns
        -------
        ndarray of shape (n_samples, n_states)
            States of `model_`.

        Raises
        ------
        AttributeError
            If a user-defined `network` without ``predict_states`` was chosen.
        """
        check_is_fitted(self)
        records = self._records(validate_table(self, X, reset=False))
        table = plain_table(self.model, records)
        started = table.starting(self.model_, usual_starts(self.model_, table))
        return rows_in_order(records, self.estimator_.predict_states(started))

    def predict_ahead(self, X, y, steps=1):
        """Predict every sample from the outputs up to `steps` samples before it.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs, NaN where there is none; the state is estimated from them by a
            Kalman filter.
        steps : int, default=1
            Prediction horizon in samples. The first `steps` rows of a trajectory are those of the
            free run.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.

        Raises
        ------
        OptionError
            If `steps` is not an integer of at least 1.
        AttributeError
            If a user-defined `network` without ``predict_ahead`` was chosen.
        """
        check_is_fitted(self)
        records = self._records(validate_table(self, X, reset=False), y, to_fit=False)
        table = plain_table(self.model, records)
        started = table.starting(self.model_, usual_starts(self.model_, table))
        ahead = self.estimator_.predict_ahead(started, table.y, steps)
        outputs = rows_in_order(records, np.asarray(ahead).reshape(table.y.shape))
        return outputs.ravel() if self._single_output else outputs

    def predict_from(self, X, y):
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
        records = self._records(validate_table(self, X, reset=False), y)
        table = plain_table(self.model, records)
        known = starts_for(self.model_, table)
        starts = find_unknown_starts(
            self._fitted, table, known, self._met, self.initial_window, self._noise
        )
        outputs = rows_in_order(records, self._fitted.predict(table, starts))
        return outputs.ravel() if self._single_output else outputs

    def predict_interval(self, X, coverage=0.9, y=None):
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

    # -- fitting -----------------------------------------------------------------------------------

    def _check_parameters(self) -> tuple[str, ...]:
        """Check the parameters, and return the depths in their order."""
        check_model(self.model)
        check_memory(self.memory)
        if self.by not in WAYS:
            raise OptionError(f"by: expected one of {', '.join(WAYS)}, got {self.by!r}.")
        for name, least in (("n_splits", 2), ("initial_window", 0)):
            value = getattr(self, name)
            if not isinstance(value, Integral) or value < least:
                raise OptionError(f"{name}: expected an integer >= {least}, got {value!r}.")
        if not isinstance(self.least_gain, Real) or not float(self.least_gain) >= 0:
            raise OptionError(f"least_gain: expected a share >= 0, got {self.least_gain!r}.")
        depths = self._possible_depths() if self.depths is None else self.depths
        wrong = [depth for depth in depths if depth not in DEPTHS]
        if wrong or isinstance(depths, str) or not set(depths) - set(NETWORKS):
            raise OptionError(
                f"depths: expected some of {', '.join(DEPTHS)}, one at least besides the "
                f"networks, got {self.depths!r}."
            )
        if self.network is not None and not parameters_named(self.network, "model"):
            raise OptionError(
                f"network: expected a regressor with a parameter 'model', itself or in what it "
                f"contains, got {self.network!r}. Remedy: ResidualRegressor(model, regressor)."
            )
        if "state_network" in depths and not self._can_see_less():
            raise OptionError(
                f"depths: 'state_network' expects a network whose parameter 'sees' is None, got "
                f"{self.network!r}. Remedy: network=PGNNLRegressor(), or depths without it."
            )
        return tuple(depth for depth in DEPTHS if depth in depths)

    def _possible_depths(self) -> tuple[str, ...]:
        if self.network is None and not is_installed("network"):
            return DEPTHS[: -len(NETWORKS)]
        return tuple(d for d in DEPTHS if d != "state_network" or self._can_see_less())

    def _can_see_less(self) -> bool:
        """Return whether the network can be restricted to seeing the states only."""
        if self.network is None:
            return True
        seen = parameters_named(self.network, "sees").values()
        return bool(seen) and all(each is None for each in seen)

    def _records(self, X, y=None, to_fit=True):
        records = read_records(self.model, X, y, time_column=self.time_column, to_fit=to_fit)
        refuse_standardised(self.model, records)
        return records

    def _candidates(self, depths, table, *, judges_new_records) -> dict[str, PhysicsModel]:
        """Return the model of every physical depth, to start its fits from."""
        models = dict.fromkeys(("prior", "fitted"), self.model)
        if {"extended", "formula"} & set(depths):
            models |= self._diagnosed_models(table, judges_new_records)
        found = {depth: model for depth, model in models.items() if depth in depths}
        if not found:
            asked = ", ".join(depth for depth in depths if depth not in NETWORKS)
            warnings.warn(
                f"depths: the diagnosis has nothing for {asked}; the depth 'fitted' is taken "
                f"instead. Remedy: depths={('fitted', *depths)!r}.",
                UserWarning,
                stacklevel=3,
            )
        return found or {"fitted": models["fitted"]}

    def _diagnosed_models(self, table, judges_new_records) -> dict[str, PhysicsModel]:
        """Diagnose the prior, and return the models of the depths that follow from it.

        They take no function of the time from one record, unless folds judge it on others.
        """
        progress_printer(self)("diagnosis")
        own = {"model": self.model, "time_column": None, "n_jobs": None}
        if self.diagnosis is None and not judges_new_records:
            own["catalogue"] = time_invariant_causes(self.model)
        self.diagnosis_ = clone(self._diagnosis()).set_params(**own)
        self._diagnose(table)
        said = {"hold": self.diagnosis_.hold_, "substeps": self.diagnosis_.substeps_}
        extended, part = self.diagnosis_.extended_model_, self.diagnosis_.discrepancy_
        warn_of_spreads(self.model, extended)
        models = {
            "prior": self.model.replace(simulation=said),
            "fitted": self.diagnosis_.refitted_model_,
        }
        if self.diagnosis_.causes_:
            models["extended"] = extended
        may_be_timed = judges_new_records or depends_on_time(extended)
        if part is not None and (may_be_timed or not depends_on_time(part.model)):
            models["formula"] = part.model
        return models

    def _diagnose(self, table) -> None:
        """Diagnose the prior; if the diagnosis fails, take its best result until then."""
        try:
            X = table.starting(self.model, table.told)
            kept = self._kept(_diagnosed, ignore=["n_jobs"])
            self.diagnosis_ = kept(self.diagnosis_, X, table.y, n_jobs=self._diagnosis_threads())
        except Exception as error:
            if not hasattr(self.diagnosis_, "verdict_"):
                raise
            warnings.warn(
                f"the diagnosis stopped with an error ({self.diagnosis_.stopped_}; "
                f"{type(error).__name__}: {error}); its best result so far is used. Remedy: a "
                f"smaller catalogue in diagnosis=ModelDiagnosis(...).",
                UserWarning,
                stacklevel=4,
            )

    def _warn_if_useless(self) -> None:
        """Warn if the chosen depth is no nearer to hidden parts than the outputs' mean."""
        error = self.errors_[self.depth_]
        if not error < 1.0:
            warnings.warn(
                f"no depth predicts the hidden parts of the records better than the mean of the "
                f"outputs: the error of the chosen one, {self.depth_!r}, is {error:.3g} standard "
                f"deviations. Remedy: check the model's equations, units and parameters "
                f"(`sklearn-pgnn check`), and that its free run does not diverge.",
                UserWarning,
                stacklevel=3,
            )

    def _judge_all(self, candidates, depths, table, folds) -> dict[str, list[FoldResult]]:
        """Fit every depth in every fold; the networks on the best physical depth."""
        results: dict[str, list[FoldResult]] = {}
        for depth, model in candidates.items():
            fit = partial(_fit_model, depth, model)
            results[depth] = self._judge(depth, [fit] * len(folds), table, folds)
        self._base = min(results, key=lambda depth: mean_error(results[depth]))
        physical = [each.fitted for each in results[self._base]]
        for depth in (each for each in depths if each in NETWORKS):
            fits = [partial(_fit_on, self._network(), depth, each) for each in physical]
            try:
                results[depth] = self._judge(depth, fits, table, folds)
            except TrainingError as error:
                _warn_of_training(error, depth, self._base)
        return results

    def _judge(self, depth, fits, table, folds) -> list[FoldResult]:
        score = judge if depth in NETWORKS else self._kept(judge)
        found = Parallel(n_jobs=self.n_jobs)(
            delayed(score)(fit, table, hidden, self.initial_window)
            for fit, hidden in zip(fits, folds, strict=True)
        )
        progress_printer(self)(f"{depth}: cross-validated error {mean_error(found):.4g}")
        return found

    def _kept(self, function, **options):
        """Return a function whose results are kept in `memory`."""
        return check_memory(self.memory).cache(function, **options)

    def _diagnosis_threads(self) -> int | None:
        """Return `n_jobs`, or that of a user-defined diagnosis if it has its own."""
        own = None if self.diagnosis is None else self.diagnosis.n_jobs
        return self.n_jobs if own is None else own

    def _diagnosis(self):
        return ModelDiagnosis(self.model) if self.diagnosis is None else self.diagnosis

    def _network(self):
        if self.network is not None:
            return self.network
        with needed_by("the depths 'state_network' and 'network'"):
            from sklearn_pgnn.estimators.pgnnl import PGNNLRegressor
        return PGNNLRegressor()

    def _network_as_trained(self):
        """Return the network with the prior as its model; None if no depth trains one."""
        tried = NETWORKS if self.depths is None else self.depths
        if not set(NETWORKS) & set(tried):
            return None
        network = clone(self._network())
        models = parameters_named(network, "model")
        return network.set_params(**dict.fromkeys(models, self.model))

    def _fit_chosen(self, candidates, table) -> None:
        """Fit the chosen depth to all records."""
        everything = np.ones(len(table.X), dtype=bool)
        chosen = self.depth_
        base = self._base if chosen in NETWORKS else chosen
        fitted = _fit_model(base, candidates[base], table, everything, self.n_jobs)
        if chosen in NETWORKS:
            try:
                fitted = _fit_on(self._network(), chosen, fitted, table, everything)
            except TrainingError as error:
                _warn_of_training(error, chosen, base)
                self.depth_, self.errors_[chosen] = base, np.inf
        self._fitted, self._met = fitted, states_met(fitted, table)
        self._noise = training_error(fitted, table, everything)
        self.estimator_ = fitted.estimator
        self.initial_states_ = fitted.starts
        self.parameters_ = fitted.parameters
        self.model_ = fitted.model
        progress_printer(self)(f"chosen: {self.depth_}")

    def __sklearn_tags__(self):
        return tags_of_records(super().__sklearn_tags__())


@searched_parts.register
def _network_searched(regressor: GreyBoxRegressor) -> dict:
    """Return the network as `search_space` searches it."""
    return {"network": regressor._network_as_trained()}


def _diagnosed(diagnosis, X, y, n_jobs) -> ModelDiagnosis:
    """Fit a diagnosis, in place; if it fails, it holds its best result until then."""
    return diagnosis.set_params(n_jobs=n_jobs).fit(X, y)


def _fit_model(depth, model, table, visible, n_jobs=None) -> FittedDepth:
    """Fit a physical depth; for the prior only the initial states of the trajectories."""
    return fit_physics(model, table, visible, n_jobs, free=() if depth == "prior" else None)


def _warn_of_training(error, depth, base) -> None:
    """Warn that a network is left out."""
    warnings.warn(
        f"depth {depth!r}: {error} This depth is skipped; the best depth without a network is "
        f"{base!r}. Remedy: network=PGNNLRegressor(lr=0.003, horizon=20), or depths without "
        f"{depth!r}.",
        UserWarning,
        stacklevel=4,
    )


def _fit_on(network, depth, physics, table, visible) -> FittedDepth:
    """Train a network on a physical depth that was fitted to the same samples."""
    return fit_network(network, physics, table, visible, sees_inputs=depth == "network")
