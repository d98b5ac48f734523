# what torch and skorch set is not typed
# mypy: disable-error-code="has-type,assignment,operator,misc,union-attr,arg-type"
"""The paper's physics-guided neural network with a physical loss, as a skorch regressor."""

import contextlib
from collections.abc import Sequence
from functools import partial
from typing import Any, NoReturn, Self

import numpy as np
from sklearn.base import MultiOutputMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import ArrayLike, Column, RandomState, Table
from sklearn_pgnn.estimators.network.batches import TensorBatches, own_random_numbers
from sklearn_pgnn.estimators.network.cores import FeedForward
from sklearn_pgnn.estimators.network.physics_loss import as_terms
from sklearn_pgnn.estimators.network.prepared_net import PreparedNet
from sklearn_pgnn.estimators.network.sample_interval import (
    holds_at_one_interval,
    parts_of_a_step,
)
from sklearn_pgnn.estimators.network.step_network import piece_run, ready_to_run
from sklearn_pgnn.estimators.network.stepper import Stepper
from sklearn_pgnn.estimators.simulated_predictions import (
    SimulatingMixin,
    one_simulation_warning,
)
from sklearn_pgnn.estimators.table_names import is_timed
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.ahead import Machine, predict_ahead
from sklearn_pgnn.simulation.network_run import network_record
from sklearn_pgnn.threads import one_thread_each
from sklearn_pgnn.trajectories.reader import rows_in_order
from sklearn_pgnn.trajectories.validation import (
    GapScoreMixin,
    refuse_fit_params,
    require_target,
    tags_of_records,
)
from sklearn_pgnn.user_line import warn_user

with needed_by("PGNNLRegressor"):
    import torch
    from skorch.callbacks import BatchScoring
    from torch import nn


