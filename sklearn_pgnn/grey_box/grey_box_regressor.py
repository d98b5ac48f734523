"""The recipe as an estimator: diagnose, fit, learn the rest; cross-validation chooses the depth."""

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
from sklearn_pgnn.model_selection.nested_parameters import parameters_named
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.intervals import check_coverage, interval_around, quantile_of
from sklearn_pgnn.trajectories import read_records, rows_in_order
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.scoring import GapScoreMixin
from sklearn_pgnn.trajectories.tags import tags_of_records
from sklearn_pgnn.trajectories.validation import check_model, validate_table

#: from the shallowest to the deepest
DEPTHS = ("prior", "fitted", "extended", "formula", "state_network", "network")
NETWORKS = DEPTHS[-2:]


class GreyBoxRegressor(MultiOutputMixin, GapScoreMixin, BaseEstimator):
    r"""Grey-box model of records: as much physics as they want, and a network only if it helps.

    .. math:: \hat e_d = \exp \frac{1}{n} \sum_{f, r} \log e_{d, f, r}, \qquad
              d^* = \min \{d : \hat e_d \le (1 + g) \min_{d'} \hat e_{d'}\}

    with the free-run error :math:`e_{d,f,r}` of depth :math:`d`, fitted without what fold
    :math:`f` hides, on the hidden samples of trajectory :math:`r`, and the `least_gain`
    :math:`g`. The depths, one after the other, are

    ``"prior"``
        the model as it is;
    ``"fitted"``
        its parameters fitted to whole trajectories in free run;
    ``"extended"``
        extended by the causes that `ModelDiagnosis` names, and fitted so;
    ``"formula"``
        the formula beside them that it proposes for what is not in its catalogue;
    ``"state_network"``
        the best of these, and a network trained on what that one leaves, which sees the states
        only: the inputs act where the model says;
    ``"network"``
        the same with a network that sees the inputs, too.

    The diagnosis is made once, on all training records, and re-tunes parameters within their
    spread; the numbers of a fold are fitted without what it hides, between their bounds. Where
    several parameters are left at the ends of their spreads, a warning says so. Folds hide whole
    trajectories; where there are fewer trajectories than folds, blocks of time of each, never the
    first, and in as many folds more ranges of operation: groups of samples with alike outputs,
    changes of the outputs and inputs, found by k-means, all but the most central one [1]_. Blocks
    say how this experiment would go on, ranges how another one might.
    ``predict`` is the free run from each trajectory's first row.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    depths : sequence of str, optional
        Depths to choose from; by default all, without the networks where their extra is not
        installed.
    diagnosis : ModelDiagnosis, optional
        How to diagnose: its parameters count, its model does not; by default
        ``ModelDiagnosis(model)``.
    network : estimator, optional
        What learns the rest: any regressor that has a parameter ``model``, itself or in what it
        contains, such as `PGNNLRegressor`, `ResidualRegressor` or an `EnsembleRegressor` of one; by
        default ``PGNNLRegressor(model)``. A regressor without a parameter ``sees``, or with one
        that is set, has no depth ``"state_network"``.
    n_splits : int, default=3
        Number of folds.
    by : {"auto", "trajectory", "time", "range"}, default="auto"
        Whether folds hide whole trajectories, blocks of time, or ranges of operation.
    initial_window : int, default=0
        First samples of a hidden trajectory from which an initial state is found that X does not
        tell; they do not count, so that it has to be longer. 0 starts it as the model says.
    least_gain : float, default=0.01
        Share by which a deeper model must lower the error.
    time_column : int or str, optional
        Column of X that holds the time; by default ``"t"``, of an array the first.
    n_jobs : int, optional
        Folds that are fitted at once, and ``n_jobs`` of the diagnosis, unless it has its own, and
        of the last fit; -1 means as many as there are processors.
    memory : str or joblib.Memory, optional
        Where the diagnosis and the cross-validation of the physical depths are kept, so that a
        search over the network's parameters does not repeat them on the same records; a str is a
        folder. What is kept are pickles, which are code: let nobody else write there. The
        diagnosis warns only when it is made.
    verbose : int, default=0
        Whether to print a line for every stage.

    Attributes
    ----------
    depth_ : str
        The depth that was chosen.
    errors_ : dict of str to float
        Cross-validated error of every depth that was tried, in standard deviations of the outputs;
        infinite for a network whose training became non-finite, of which a warning tells.
    estimator_ : estimator
        What predicts: a `PhysicsModelRegressor`, or the network.
    model_ : PhysicsModel
        The physical model in it, fitted; with the network where that tunes it
        (``network=PGNNLRegressor(free=...)``). It starts where the first trajectory did.
    parameters_ : dict of str to Estimate
        Its fitted parameters with their 95 % intervals; of those that the network tunes they are
        the network's.
    diagnosis_ : ModelDiagnosis
        The diagnosis, where `depths` asks for one.
    initial_states_ : ndarray of shape (n_trajectories, n_states)
        State of `model_` at the start of every trajectory.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Their names, if X has any.

    See Also
    --------
    ModelDiagnosis : What is missing, and how sure that is.
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
        """Set parameters; those of a diagnosis or network that is None are of the default one.

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
            If one of the default network is set, and its extra is not installed.

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
            If X and y cannot be read as records of the model, or a parameter is none of what it
            can be.
        ImportError
            If the network is asked for and its extra is not installed.
        """
        depths = self._check_parameters()
        if y is None:
            raise ValueError(
                f"{type(self).__name__} requires y to be passed, but the target y is None."
            )
        records = self._records(validate_table(self, X, reset=True), y)
        table = plain_table(self.model, records)
        self._single_output = np.asarray(y).ndim == 1
        folds = hidden_parts(records, self.n_splits, self.by)
        check_window(table, folds, self.initial_window)
        candidates = self._candidates(depths, table)
        results = self._judge_all(candidates, depths, table, folds)
        self.errors_ = {depth: mean_error(found) for depth, found in results.items()}
        enough = (1 + self.least_gain) * min(self.errors_.values())
        self.depth_ = next(d for d, error in self.errors_.items() if error <= enough)
        self.errors_ |= {
            each: np.inf for each in depths if each in NETWORKS and each not in results
        }
        self._fit_chosen(candidates, table)
        self._left = np.sort(np.concatenate([r.left for r in results[self.depth_]]), axis=0)
        return self

    def predict(self, X):
        """Simulate every trajectory in free run from its initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`; of the states only the first row of a trajectory is read, and those that
            it does not tell start as `model_` says.

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
            If a `network` of one's own was chosen that has no ``predict_states``.
        """
        check_is_fitted(self)
        records = self._records(validate_table(self, X, reset=False))
        table = plain_table(self.model, records)
        started = table.starting(self.model_, usual_starts(self.model_, table))
        return rows_in_order(records, self.estimator_.predict_states(started))

    def predict_ahead(self, X, y, steps=1):
        """Predict every sample from the outputs up to so many samples before it.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs, NaN where there is none; the state is estimated from them by a
            Kalman filter.
        steps : int, default=1
            Samples ahead. The first `steps` rows of a trajectory are the free run's.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.

        Raises
        ------
        OptionError
            If `steps` is no integer from 1 on.
        AttributeError
            If a `network` of one's own was chosen that has no ``predict_ahead``.
        """
        check_is_fitted(self)
        records = self._records(validate_table(self, X, reset=False), y, to_fit=False)
        table = plain_table(self.model, records)
        started = table.starting(self.model_, usual_starts(self.model_, table))
        ahead = self.estimator_.predict_ahead(started, table.y, steps)
        outputs = rows_in_order(records, np.asarray(ahead).reshape(table.y.shape))
        return outputs.ravel() if self._single_output else outputs

    def predict_from(self, X, y):
        """Simulate every trajectory from a start that fits its first measured samples.

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
                "initial_window: predict_from expects the number of samples from which it may "
                "find the initial states, got 0. Remedy: set it, and fit again; or use predict."
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
        r"""Return between what the measured outputs of a free run are expected.

        .. math:: \hat y_k \pm q

        with the quantile :math:`q`, for every output, of the errors on what cross-validation hid
        from the fits. It holds for machines that are run as in the training records, from initial
        states that are as well known: where `initial_window` is set and X does not tell them, as
        found from the first samples of y.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        coverage : float, default=0.9
            Share of the measurements that shall lie between.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,), optional
            Measured outputs, from which `predict_from` finds the start; the interval is around its
            prediction. Without them it is around that of `predict`.

        Returns
        -------
        low, high : ndarray of shape (n_samples, n_outputs) or (n_samples,)
            The interval's ends.

        Raises
        ------
        OptionError
            If `coverage` is no share between 0 and 1, or y is given and `initial_window` is 0.
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
        """Return whether the network can be told to see the states only."""
        if self.network is None:
            return True
        seen = parameters_named(self.network, "sees").values()
        return bool(seen) and all(each is None for each in seen)

    def _records(self, X, y=None, to_fit=True):
        records = read_records(self.model, X, y, time_column=self.time_column, to_fit=to_fit)
        refuse_standardised(self.model, records)
        return records

    def _candidates(self, depths, table) -> dict[str, PhysicsModel]:
        """Return the model of every physical depth, to start its fits from."""
        models = dict.fromkeys(("prior", "fitted"), self.model)
        if {"extended", "formula"} & set(depths):
            progress_printer(self)("diagnosis")
            own = {"model": self.model, "time_column": None, "n_jobs": None}
            self.diagnosis_ = clone(self._diagnosis()).set_params(**own)
            self._diagnose(table)
            said = {"hold": self.diagnosis_.hold_, "substeps": self.diagnosis_.substeps_}
            models["prior"] = self.model.replace(simulation=said)
            models["fitted"] = self.diagnosis_.refitted_model_
            warn_of_spreads(self.model, self.diagnosis_.extended_model_)
            if self.diagnosis_.causes_:
                models["extended"] = self.diagnosis_.extended_model_
            if self.diagnosis_.discrepancy_ is not None:
                models["formula"] = self.diagnosis_.discrepancy_.model
        return {depth: model for depth, model in models.items() if depth in depths}

    def _diagnose(self, table) -> None:
        """Diagnose the prior; where that breaks down, take what it had found until then."""
        try:
            X = table.starting(self.model, table.told)
            kept = self._kept(_diagnosed, ignore=["n_jobs"])
            self.diagnosis_ = kept(self.diagnosis_, X, table.y, n_jobs=self._diagnosis_threads())
        except Exception as error:
            if not hasattr(self.diagnosis_, "verdict_"):
                raise
            warnings.warn(
                f"the diagnosis broke off ({self.diagnosis_.stopped_}; {type(error).__name__}: "
                f"{error}); the best that it had found is taken. Remedy: a smaller catalogue in "
                f"diagnosis=ModelDiagnosis(...).",
                UserWarning,
                stacklevel=4,
            )

    def _judge_all(self, candidates, depths, table, folds) -> dict[str, list[FoldResult]]:
        """Fit every depth in every fold; the networks on the best of the others."""
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
        """Return `n_jobs`, or that of a diagnosis of one's own where it has one."""
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

    def _searched_parts(self) -> dict:
        """Return what `search_space` finds inside: the network as it is trained; None if never."""
        tried = NETWORKS if self.depths is None else self.depths
        if not set(NETWORKS) & set(tried):
            return {"network": None}
        network = clone(self._network())
        models = parameters_named(network, "model")
        return {"network": network.set_params(**dict.fromkeys(models, self.model))}

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


def _diagnosed(diagnosis, X, y, n_jobs) -> ModelDiagnosis:
    """Fit a diagnosis; where it breaks off, what was given has the best until then."""
    return diagnosis.set_params(n_jobs=n_jobs).fit(X, y)


def _fit_model(depth, model, table, visible, n_jobs=None) -> FittedDepth:
    """Fit a physical depth; of the prior only where the trajectories start."""
    return fit_physics(model, table, visible, n_jobs, free=() if depth == "prior" else None)


def _warn_of_training(error, depth, base) -> None:
    """Warn that a network is left out."""
    warnings.warn(
        f"depth {depth!r}: {error} It is left out, the best depth below the networks is {base!r}. "
        f"Remedy: network=PGNNLRegressor(lr=0.003, horizon=20), or depths without {depth!r}.",
        UserWarning,
        stacklevel=4,
    )


def _fit_on(network, depth, physics, table, visible) -> FittedDepth:
    """Train a network on a physical depth that was fitted to the same samples."""
    return fit_network(network, physics, table, visible, sees_inputs=depth == "network")
