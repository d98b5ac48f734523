"""Bayesian search that stops poor candidates after their first folds."""

import time
import warnings
from collections.abc import Mapping
from numbers import Integral
from typing import Any, Self

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.metrics import check_scoring
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import ArrayLike, RandomState, Table
from sklearn_pgnn.exceptions import OptionError, TrainingError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.model_selection.outer_estimator import OuterEstimatorMixin, inner_has
from sklearn_pgnn.model_selection.search_space import refuse_unknown_names
from sklearn_pgnn.model_selection.trajectory_k_fold import own_folds
from sklearn_pgnn.trajectories.tables import take_rows
from sklearn_pgnn.user_line import warn_user

#: draws among which a candidate is sought that was not tried yet
DRAWS = 1000


def _means(scores) -> np.ndarray:
    """Return every candidate's mean score over its folds, NaN for one without any."""
    known = np.isfinite(scores)
    with np.errstate(invalid="ignore"):
        return np.where(known, scores, 0.0).sum(axis=1) / known.sum(axis=1)


def _tell(optimizer, waiting: dict, means) -> None:
    """Report the waiting points to the Gaussian process, once any score is known.

    A point that could not be scored counts as the worst of the others.
    """
    if np.isnan(means).all():
        return
    for i, point in waiting.items():
        optimizer.tell(point, -float(np.nanmin(means) if np.isnan(means[i]) else means[i]))
    waiting.clear()


def _try_fold(estimator, scoring, X, y, train, test) -> float | Exception:
    """Return the score of a copy of an estimator on a fold, or the error of its fit.

    Whether a fold counts is not known yet where others are scored at the same time.
    """
    fitted = clone(estimator)
    try:
        fitted.fit(take_rows(X, train), take_rows(y, train))
        score = check_scoring(fitted, scoring)
        return score(fitted, take_rows(X, test), take_rows(y, test))
    except Exception as error:
        return error


