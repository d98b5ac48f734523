"""Sparse identification of nonlinear dynamics with control, as an estimator."""

from numbers import Integral, Real
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, MultiOutputMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from sklearn_pgnn.annotations import Column, Table
from sklearn_pgnn.estimators.progress import progress_printer
from sklearn_pgnn.estimators.simulated_predictions import SimulatingMixin
from sklearn_pgnn.estimators.sindyc_library import (
    read_library,
    sparse_coefficients,
    stepwise_least_squares,
    term_function,
    term_texts,
)
from sklearn_pgnn.estimators.sindyc_model import (
    complete,
    equation_texts,
    identified_model,
    velocities,
)
from sklearn_pgnn.estimators.sindyc_records import (
    measure_states,
    on_even_clock,
    rate_rows,
    refuse_no_rows,
    step_rows,
    warn_of_gaps,
)
from sklearn_pgnn.estimators.table_names import blank_model, identifiers, is_timed, target_names
from sklearn_pgnn.physics.expressions import parse_expression
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_parts import HOLDS
from sklearn_pgnn.simulation.finite_run import limits_of, steps_for
from sklearn_pgnn.simulation.record_windows import noise_levels, output_noise
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.substeps import Steps, without_long_steps
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.contradicted_states import warn_of_unknown_starts
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.measured import warn_of_constant_outputs
from sklearn_pgnn.trajectories.tables import as_pandas
from sklearn_pgnn.trajectories.validation import (
    GapScoreMixin,
    check_model,
    refuse_fit_params,
    require_target,
    tags_of_records,
    validate_table,
)
from sklearn_pgnn.user_line import warn_user

#: what may help against a divergence of what was identified
REMEDY = "raise threshold, take a smaller library, or longer spans"