class PGNNLRegressor(SimulatingMixin, GapScoreMixin, MultiOutputMixin, PreparedNet):
    r"""A network in feedback, guided by a physical model and by a physical loss (PGNN-L).

    .. math:: L = (1 - \lambda_{phy})\,L_{error} + \lambda_{phy}\,L_{phy}

    :math:`L_{error}` is the mean squared error as a share of that of the step's base alone over
    the same horizon, :math:`L_{phy}` the mean cost of the dimensionless physical residuals; both
    are dimensionless. One step of the network is, by `structure`,

    .. math::
        \text{output:}\quad x_{k+1} &= n(u_k, x_k, x_{phy,k+1}) \\
        \text{increment:}\quad x_{k+1} &= x_k + \Delta t\,n(u_k, x_k, x_{phy,k+1}) \\
        \text{correction:}\quad x_{k+1} &= \Phi(x_k, u_k) + \Delta t\,n(u_k, x_k) \\
        \text{dissipative:}\quad x_{k+1} &= \bar x
            - \Delta t\,R\,\nabla E(x_{k+1}),\quad
            R = L L^T,\; L = n(u_k, \bar x),\; \bar x = \Phi(x_k, u_k)

    with the model's simulation :math:`x_{phy}` and its own step :math:`\Phi` from the state that is
    fed back. The network is trained on single steps (teacher forcing), then on rollouts with its
    prediction fed back, then on the simulation of whole trajectories; the weights of the epoch
    with the best free run of the held-out trajectories are kept. ``predict`` is the free run from
    each trajectory's first row.

    It is a skorch regressor: callbacks, devices, ``module__...`` and ``optimizer__...`` work as
    in skorch. `EarlyStopping` ends the current phase; `LRScheduler` replaces the cosine decay; the
    data sets that callbacks see are the rows of the training trajectories and, with three or more
    trajectories, of the held-out ones; ``callbacks="disable"`` keeps the last weights. The model's
    own step is computed on the CPU whatever the ``device``. A network trained on a GPU can be
    loaded without one.

    One step of the network spans the median sample interval of its training. Longer steps, across
    a gap or in a table that is sampled more slowly, are divided into such steps, with the inputs
    held or straight by `hold`, in fits and in predictions. Where an interval is no multiple of it,
    a `RecordWarning` says so: only corrections and dissipative networks, whose outputs are rates
    that the step integrates, hold there, too.

    Features are standardised internally, so that a preceding scaler changes nothing, and energies
    are computed in physical units.

    "Costs 1.2 (0.9 to 3)" at a parameter below means that the free-run error on five simulated
    plants was 1.2 times that of the defaults in the median over the plants, and 0.9 to 3 times on
    the single plants; 0.6 to 1.5 is within the spread of the seeds. The documentation has the
    table.

    Parameters
    ----------
    model : PhysicsModel, optional
        The model that guides the network. Without a model but with a time the network is purely
        data-driven; without a time as well, the rows are independent of each other.
    structure : {"auto", "output", "increment", "correction", "dissipative"}, default="auto"
        Meaning of the network's output. ``"auto"`` is ``"correction"`` where the model predicts
        more than half of the change of the measured states a tenth of their dominant period ahead
        (in squares, relative to persistence), else ``"increment"``. The paper's ``"output"`` costs
        2.6 (1.0 to 120); the wrong one of the other two costs 10 to 13 where it matters.
        ``"dissipative"`` is passive by construction [4]_: whatever its weights, the network adds
        no energy to the states that the model's stored energy depends on,
        :math:`E(x_{k+1}) \le E(\Phi(x_k, u_k))`. Its outputs are the lower triangle of L, added to
        a unit diagonal, in a scale given by the size of the model's errors.
    guide : {"auto", "simulation", "step", "terms", None}, default="auto"
        What the network sees of the model: its open-loop simulation at the next sample, the rate
        :math:`(\Phi(x_k, u_k) - x_k)/\Delta t`, the terms whose sums are the model's rates (such
        as the sign in a friction, or a sine; not the limit of a whole rate) at the fed-back state,
        or nothing. ``"auto"`` is the simulation for outputs and increments, and the terms for
        corrections. None costs 1.0 (1.0 to 1.7).
    lambda_phy : float in [0, 1) or "adaptive", default=0.0
        Weight of the physical loss, or the rule of Wang, Teng and Perdikaris [2]_ that balances
        the gradients of both losses. With the energy balance of the prior, which lacks the effect
        to be learnt, 0.01 costs 1.3 (0.6 to 34), 0.1 costs 2.5 (1.0 to 78) and ``"adaptive"`` 2.3
        (1.1 to 27); with `Passivity` instead, 0.1 costs 1.0, but 33 where the energy of the
        missing spring is not in the balance.
    physics_loss : PhysicsTerm, callable or list of them, optional
        The physical terms; by default the model's energy balance.
    scaled : bool, default=True
        Whether both losses are dimensionless. With False they are those of the paper, so that
        `lambda_phy` is comparable with [1]_: :math:`L_{error}` is the mean over the samples of the
        sum of squared errors, of the states in single steps and of the outputs later, and
        :math:`L_{phy}` the mean square of the energy that a step lacks [J].
    free : sequence of str or "all", optional
        Parameters of the model that are trained with the network, within their spread and bounds;
        ``"all"`` means all that are not fixed. By default the model stays as it is.
    overlap : float, default=0.1
        Weight, as a share of the error, of a penalty that leaves to the free parameters what they
        can express [3]_: it penalises the part of the network's output over the training rows that
        lies in the column space of the model's derivatives by the parameters. A small weight only
        decides between values that fit equally well; with 0 nothing does.
    corrects : sequence of str, optional
        For a correction, the only states whose rates the network corrects; for a dissipative
        network, the only states that it takes energy out of.
    sees : sequence of str, optional
        The only states, inputs and further columns that the network sees, with the model's terms
        of these. What the network cannot express is left to the parameters: a network that
        corrects the speed and sees the speed leaves the inertia to the model.
    horizon : int, default=1
        Steps per rollout; 1 means no rollouts: with the last phase they add nothing, without it
        20 steps cost 4.3 (1.8 to 34) and no rollouts 4.7 (1.8 to 34).
    rollout_epochs : int, default=20
        Epochs of rollouts.
    refine : {"auto", "lm", "lbfgs", None}, default="auto"
        Last phase, on the simulation of whole trajectories: Levenberg-Marquardt, L-BFGS or none.
        ``"auto"`` is Levenberg-Marquardt for a `FeedForward` core of at most 1000 weights. L-BFGS
        costs 1.6 (1.1 to 24), none 4.7 (1.8 to 34).
    refine_max_iter : int, default=500
        Maximum number of steps of that phase, which ends earlier if five steps lower the loss by
        less than a thousandth; rejected steps do not count. 30 cost 1.1 (1.0 to 6).
    validation_fraction : float, default=0.2
        Share of the trajectories held out to choose the weights; with fewer than three
        trajectories, the share held out at the end of each.
    n_iter_no_change : int, default=100
        Epochs of rollouts, or steps of `refine`, without a better free run of the held-out
        trajectories after which that phase ends. While the loss still falls by orders of magnitude
        the held-out free run often becomes worse for tens of steps before it becomes better.
    states : sequence of str, optional
        Without a model: columns of X whose first row in every trajectory is the initial state, the
        outputs and then their rates.
    hold : {"zoh", "foh"}, optional
        Whether an input is held between two samples or interpolated linearly; by default as the
        model's `simulation` says, else held.
    substeps : int, optional
        Integration steps of the model from sample to sample; by default as the model's
        `simulation` says, else as many as accuracy needs.
    time_column : int or str, optional
        Column of X that holds the time; by default ``"t"``, of an array the first.
    random_state : int, RandomState instance or None, default=0
        Controls the random initial weights, batches and held-out trajectories. Torch has one
        random stream per process: trainings on several threads wait for each other.
    module : Module class, default=FeedForward
        The core: takes ``n_inputs`` and ``n_outputs``, and maps features to outputs; see
        `FeedForward` (``module__neurons``, ``module__layers``, ``module__activation``) and
        `Recurrent`. 4 neurons a layer cost 1.07 (1.0 to 1.3), 13 cost 1.10 (1.0 to 2.4); one layer
        1.05 (0.8 to 1.2); ``"silu"`` 1.2 (0.9 to 1.8).
    criterion : Module class, default=torch.nn.MSELoss
        Measures the scaled errors.
    optimizer : Optimizer class, default=torch.optim.Adam
        Optimizer of the first two phases; the learning rate follows a cosine decay in each
        (``callbacks__decay=None`` keeps it constant).
    lr : float, default=0.01
        Learning rate; a tenth of it in rollouts. 0.003 costs 0.99 (0.96 to 1.5), 0.03 costs
        1.0 (1.0 to 2.8).
    max_epochs : int, default=50
        Epochs on single steps; 20 cost 1.0 (1.0 to 1.6), 100 cost 1.0 (0.9 to
        1.2).
    batch_size : int, default=2048
        Maximum number of steps in a batch; small data sets are cut into at least 16 batches.
    iterator_train : class, default=TensorBatches
        Makes batches for the training.
    iterator_train__shuffle : bool, default=True
        Whether to shuffle the samples.
    train_split : callable or None, default=None
        As in skorch, for rows without a time; trajectories are held out by `validation_fraction`
        instead.
    use_caching : bool, default=False
        Whether scores of skorch's callbacks are taken from a training step's own predictions,
        which for trajectories are windows; otherwise from `predict`, which is a free run.
    verbose : int, default=0
        Whether to print every phase and every epoch.
    **kwargs
        Further parameters of `skorch.NeuralNet`.

    Attributes
    ----------
    model_ : PhysicsModel
        The model with its trained parameters.
    parameters_ : dict of str to Estimate
        Value, 95 % interval and unit of every parameter that was trained with the network. A
        parameter whose effect the records cannot distinguish from what the network learns takes the
        value at which the network expresses least of what the model could; its interval holds for
        that value.
    dissipation_ : dict of str to float
        Value of every trained parameter of a user-defined `EnergyBalance`.
    structure_ : str
        The structure that was used.
    lambda_phy_ : float
        The last weight of the physical loss.
    step_ : NetworkStep
        Definition of the network's step.
    hold_ : {"zoh", "foh"}
        How the inputs were assumed to vary between samples.
    substeps_ : int
        Integration steps of the model from sample to sample.
    noise_ : ndarray of shape (n_outputs,)
        Standard deviation of the training records' noise, by which `predict_ahead` weighs outputs.
    interval_ : float
        Median time from sample to sample of the training data [s], one step of the network.
    further_columns_ : sequence of str
        Columns of X that are neither time, inputs nor states, and that the network sees.
    guide_line_ : (ndarray, ndarray)
        Slope and offset of the simulated columns of X over the simulation, for every state.
    free_run_error_ : float
        Error of the held-out free run: root mean square, in standard deviations of the outputs.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    make_pgnn_pipeline : Simulation, scaling and this network in one.

    References
    ----------
    .. [1] R.-S. Goette, J. Timmermann, "Composed Physics- and Data-driven System Identification
       for Non-autonomous Systems in Control Engineering", 2021, arXiv:2112.08148.
    .. [2] S. Wang, Y. Teng, P. Perdikaris, "Understanding and mitigating gradient flow pathologies
       in physics-informed neural networks", SIAM Journal on Scientific Computing 43(5), 2021,
       :doi:`10.1137/20M1318043`.
    .. [3] B. M. Gyoerok, J. H. Hoekstra, J. Kon, T. Peni, M. Schoukens, R. Toth, "Orthogonal
       projection-based regularization for efficient model augmentation", 2025, arXiv:2501.05842.
    .. [4] A. van der Schaft, D. Jeltsema, "Port-Hamiltonian Systems Theory: An Introductory
       Overview", Foundations and Trends in Systems and Control 1(2-3), 2014,
       :doi:`10.1561/2600000002`.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 60, 601)
    >>> X = np.column_stack([t, np.sin(t) + np.sin(0.3 * t)])
    >>> machine = lag.replace(equations={"y": "(u - y - 0.3*y**3)/T"})
    >>> y = machine.simulate(t, X[:, 1]).y
    >>> net = PGNNLRegressor(lag, module__neurons=4, max_epochs=10).fit(X, y)
    >>> net.structure_, bool(net.score(X, y) > 0.999)
    ('correction', True)
    """

    def __init__(
        self,
        model: PhysicsModel | None = None,
        *,
        structure: str = "auto",
        guide: str = "auto",
        lambda_phy: float | str = 0.0,
        physics_loss: Any = None,
        scaled: bool = True,
        free: Sequence[str] | str | None = None,
        overlap: float = 0.1,
        corrects: Sequence[str] | None = None,
        sees: Sequence[str] | None = None,
        horizon: int = 1,
        rollout_epochs: int = 20,
        refine: str = "auto",
        refine_max_iter: int = 500,
        validation_fraction: float = 0.2,
        n_iter_no_change: int = 100,
        states: Sequence[str] | None = None,
        hold: str | None = None,
        substeps: int | None = None,
        time_column: Column | None = None,
        random_state: RandomState = 0,
        module: Any = FeedForward,
        criterion: Any = nn.MSELoss,
        optimizer: Any = torch.optim.Adam,
        lr: float = 0.01,
        max_epochs: int = 50,
        batch_size: int = 2048,
        iterator_train: Any = TensorBatches,
        iterator_train__shuffle: bool = True,
        train_split: Any = None,
        use_caching: bool = False,
        verbose: int = 0,
        **kwargs: Any,
    ):
        super().__init__(
            module,
            criterion=criterion,
            optimizer=optimizer,
            lr=lr,
            max_epochs=max_epochs,
            batch_size=batch_size,
            iterator_train=iterator_train,
            iterator_train__shuffle=iterator_train__shuffle,
            train_split=train_split,
            use_caching=use_caching,
            verbose=verbose,
            **kwargs,
        )
        self.model = model
        self.structure = structure
        self.guide = guide
        self.lambda_phy = lambda_phy
        self.physics_loss = physics_loss
        self.scaled = scaled
        self.free = free
        self.overlap = overlap
        self.corrects = corrects
        self.sees = sees
        self.horizon = horizon
        self.rollout_epochs = rollout_epochs
        self.refine = refine
        self.refine_max_iter = refine_max_iter
        self.validation_fraction = validation_fraction
        self.n_iter_no_change = n_iter_no_change
        self.states = states
        self.hold = hold
        self.substeps = substeps
        self.time_column = time_column
        self.random_state = random_state

    # -- scikit-learn ------------------------------------------------------------------------------

    def fit(self, X: Table, y: Table, **fit_params: Any) -> Self:
        """Train the network.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs, where known the states in each trajectory's first row, and whatever
            else the network is to see; without a model and a time, any features.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs; NaN where there is none. Trajectories without any measured output
            count in the physical loss only, and are ignored where `lambda_phy` is 0.
        **fit_params
            Fit parameters of skorch, such as ``epochs``, which overrides `max_epochs`.

        Returns
        -------
        self : PGNNLRegressor
            The trained network.

        Raises
        ------
        ValueError
            If a parameter is invalid, X and y cannot be read as records of the model, the energy
            in a weighted loss is missing from the model or distorted by a scaler, or a loss is
            not finite.
        """
        return self._fit(X, y, anew=not (self.warm_start and self.initialized_), **fit_params)

    def partial_fit(
        self, X: Table, y: Table = None, classes: Any = None, **fit_params: Any
    ) -> Self:
        """Continue the training from the present weights, with the present scaling.

        Parameters
        ----------
        X, y
            As in `fit`.
        classes : None
            Not used.
        **fit_params
            Fit parameters of skorch, such as ``epochs``, which overrides `max_epochs`.

        Returns
        -------
        self : PGNNLRegressor
            The trained network.
        """
        return self._fit(X, y, anew=not self.initialized_, **fit_params)

    def predict(self, X: Table) -> Any:
        """Simulate every trajectory in free run from its initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`; of the states only the first row of a trajectory is read.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Outputs. If a trajectory diverges, which a `SimulationWarning` reports, its last sample
            before the divergence is repeated.
        """
        check_is_fitted(self)
        if self.model_ is None:
            X = self._check_rows(X, reset=False)
            self.module_.eval()
            with torch.no_grad():
                y = self.module_(torch.as_tensor(X, device=self.device)).cpu().numpy()
        else:
            runs = self._free_runs(X)
            found = [
                self._outputs(each, x)[kept]
                for each, x, kept in zip(runs.ready, runs.x, runs.kept, strict=True)
            ]
            y = rows_in_order(runs.records, np.concatenate(found))
        return self._shaped(y)

    def _states_of(self, X) -> np.ndarray:
        runs = self._free_runs(X)
        own = [x[kept] for x, kept in zip(runs.x, runs.kept, strict=True)]
        return rows_in_order(runs.records, np.concatenate(own))

    def _outputs_ahead(self, X, y, steps: int) -> np.ndarray:
        if hasattr(self.module_.core, "at_rest"):
            raise ValueError(
                f"predict_ahead: expected a core without a hidden state, got "
                f"{type(self.module_.core).__name__}. Remedy: module=FeedForward."
            )
        runs = self._read_ready(X, y)
        along = piece_run(self.module_.core, self.step_)
        machines = [
            Machine(record, ready.x0, partial(along, ready, kept))
            for record, ready, kept in zip(runs.records, runs.ready, runs.kept, strict=True)
        ]
        return predict_ahead(machines, steps, self.noise_)[1]

    @property
    def predict_proba(self) -> NoReturn:
        """Not available: a regressor has no probabilities."""
        raise AttributeError(f"{type(self).__name__} has no predict_proba.")

    def physics_residual(self, X: Table, states: ArrayLike | None = None) -> np.ndarray:
        """Return the physical residuals of a prediction; no measurement is needed.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        states : array-like of shape (n_samples, n_states), optional
            Any prediction of the states; by default this network's free run.

        Returns
        -------
        ndarray of shape (n_samples, n_terms)
            Residual of every term for the step that ends in each row, for energies dimensionless
            or, with ``scaled=False``, in joules (for an inequality, the part above zero; for a term
            with several columns, their root mean square); NaN in the first row of a trajectory.

        Raises
        ------
        ValueError
            If there is no physical term: no model, or no energy.
        """
        check_is_fitted(self)
        loss = self._physics
        if loss is None:
            as_terms(self.physics_loss, self.model)
            raise ValueError(
                "physics_residual: expected a model with 'energy', or physics_loss, got neither. "
                "Remedy: give one of them before fit."
            )
        runs = self._free_runs(X) if states is None else self._read_ready(X)
        given, shape = None, (len(X), len(self.model_.states))
        if states is not None:
            given = np.asarray(states, dtype=float)
            if given.shape != shape:
                raise ValueError(f"states: expected shape {shape}, got {given.shape}.")
        trained = {name: each.value for name, each in self.parameters_.items()}
        trained |= self.dissipation_
        found = []
        for i, record in enumerate(runs.records):
            x = runs.x[i][runs.kept[i]] if given is None else given[record.rows]
            ready = network_record(self.model_, record.t, record.u, x[0], hold=self.hold_)
            columns = np.full((len(ready.t), len(loss.terms)), np.nan)
            parts = loss.residuals(
                torch.as_tensor(x)[None],
                torch.as_tensor(ready.u[:-1])[None],
                torch.as_tensor(ready.t)[None],
                {name: torch.tensor(value) for name, value in trained.items()},
            )
            for j, h in enumerate(parts):
                h = h[0].numpy()
                columns[1:, j] = h[:, 0] if h.shape[1] == 1 else np.sqrt(np.mean(h**2, axis=1))
            found.append(columns)
        return rows_in_order(runs.records, np.concatenate(found))

    def stepper(self, x0: ArrayLike | None = None, interval: float | None = None) -> Stepper:
        """Return the network as a single step with its state, for a real-time loop.

        Parameters
        ----------
        x0 : array-like of shape (n_states,), optional
            Initial state; by default the model's, its `settled` states at the first input.
        interval : float, optional
            Sample interval [s]; by default the training data's. A multiple of that is divided
            into steps of the network.

        Returns
        -------
        Stepper
            Its ``step(u)`` gives the outputs at the next sample.

        Raises
        ------
        ValueError
            If the network is not trained on trajectories with the package's own feed-forward core,
            or `interval` is no time.
        """
        check_is_fitted(self)
        if self.model_ is None or type(self.module_.core) is not FeedForward:
            raise ValueError(
                "stepper: expected a network with the core FeedForward, trained on trajectories."
            )
        interval = self.interval_ if interval is None else interval
        is_map = holds_at_one_interval(self.structure_, self.module)
        parts = parts_of_a_step(interval, self.interval_, is_map, self.structure_)
        return Stepper(self.module_.core, self.step_, x0, interval, self.guide_line_, parts)

    @one_simulation_warning()
    def _free_runs(self, X):
        runs = self._read_ready(X)
        run = ready_to_run(self.module_.core, self.step_)
        for record, ready in zip(runs.records, runs.ready, strict=True):
            x, failed = run(ready)
            if failed >= 0:
                warn_user(
                    f"trajectory {record.name!r}: the network's free run exceeded 1000 times the "
                    f"range of the training data at t = {ready.t[failed]:g} s; its last state is "
                    f"repeated. Remedy: structure='correction' or 'increment', rollouts "
                    f"(horizon=50), more trajectories, or a smaller network.",
                    SimulationWarning,
                )
            runs.x.append(x)
        return runs

    # -- training ----------------------------------------------------------------------------------

    def _fit(self, X, y, *, anew: bool, **fit_params):
        require_target(self, X, y)
        refuse_fit_params(self, {"sample_weight": fit_params.pop("sample_weight", None)})
        self._check_parameters()
        random = check_random_state(self.random_state)
        has_time = is_timed(X, self.model, self.time_column)
        with own_random_numbers(), one_thread_each() as self._threads:
            core = self._make_core(1, 1)  # refuses parameters that make none, before any work
            torch.manual_seed(random.randint(2**31 - 1))
            if has_time:
                refines = self.refine not in ("auto", None) and self.refine_max_iter
                if refines and type(core) is not FeedForward:
                    raise ValueError(
                        f"refine={self.refine!r} needs the core FeedForward, got "
                        f"{type(core).__name__}. Remedy: refine=None."
                    )
                self._train_on_trajectories(X, y, random, anew, **fit_params)
            else:
                self._train_on_rows(X, y, anew, **fit_params)
        return self

    def _train_on_rows(self, X, y, anew, **fit_params) -> None:
        """Train a plain regression on independent rows."""
        if self.lambda_phy != 0:
            raise ValueError(
                f"lambda_phy: expected 0 where rows have no time, got {self.lambda_phy!r}. "
                f"Remedy: give a model and X with a time."
            )
        X, y = self._check_rows(X, y, reset=anew)
        self._single_output = y.ndim == 1
        y = y.reshape(len(y), -1).astype(float)
        self.model_, self._rows, self.lambda_phy_ = None, (X, y), 0.0
        self.parameters_, self.dissipation_ = {}, {}
        self._data, self._phase, self._physics = None, None, None
        if anew:
            self.initialize()
        self.notify("on_train_begin", X=X, y=y)
        with contextlib.suppress(KeyboardInterrupt):
            self.fit_loop(X, y, **fit_params)
        self.notify("on_train_end", X=X, y=y)
        del self._rows

    def _train_on_trajectories(self, X, y, random, anew, epochs=None, **fit_params) -> None:
        """Train a network in feedback: single steps, rollouts, whole trajectories."""
        if self.train_split is not None:
            raise ValueError(
                f"train_split: expected None where X has a time, got {self.train_split!r}: it "
                f"would hold out windows whose neighbours are trained on. Remedy: "
                f"validation_fraction=0.2 holds out trajectories."
            )
        self._data = data = self._prepare_training(X, y, random, anew)
        if anew:
            self.initialize()
        if any(isinstance(part, BatchScoring) for _, part in self.callbacks_):
            raise ValueError(
                "callbacks: BatchScoring scores batches of rows, but a batch of trajectories holds "
                "windows of them. Remedy: EpochScoring."
            )
        self._free_parameters()
        self.module_.samples, self.module_.free = data.windows.samples, self._free
        self.notify("on_train_begin", X=X, y=y)
        with contextlib.suppress(KeyboardInterrupt):
            with self._one_phase("single steps"):
                epochs = self.max_epochs if epochs is None else epochs
                self._train_steps(epochs, **fit_params)
            if self.horizon > 1:
                with self._one_phase("rollouts"):
                    self._train_rollouts(**fit_params)
            with self._one_phase("whole trajectories"):
                self._train_simulation()
        self._restore_best()
        self.notify("on_train_end", X=X, y=y)
        self.free_run_error_ = self._validation_error() if data.validation else np.nan
        self._settle_parameters()
        self.module_.samples, self._phase, self._data = {}, None, None

    def __sklearn_tags__(self):
        return tags_of_records(super().__sklearn_tags__(), self.model is not None)