class HalvingBayesSearchCV(OuterEstimatorMixin, MetaEstimatorMixin, BaseEstimator):
    """Search parameters by a Gaussian process; continue only the better half after each fold.

    Candidates are drawn one after the other, as by scikit-optimize's `BayesSearchCV`, and scored
    fold by fold. A candidate whose mean score over its first folds is below the median of all
    candidates that got that far is stopped: asynchronous successive halving [1]_, with folds as the
    resource, since the samples of a trajectory cannot be divided. The best of the candidates that
    completed all folds is fitted to all records.

    The first candidate is the estimator as it is, so that on the same folds a search is never worse
    than no search, however few its candidates are. The Gaussian process learns from this candidate
    if its parameters lie in the space; if one does not (``structure="auto"``, which is none of the
    three values searched), it is scored all the same, and the process starts with the next one.

    No candidate is scored twice: in the place of one that was tried, another one is drawn from the
    space at random, and where none is left the search ends, with a warning.

    A candidate whose training diverges, or whose score is not finite, causes a warning and counts
    as the worst of those that have a score.

    If the final fit scores lower on all records than the fit of every fold did on its held-out
    records, it has ended in a bad minimum, and a warning says so.

    Parameters
    ----------
    estimator : estimator
        Estimator to tune, alone or in a pipeline.
    search_spaces : dict of str to Dimension
        Dimensions to search, as from `search_space`.
    n_iter : int, default=20
        Number of candidates, including the estimator as it is; fewer, if the space has no more.
    cv : int or cross-validation splitter, default=3
        Folds, in the order in which they are scored; a number means `TrajectoryKFold` with the
        time column of the estimator.
    scoring : str or callable, optional
        As in scikit-learn; by default the estimator's own score.
    own_first : bool, default=True
        Whether the first candidate is the estimator as it is, even where its parameters lie outside
        the space; with False every candidate is drawn from the space.
    n_jobs : int, optional
        Number of folds that a candidate is scored on at the same time, by joblib; -1 means all
        processors. Candidates follow each other, for each is drawn from the scores of all before,
        so that more than the number of folds is of no use. The result is that of one after the
        other: folds behind the one at which a candidate is stopped do not count.
    random_state : int, RandomState instance or None, default=None
        Controls the random draw of the candidates.
    verbose : int, default=0
        Whether to print a line for every candidate: its parameters, score and time, and the best
        score so far.

    Attributes
    ----------
    best_estimator_ : estimator
        The best candidate, fitted to all records.
    best_params_ : dict
        Its searched parameters, as set; for the estimator as it is, the values that it has.
    best_score_ : float
        Its mean score over all folds.
    best_index_ : int
        Its index among the candidates.
    cv_results_ : dict of str to list
        By candidate: ``params``, ``split0_test_score`` and so on (NaN after it was stopped, or if
        it could not be scored), ``n_folds`` it was scored on, ``mean_test_score`` over these, and
        ``fit_time`` [s].
    n_splits_ : int
        Number of folds.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    search_space : Dimensions of the package's estimators.

    References
    ----------
    .. [1] L. Li, K. Jamieson, A. Rostamizadeh, E. Gonina, M. Hardt, B. Recht, A. Talwalkar, "A
       system for massively parallel hyperparameter tuning", MLSys, 2020, arXiv:1810.05934.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> X = np.column_stack([np.tile(np.arange(9.0), 4), np.random.default_rng(0).normal(size=36)])
    >>> search = HalvingBayesSearchCV(
    ...     Ridge(), {"alpha": (1e-3, 1e5, "log-uniform")}, n_iter=8, cv=4, random_state=0)
    >>> search = search.fit(X, X[:, 1])
    >>> search.best_params_["alpha"] < 1, sum(search.cv_results_["n_folds"]) < 8 * 4
    (True, True)
    """

    _fitted = "best_estimator_"

    def __init__(
        self,
        estimator: Any,
        search_spaces: Mapping[str, Any],
        *,
        n_iter: int = 20,
        cv: Any = 3,
        scoring: Any = None,
        own_first: bool = True,
        n_jobs: int | None = None,
        random_state: RandomState = None,
        verbose: int = 0,
    ):
        self.estimator = estimator
        self.search_spaces = search_spaces
        self.n_iter = n_iter
        self.cv = cv
        self.scoring = scoring
        self.own_first = own_first
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose

    def fit(self, X: Table, y: Table, groups: ArrayLike | None = None) -> Self:
        """Search, and fit the best candidate to all records.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As the estimator takes it.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs.
        groups : array-like of shape (n_samples,), optional
            Trajectory of every row for the folds, as `cv` takes it; overrides X.

        Returns
        -------
        self : HalvingBayesSearchCV
            The fitted search.

        Raises
        ------
        ValueError
            If a parameter is invalid, the estimator rejects a candidate, or no candidate has a
            finite score.
        ImportError
            If scikit-optimize is not installed.
        """
        if not isinstance(self.n_iter, Integral) or self.n_iter < 1:
            raise OptionError(f"n_iter: expected an integer >= 1, got {self.n_iter!r}.")
        if not self.search_spaces:
            raise OptionError(
                "search_spaces: expected at least one dimension, got none. Remedy: "
                "search_space(estimator) has those of the package's estimators."
            )
        refuse_unknown_names(self.estimator, self.search_spaces)
        self._check_scoring()
        folds = list(own_folds(self.cv, self.estimator, X).split(X, y, groups))
        self.n_splits_: int = len(folds)
        scores = np.full((self.n_iter, len(folds)), np.nan)
        candidates, seconds, waiting = [], [], {}
        optimizer = self._optimizer()
        for i in range(self.n_iter):
            point, params = self._candidate(optimizer, candidates)
            if params in candidates:
                warn_user(
                    f"search_spaces: expected at least n_iter={self.n_iter} different candidates, "
                    f"got {i}, all of which have been scored: the search ends. Remedy: "
                    f"n_iter={i}, or a larger space."
                )
                break
            candidates.append(params)
            start = time.perf_counter()
            self._race(params, X, y, folds, scores, i)
            seconds.append(time.perf_counter() - start)
            if point is not None:
                waiting[i] = point
            _tell(optimizer, waiting, _means(scores))
            self._show(i, params, scores, seconds[i])
        self._keep(candidates, scores[: len(candidates)], seconds)
        self.best_estimator_: Any = clone(self.estimator).set_params(**self.best_params_).fit(X, y)
        self._check_fit(X, y, scores[self.best_index_].min())
        return self

    def _check_scoring(self) -> None:
        """Refuse a scoring that gives no single number, before any fit."""
        try:
            found = check_scoring(self.estimator, self.scoring)
        except ValueError:
            found = None
        if not callable(found) or isinstance(self.scoring, list | tuple | set | dict):
            raise OptionError(
                f"scoring: expected None, a callable or one name of scikit-learn such as 'r2', got "
                f"{self.scoring!r}. Remedy: sklearn.metrics.get_scorer_names() lists them."
            )

    def _check_fit(self, X, y, least: float) -> None:
        """Warn if the final fit scores lower on all records than all folds on held-out ones."""
        score = self.score(X, y)
        if not score >= least:
            warn_user(
                f"the best candidate, fitted to all records, scores {score:.4g} on them; in the "
                f"folds it scored at least {least:.4g} on held-out records: this fit has ended in "
                f"a bad local minimum. Remedy: another random_state of the estimator, or "
                f"EnsembleRegressor(estimator), in which a single such fit has no effect."
            )

    def _optimizer(self):
        """Return the optimizer that proposes points of the space."""
        with needed_by("HalvingBayesSearchCV"):
            from skopt import Optimizer
            from skopt.utils import dimensions_aslist
        seed = check_random_state(self.random_state).randint(2**31 - 1)
        first = min(10, max(1, self.n_iter // 2))
        dimensions = dimensions_aslist(dict(self.search_spaces))
        return Optimizer(dimensions, n_initial_points=first, random_state=seed)

    def _candidate(self, optimizer, candidates):
        """Return a candidate's point, None if outside the space, and its parameters.

        A fold scores the same candidate alike a second time. In the place of one that was tried,
        another one is drawn; where none is left, it is returned as it is.
        """
        names = sorted(self.search_spaces)  # the order of scikit-optimize's dimensions

        def params_at(point):  # in numbers of Python, not of numpy
            plain = (value.item() if isinstance(value, np.generic) else value for value in point)
            return dict(zip(names, plain, strict=True))

        if candidates or not self.own_first:
            with warnings.catch_warnings():
                known = "The objective has been evaluated at point"
                warnings.filterwarnings("ignore", message=known)
                asked = optimizer.ask()
            if params_at(asked) in candidates:
                drawn = optimizer.space.rvs(DRAWS, random_state=optimizer.rng)
                others = (point for point in drawn if params_at(point) not in candidates)
                asked = next(others, asked)
            return asked, params_at(asked)
        own = self.estimator.get_params()
        params = {name: own[name] for name in names if name in own}
        point = [params.get(name) for name in names]
        try:
            inside = len(params) == len(names) and point in optimizer.space
        except TypeError:  # a name or None, where a number is searched
            inside = False
        return point if inside else None, params

    def _race(self, params, X, y, folds, scores, i) -> None:
        """Score a candidate fold by fold, as long as it is among the better half.

        A candidate that cannot be scored gets no score at all, so that none is compared with it.
        """
        for k, tried in enumerate(self._try_folds(params, X, y, folds)):
            if isinstance(tried, Exception) and not isinstance(tried, TrainingError):
                raise tried
            failed = isinstance(tried, TrainingError)
            scores[i, k] = np.nan if failed else tried
            if not np.isfinite(scores[i, k]):
                what = str(tried) if failed else f"expected a finite score, got {tried}."
                scores[i] = np.nan
                warn_user(
                    f"the candidate {params} could not be scored in fold {k}: {what} It counts as "
                    f"the worst. Remedy: a narrower search space."
                )
                break
            means = scores[: i + 1, : k + 1].mean(axis=1)  # NaN of those stopped before
            if means[i] < np.nanmedian(means):
                break

    def _try_folds(self, params, X, y, folds):
        """Yield a candidate's score on every fold, or its error, `n_jobs` folds at a time."""
        together = effective_n_jobs(self.n_jobs)
        candidate = clone(self.estimator).set_params(**params)
        for start in range(0, len(folds), together):
            yield from Parallel(self.n_jobs)(
                delayed(_try_fold)(candidate, self.scoring, X, y, *fold)
                for fold in folds[start : start + together]
            )

    def _show(self, i, params, scores, seconds) -> None:
        if self.verbose:
            n_folds = int(np.isfinite(scores[i]).sum())
            texts = (f"{v:.4g}" if isinstance(v, float) else v for v in params.values())
            words = ", ".join(f"{name}={text}" for name, text in zip(params, texts, strict=True))
            best = scores.mean(axis=1)[np.isfinite(scores).all(axis=1)].max(initial=-np.inf)
            print(
                f"[{type(self).__name__}] candidate {i + 1} of {self.n_iter}: "
                f"{words}; score {_means(scores)[i]:.4g} over {n_folds} of "
                f"{self.n_splits_} folds, {seconds:.1f} s; best {best:.4g}",
                flush=True,
            )

    def _keep(self, candidates, scores, seconds) -> None:
        whole = np.where(np.isfinite(scores).all(axis=1), scores.mean(axis=1), -np.inf)
        if np.isneginf(whole).all():
            raise ValueError(
                f"no score of {len(candidates)} candidates is a finite number, the first of them "
                f"{candidates[0]}. Remedy: another scoring, or a narrower search space."
            )
        self.best_index_ = int(np.argmax(whole))
        self.best_score_ = float(whole[self.best_index_])
        self.best_params_ = candidates[self.best_index_]
        splits = {f"split{k}_test_score": column.tolist() for k, column in enumerate(scores.T)}
        self.cv_results_ = {
            "params": candidates,
            **splits,
            "n_folds": np.isfinite(scores).sum(axis=1).tolist(),
            "mean_test_score": _means(scores).tolist(),
            "fit_time": seconds,
        }

    @inner_has("predict_interval")
    def predict_interval(self, X, coverage=0.9, y=None):
        """Return prediction intervals of the best estimator, if it has them.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.
        coverage : float, default=0.9
            Share of the measurements that should lie in the interval.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,), optional
            Measured outputs, where the best estimator takes them (`GreyBoxRegressor`).

        Returns
        -------
        low, high : ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Bounds of the interval.
        """
        measured = {} if y is None else {"y": y}
        return self._ask("predict_interval", X, coverage, **measured)

    def score(self, X: Table, y: Table) -> float:
        """Return the score of the best estimator.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs.

        Returns
        -------
        float
            The score, by `scoring`.
        """
        check_is_fitted(self)
        return float(check_scoring(self.best_estimator_, self.scoring)(self.best_estimator_, X, y))