class SINDYcRegressor(SimulatingMixin, MultiOutputMixin, GapScoreMixin, BaseEstimator):
    r"""Find the few terms of a library that make up a machine's rates; predict by simulation.

    .. math:: \dot x = \Xi\,\Psi(x, u) \qquad \text{or} \qquad x_{k+1} = \Xi\,\Psi(x_k, u_k)

    with the library's terms :math:`\Psi` and a sparse matrix :math:`\Xi` [1]_. The states are
    estimated from the records' outputs; a position's rate is its velocity, which is not
    identified. Rates are averaged over a short span, over which the equations hold as well: from
    one sample to the next they would be noise. No span reaches from one trajectory into another, or
    into a gap, longer than itself, of a state in the library; where more than a fifth of the time
    is in gaps a `RecordWarning` says so.

    Without a model the states are the columns of y, under their own names, and every other column
    of X is an input. Without a model and a time (plain arrays, no column ``t``) the rows are
    independent, and the same regression finds :math:`y = \Xi\,\Psi(X)`.

    Parameters
    ----------
    model : PhysicsModel, optional
        Names states, inputs and outputs, and gives the terms of ``"model"``.
    library : str, pysindy library or list of these, default="polynomial"
        Candidate terms: ``"polynomial"`` of states and inputs; ``"fourier"`` or
        ``"trigonometric"``, the sine and cosine of each; ``"model"``, the terms whose sums are the
        model's own rates, besides states and inputs; an expression such as ``"tanh(omega/0.02)"``;
        a library of pysindy whose terms are named by what they compute; a list combines them.
    degree : int, default=2
        Degree of ``"polynomial"``.
    threshold : float, default=0.005
        Least share of a rate (of a step, for a map) that a term must contribute: the root mean
        square of the term times its coefficient, over the rate's standard deviation. 0.005 drops
        terms that contribute less than half a percent of a state's motion.
    alpha : float, default=1e-4
        Ridge penalty while terms are chosen, as a share of the terms' own mean squares.
    optimizer : pysindy optimizer, optional
        Chooses the terms, instead of sequentially thresholded least squares with `threshold` and
        `alpha`. It is cloned. It sees every term divided by its root mean square and every rate by
        its standard deviation; `coefficients_` are in physical units all the same.
    discrete : bool, default=False
        Whether to identify, instead of rates, a map from sample to sample; it contains every
        state's own last value whatever the library.
    span : float, optional
        Time over which rates and steps are averaged [s]; by default a thirtieth of the dominant
        period of the outputs. 0 takes neighbouring samples.
    time_column : int or str, optional
        Column of X that holds the time; by default ``"t"`` or, with a model, an array's first.
    hold : {"zoh", "foh"}, optional
        Whether an input is held between two samples or interpolated linearly; by default as the
        model's `simulation` says, else held. A map uses only the input at its sample.
    substeps : int, optional
        Integration steps from sample to sample; by default as the model's `simulation` says, else
        as many as accuracy needs. A map takes one.
    verbose : int, default=0
        Whether to print a line for every stage of the fit.

    Attributes
    ----------
    model_ : PhysicsModel or None
        The identified model, coefficients as parameters such as ``c_omega_sin_phi``. Units,
        inputs, outputs, delays and inertia are those of `model`, their parameters fixed; there are
        no energy terms, as the power of the identified terms is unknown. A map is written as the
        rate :math:`(\Xi\Psi(x, u) - x)/T` with the sample interval :math:`T`: an explicit Euler
        step of one sample (``simulate(..., method="euler")``) is exactly the map. None if rows are
        independent.
    coefficients_ : ndarray of shape (n_states, n_terms)
        :math:`\Xi` in physical units; without time of shape (n_outputs, n_terms).
    terms_ : list of str
        The library, term by term.
    equations_ : list of str
        The identified equations, one per state, with coefficients rounded to four digits.
    noise_ : ndarray of shape (n_outputs,)
        Standard deviation of the training records' noise, by which `predict_ahead` weighs outputs;
        where rows are samples in time.
    hold_ : {"zoh", "foh"}
        How the inputs were assumed to vary between samples, where rows are samples in time.
    substeps_ : int
        Integration steps from sample to sample, where rows are samples in time; `model_` carries
        both.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    PhysicsModelRegressor : Fits the coefficients of `model_` to the records by simulation.

    Notes
    -----
    The defaults come from simulated records of a golf robot with stick-slip, a servo valve with
    limits and a cart on a hardening spring, four or three draws each. Thresholds of 0.005 and 0.01
    gave the cart exactly its four terms out of twenty; 0.02 drops the golf robot's viscous damping
    and so doubles to quadruples its error in free run. `alpha` did not matter up to 1e-3. A span
    of zero costs the golf robot and the cart two to twenty times the error.

    In a map a term that acts through another state (a force on a position) contributes a share
    that falls with the sample interval; fast sampling needs a lower threshold.

    References
    ----------
    .. [1] S. L. Brunton, J. L. Proctor, J. N. Kutz, "Sparse identification of nonlinear dynamics
       with control (SINDYc)", IFAC-PapersOnLine 49(18), 2016, :doi:`10.1016/j.ifacol.2016.10.249`.
    .. [2] H. Schaeffer, S. G. McCalla, "Sparse model selection via integral terms", Physical
       Review E 96, 2017, :doi:`10.1103/PhysRevE.96.023302`.

    Examples
    --------
    >>> cart = PhysicsModel(
    ...     {"x": "m", "v": "m/s"}, {"x": "v", "v": "force - 9*x - 0.5*v - 4*x**3"},
    ...     inputs={"force": "N"}, outputs={"position": "x"})
    >>> t = np.linspace(0, 20, 2001)
    >>> X = np.column_stack([t, 4 * np.sin(t**2 / 6)])
    >>> y = cart.simulate(t, X[:, 1]).y
    >>> sindyc = SINDYcRegressor(cart, degree=3).fit(X, y)
    >>> print(sindyc.equations_[1])
    v' = -8.997*x - 0.4999*v + 0.9996*force - 4.004*x**3
    """

    def __init__(
        self,
        model: PhysicsModel | None = None,
        *,
        library: Any = "polynomial",
        degree: int = 2,
        threshold: float = 0.005,
        alpha: float = 1e-4,
        optimizer: Any = None,
        discrete: bool = False,
        span: float | None = None,
        time_column: Column | None = None,
        hold: str | None = None,
        substeps: int | None = None,
        verbose: int = 0,
    ):
        self.model = model
        self.library = library
        self.degree = degree
        self.threshold = threshold
        self.alpha = alpha
        self.optimizer = optimizer
        self.discrete = discrete
        self.span = span
        self.time_column = time_column
        self.hold = hold
        self.substeps = substeps
        self.verbose = verbose

    def fit(self, X: Table, y: Table, **fit_params: Any) -> Self:
        """Identify the equations.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and, where known, the states in each trajectory's first row.
        y : DataFrame or array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs of the model, or the states; NaN where there is none.
        **fit_params
            Nothing else: weights of samples are refused.

        Returns
        -------
        self : SINDYcRegressor
            The fitted regressor.

        Raises
        ------
        ValueError
            If X and y cannot be read as records, or a parameter is out of its range.
        ImportError
            If pysindy is not installed.
        """
        refuse_fit_params(self, fit_params)
        require_target(self, X, y)
        self._check_parameters()
        y = as_pandas(y)
        self._single_output = np.asarray(y).ndim == 1
        if is_timed(X, self.model, self.time_column):
            return self._fit_records(validate_table(self, X, reset=True), y)
        if self.discrete:
            raise ValueError(
                "discrete=True needs samples in time, got rows without one. Remedy: give X a "
                "column 't', or say by time_column=... which column it is."
            )
        return self._fit_rows(X, y)

    def predict(self, X: Table) -> Any:
        """Simulate every trajectory in free run from its first row.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`; of the states only the first row of a trajectory is read, and a state that
            X lacks starts at ``model_.initial_state``.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Simulated outputs. All rows of a trajectory whose simulation becomes non-finite,
            or grows to a thousand times what was measured, get the values of the first row, which
            a `SimulationWarning` reports.
        """
        check_is_fitted(self)
        if self.model_ is None:
            return self._shaped(self._predict_rows(X))
        names = list(self.model_.outputs)
        return self._shaped(self._runs.simulate(self.model_, self._read(X), names))

    # -- samples in time ---------------------------------------------------------------------------

    def _fit_records(self, X, y):
        base = blank_model(X, y, self.time_column) if self.model is None else self.model
        records = read_records(base, X, y, time_column=self.time_column)
        if self.model is not None:
            refuse_standardised(self.model, records)
            warn_of_unknown_starts(self.model, records)
        warn_of_constant_outputs(base, records)
        levels = noise_levels(records)
        self.hold_, self.noise_ = hold_of(base, self.hold), output_noise(records, levels)
        options = {"hold": self.hold_, "substeps": self.substeps, "levels": levels}
        states = measure_states(base, records, **options)
        progress = progress_printer(self)
        progress(f"{len(records)} trajectories, {len(states.x)} samples: states estimated")
        library = read_library(self.library, [*base.states, *base.inputs], self.degree, self.model)
        found = self._identify(base, states, library)
        terms, self.coefficients_ = complete(base, library, found, self.discrete)
        self._interval = states.interval if self.discrete else None
        self.model_ = identified_model(base, terms, self.coefficients_, self._interval)
        if self.model is None:
            firsts = [rows.start for rows in states.pieces]
            start = states.x[firsts].mean(axis=0).tolist()
            start = dict(zip(self.model_.states, start, strict=True))
            self.model_ = self.model_.replace(initial_state=start)
        form = "{}[k+1]" if self.discrete else "{}'"
        self._keep_texts([form.format(state) for state in base.states], terms)
        steps = Steps("euler") if self.discrete else self._enough_steps(records)
        self.substeps_ = steps.substeps
        limits = limits_of(np.concatenate([record.y for record in records]))
        how = self.substeps_, limits, self.hold_, steps.method, REMEDY
        self._simulated = (states.interval, *how)
        told = {"substeps": 1} if self.discrete else steps.settings
        self.model_ = self.model_.replace(simulation={"hold": self.hold_, **told})
        progress(f"{self.substeps_} substeps from sample to sample")
        return self

    def _identify(self, base, states, library) -> np.ndarray:
        """Find the coefficients of every step, or of every rate that is not known."""
        function = term_function(library, [*base.states, *base.inputs])

        def values(x, u, t):
            return _finite(function(np.column_stack([x, u]), t), library)

        rows = step_rows if self.discrete else rate_rows
        known = () if self.discrete else velocities(base)
        names = list(base.states)
        chosen = [i for i, name in enumerate(names) if name not in known]
        inside = {str(each) for term in library for each in term.free_symbols}
        used = np.array([name in inside for name in names])
        in_gaps, found = states.in_gaps(self.span), np.zeros((len(names), len(library)))
        warn_of_gaps(in_gaps & used, states.durations(), names)
        for group in states.alike(chosen):
            gaps = in_gaps & (used | np.isin(np.arange(len(names)), group))
            ends = states.is_measured[:, group[0]]
            terms, rates = rows(states, values, self.span, ends, gaps.any(axis=1))
            refuse_no_rows(terms, gaps, names)
            found[group] = self._regress(terms, rates[:, group], [names[i] for i in group])
        return found[chosen]

    def _enough_steps(self, records) -> Steps:
        with np.errstate(all="ignore"):  # a diverging map diverges here as well
            even = without_long_steps(records)
            return steps_for(self.model_, even, self.substeps, hold=self.hold_)

    def _model_of_y(self) -> PhysicsModel | None:
        return self.model_ if self.model is None else self.model

    def _read(self, X, y=None):
        """Read the records of a table; y need not be enough for a fit."""
        X = validate_table(self, X, reset=False)
        records = read_records(self.model_, X, y, time_column=self.time_column, to_fit=False)
        if self.model is not None:
            refuse_standardised(self.model, records)
        return records if self._interval is None else on_even_clock(records, self._interval)

    # -- independent rows --------------------------------------------------------------------------

    def _fit_rows(self, X, y):
        names = target_names(y, "y")
        X, y = validate_data(self, X, y, multi_output=True, y_numeric=True, dtype=float)
        terms = read_library(self.library, self._columns(), self.degree)
        values = _finite(term_function(terms, self._columns())(X), terms)
        self.coefficients_ = self._regress(values, y.reshape(len(y), -1), names)
        self.model_ = None
        self._keep_texts(names, terms)
        return self

    def _predict_rows(self, X):
        X = validate_data(self, X, reset=False, dtype=float)
        columns = self._columns()
        terms = [parse_expression(text, columns) for text in self.terms_]
        return _finite(term_function(terms, columns)(X), terms) @ self.coefficients_.T

    def _columns(self) -> list[str]:
        """Name the columns of X as its terms do."""
        default = [f"x{i}" for i in range(self.n_features_in_)]
        return identifiers(getattr(self, "feature_names_in_", default))

    # -- both --------------------------------------------------------------------------------------

    def _regress(self, terms, targets, names) -> np.ndarray:
        optimizer = self.optimizer
        if optimizer is None:
            optimizer = stepwise_least_squares(self.threshold, self.alpha, *terms.shape)
        found = sparse_coefficients(terms, targets, optimizer, squares_only=self.optimizer is None)
        n_found, (n_rows, n_terms) = np.count_nonzero(found), terms.shape
        progress_printer(self)(
            f"{n_rows} rows, {n_terms} terms, targets: {', '.join(names)}; {n_found} terms are left"
        )
        for name, row, target in zip(names, found, targets.T, strict=True):
            if not row.any() and target.any():
                warn_user(
                    f"no term of the library is left for {name!r}. Remedy: lower threshold, "
                    f"or give the library other terms."
                )
        return found

    def _keep_texts(self, left, terms) -> None:
        self.terms_ = term_texts(terms)
        self.equations_ = equation_texts(left, terms, self.coefficients_)

    def _check_parameters(self) -> None:
        check_model(self.model, optional=True)
        _check_number("degree", self.degree, Integral, 1)
        _check_number("threshold", self.threshold, Real, 0)
        _check_number("alpha", self.alpha, Real, 0)
        if self.span is not None:
            _check_number("span", self.span, Real, 0)
        if self.substeps is not None:
            _check_number("substeps", self.substeps, Integral, 1)
        if self.hold not in (None, *HOLDS):
            raise ValueError(f"hold: expected one of {', '.join(HOLDS)}, got {self.hold!r}.")

    def __sklearn_tags__(self):
        has_time = self.model is not None or self.time_column is not None
        return tags_of_records(super().__sklearn_tags__(), has_time)


def _check_number(name: str, value, kind, least) -> None:
    if isinstance(value, bool) or not isinstance(value, kind) or not least <= value < np.inf:
        what = "an integer" if kind is Integral else "a number"
        raise ValueError(f"{name}: expected {what} >= {least}, got {value!r}.")


def _finite(values, terms) -> np.ndarray:
    """Refuse terms that have no value at some sample."""
    bad = ~np.isfinite(values)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise ValueError(
            f"library: the term {term_texts(terms)[column]!r} has no finite value at "
            f"{bad[:, column].sum()} samples, first at sample {row}. Remedy: leave it out, or "
            f"write it so that it has one."
        )
    return values
