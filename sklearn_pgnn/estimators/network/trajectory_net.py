# what torch and skorch set is not typed
# mypy: disable-error-code="has-type,assignment,operator,misc,union-attr,arg-type"
"""A skorch regressor that trains a network in feedback, phase after phase."""

import contextlib
import copy
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from skorch import NeuralNetRegressor
from skorch.callbacks import (
    EarlyStopping,
    EpochTimer,
    LRScheduler,
    PassthroughScoring,
    PrintLog,
)
from skorch.utils import get_map_location, to_tensor
from torch import nn

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.estimators.network.batches import own_random_numbers
from sklearn_pgnn.estimators.network.callbacks import BestFreeRun, CosineDecay, EnoughTraining
from sklearn_pgnn.estimators.network.cores import FeedForward, RowNetwork
from sklearn_pgnn.estimators.network.free_parameters import FreeParameters, Overlap
from sklearn_pgnn.estimators.network.least_squares import (
    OverlapCost,
    SimulationObjective,
    l_bfgs,
    levenberg_marquardt,
    parameter_errors,
)
from sklearn_pgnn.estimators.network.physics_loss import (
    ADAPTIVE,
    NotFinite,
    PhysicsLoss,
    balanced_lambda,
)
from sklearn_pgnn.estimators.network.records import TrainingData, TrainingRecord
from sklearn_pgnn.estimators.network.step_network import (
    StepNetwork,
    ready_to_run,
    step_with,
    tuned,
    weights_of,
)
from sklearn_pgnn.estimators.network.structure import ON_THE_MODEL, base_error, corrected_states
from sklearn_pgnn.estimators.network.torch_functions import outputs_of
from sklearn_pgnn.exceptions import SimulationWarning, TrainingError
from sklearn_pgnn.simulation.network_run import NetworkStep
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, Estimate
from sklearn_pgnn.user_line import warn_user

#: "auto" refines by Levenberg-Marquardt steps up to this many weights
FEW_WEIGHTS = 1000
#: the overlap is reweighted until the error falls by less than this share, at most this often
SETTLED, ROUNDS = 0.8, 5
#: attributes that are rebuilt from the weights when a pickle is loaded
_TRAINED = ("module_", "criterion_", "optimizer_", "callbacks_")


@dataclass
class _Phase:
    """One phase of the training."""

    epochs: int
    horizon: int
    scale: torch.Tensor
    rate: float
    epoch: int = 0


class TrajectoryNet(NeuralNetRegressor):
    """The training of `PGNNLRegressor`: single steps, rollouts, whole trajectories."""

    _phase: _Phase | None
    _physics: PhysicsLoss | None
    _data: TrainingData | None = None  # during the training on trajectories
    _free_names: tuple[str, ...] = ()  # of the model
    _balance_names: tuple[str, ...] = ()  # of the physical loss alone
    _free: FreeParameters | None = None  # while they are trained
    _overlap: Overlap | None = None
    step_: NetworkStep
    model_: Any  # a PhysicsModel; None where the rows have no time

    def _get_param_names(self):
        """Name the parameters; skorch would also count private attributes set by `fit`."""
        return [name for name in super()._get_param_names() if not name.startswith("_")]

    def set_params(self, **params: Any) -> Self:
        """Set parameters; they all wait for the next fit.

        Parameters
        ----------
        **params
            Parameters by name. With one of the core (``module``, ``module__...``) the network does
            not count as fitted any more.

        Returns
        -------
        self : PGNNLRegressor
            The network.
        """
        if any(name.partition("__")[0] == "module" for name in params):
            self.initialized_ = False  # skorch would make a core of random weights at once
        return super().set_params(**params)

    def __sklearn_is_fitted__(self):
        """Return whether there is a trained core."""
        return bool(self.initialized_) and super().__sklearn_is_fitted__()

    def __repr__(self):
        defaults = type(self)().get_params(deep=False)
        changed = [
            f"{name}={value!r}"
            for name, value in self.get_params(deep=False).items()
            if name not in defaults or repr(value) != repr(defaults[name])
        ]
        return f"{type(self).__name__}({', '.join(changed)})"

    def notify(self, method_name: str, **cb_kwargs: Any) -> None:
        """Call a method of all callbacks, passing the data sets as rows of X and y, not windows."""
        if "dataset_train" in cb_kwargs:
            cb_kwargs |= self._data.rows if self._data else {}
        super().notify(method_name, **cb_kwargs)

    @contextlib.contextmanager
    def _one_phase(self, name: str):
        """Train one phase, which `EarlyStopping` sees as a separate training."""
        if self.verbose:
            print(name, flush=True)
        stopping = [part for _, part in self.callbacks_ if isinstance(part, EarlyStopping)]
        for part in stopping:
            part.on_train_begin(self)
        try:
            yield
        except EnoughTraining:
            pass
        except KeyboardInterrupt:
            if not any(part.misses_ >= part.patience for part in stopping):
                raise
        except NotFinite as error:
            raise TrainingError(
                f"the training stopped in epoch {len(self.history)}: {error}"
            ) from None
        for part in stopping:
            part.on_train_end(self)
        self._restore_best()

    def _restore_best(self) -> None:
        for _, part in self.callbacks_:
            if isinstance(part, BestFreeRun):
                part.restore(self)

    def _train_steps(self, epochs, **fit_params) -> None:
        """Train on single steps; a recurrent core on stretches, the measured state fed back."""
        windows, length = self._data.windows, 1
        if hasattr(self.module_.core, "at_rest"):
            length = min(max(20, self.horizon), max(1, max(windows.lengths) - 1))
        own = corrected_states(self.model_, self.structure_)
        after = windows.pairs + 1
        base = {"constant": self.step_.offset, "state": windows.x[windows.pairs]}.get(
            self.step_.base, windows.prior[windows.pairs]
        )
        left = np.sqrt(np.mean((windows.x[after] - base) ** 2, axis=0))[own]
        self.module_.teacher_forcing = True
        target = windows.at_ends(windows.told_x[:, own], length)
        self._run_phase(length, target, left, 1.0, epochs, **fit_params)

    def _train_rollouts(self, **fit_params) -> None:
        """Train on windows along which the prediction is fed back; the outputs are compared."""
        windows = self._data.windows
        length = min(int(self.horizon), max(1, max(windows.lengths) - 1))
        self.module_.teacher_forcing = False
        left = self._base_error(self._data.records, length)
        target = windows.at_ends(windows.y, length)
        self._run_phase(length, target, left, 0.1, self.rollout_epochs, **fit_params)

    def _run_phase(self, length, target, scale, rate, epochs, **fit_params) -> None:
        scale = self._measure(np.where(scale > 0, scale, 1.0))
        scale = torch.as_tensor(scale, device=self.device)
        self._phase = _Phase(epochs, length, scale, rate)
        teacher = self.module_.teacher_forcing
        batch = self._data.windows.cut(length, self.step_, teacher=teacher)
        if self._free_names:
            for part in ("prior", "terms"):
                batch.pop(part, None)  # they move with the parameters
        self.fit_loop(batch, target, epochs=epochs, **fit_params)

    def _measure(self, left) -> np.ndarray:
        """Return the scale of errors: the error left to explain, per output or for their sum."""
        return left if self.scaled else np.full(left.shape, left.size**-0.5)

    def _base_error(self, training, length) -> np.ndarray:
        error = base_error(self.step_, training, self._outputs, length)
        return np.minimum(error, self._data.spread)

    def _in_reach(self) -> list[TrainingRecord]:
        """Return the unmeasured trajectories that the network, as it is, can run along."""
        run, blind = self._ready_to_run(), self._data.unmeasured
        runs = [run(each.record)[1] for each in blind]
        found = [each for each, failed in zip(blind, runs, strict=True) if failed < 0]
        if len(found) < len(runs):
            warn_user(
                f"in {len(runs) - len(found)} of {len(runs)} trajectories without y the network's "
                f"free run exceeded 1000 times the range of the training data; the last training "
                f"phase omits them. Remedy: rollouts (horizon=50), or inputs closer to the "
                f"measured ones.",
                SimulationWarning,
            )
        return found

    def _train_simulation(self) -> None:
        """Train on the free run of whole trajectories, all weights at once."""
        core, method = self.module_.core, self.refine
        self.module_.teacher_forcing = False
        theta = weights_of(core)
        if method == "auto":
            small = type(core) is FeedForward and theta.size <= FEW_WEIGHTS
            method = "lm" if small else None
        if method is None or not self.refine_max_iter:
            return
        self._is_enough = False
        bounds: tuple = (-np.inf, np.inf)
        if self._free is not None:
            unbounded = np.full(theta.size, np.inf)
            theta = np.append(theta, self._changes())
            bounds = np.append(-unbounded, self._free.low), np.append(unbounded, self._free.high)
        minimise = levenberg_marquardt if method == "lm" else l_bfgs
        self._phase = None
        objective = self._objective([*self._data.records, *self._in_reach()])
        first, everyone = len(self.history), self.callbacks_
        # schedulers have nothing to do in a phase without the optimizer
        self.callbacks_ = [each for each in everyone if not isinstance(each[1], LRScheduler)]
        try:
            for _ in range(ROUNDS if objective.overlap else 1):
                before = objective.weigh_overlap(theta)
                begun = len(self.history)
                theta = minimise(objective, theta, self.refine_max_iter, self._on_step, bounds)
                settled = objective.error(theta) > SETTLED * before
                if settled or self._is_enough or len(self.history) == begun:
                    break
        finally:
            self.callbacks_ = everyone
        if len(self.history) == first:
            _warn_of_lost(objective, theta)

    def _objective(self, training) -> SimulationObjective:
        """Return the loss of whole trajectories."""
        weighs = self._overlap is not None and self.overlap > 0
        return SimulationObjective(
            self._free_step(),
            training,
            self._measure(self._base_error(training, None)),
            self._physics,
            self.lambda_phy_,
            self._data.stride,
            self._threads,
            OverlapCost(self._overlap, self.module_.core, self.overlap) if weighs else None,
        )

    def _free_step(self) -> NetworkStep:
        """Return the step with the core's sizes and, during their training, the free parameters."""
        step = step_with(self.module_.core, self.step_)
        return step if self._free is None else replace(step, free=self._free.names)

    def _ready_to_run(self):
        return ready_to_run(self.module_.core, self._free_step(), self._changes())

    # -- the model's parameters --------------------------------------------------------------------

    def _free_parameters(self) -> None:
        """Let the model's parameters be trained, from their present values."""
        self._free, self._overlap = None, None
        names = self._free_names + self._balance_names
        if names:
            self._free = FreeParameters.of(self._prior, self.model_, names)
            if self._free_names and self.structure_ in ON_THE_MODEL:
                self._overlap = Overlap(self.step_, self._free, self._data.windows)

    def _changes(self) -> np.ndarray:
        """Return the present relative changes of the parameters."""
        if self._free is None:
            return np.zeros(0)
        changes = self.module_.changes.detach().cpu().numpy()
        return np.clip(changes, self._free.low, self._free.high)

    def _tuned(self) -> dict:
        """Return the present values of the parameters, as tensors."""
        return {} if self._free is None else self._free.values(self.module_.changes)

    def _settle_parameters(self) -> None:
        """Set the model's parameters to their last values, and store their uncertainty."""
        self.parameters_: dict[str, Estimate] = {}
        self.dissipation_: dict[str, float] = {}
        if self._free is None:
            return
        free, changes = self._free, self._changes()
        reach = np.full(len(free.names), np.inf)
        if type(self.module_.core) is FeedForward:
            objective = self._objective(self._data.records)
            objective.lambda_phy, objective.overlap = 0.0, None
            theta = np.append(weights_of(self.module_.core), changes)
            reach = NORMAL_95 * parameter_errors(objective, theta)
        found = free.estimates(self.model_, changes, reach)
        self.parameters_ = {name: found[name] for name in self._free_names}
        self.dissipation_ = {name: found[name].value for name in self._balance_names}
        self.step_ = tuned(replace(self.step_, free=free.names), changes)
        self.model_ = self.step_.model
        self.module_.step = self.step_
        self._free = self._overlap = self.module_.free = None
        with torch.no_grad():
            self.module_.changes.zero_()
        ends = [each for each in free.at_the_end(changes) if each in self._free_names]
        if ends:
            warn_user(
                f"{', '.join(ends)} ended at a limit of the spread or bounds. Remedy: a larger "
                f"spread in the model; 'corrects' and 'sees', where it is known what the missing "
                f"part acts on and depends on; or leave the parameter out of 'free'."
            )

    def _on_step(self, theta, cost) -> bool:
        """Record a step of the last phase as an epoch; return whether it is the last one."""
        self._set_weights(theta)
        self.notify("on_epoch_begin", dataset_train=None, dataset_valid=None)
        self.history.new_batch()
        self.history.record_batch("train_loss", float(cost))
        self.history.record_batch("train_batch_size", 1)
        try:
            self.notify("on_epoch_end", dataset_train=None, dataset_valid=None)
        except EnoughTraining:
            self._is_enough = True
        return self._is_enough

    def _set_weights(self, theta) -> None:
        if self._free is not None:
            theta, changes = np.split(theta, [-len(self._free.names)])
            with torch.no_grad():
                self.module_.changes.copy_(torch.as_tensor(changes))
        weights = torch.as_tensor(theta, device=self.device)
        nn.utils.vector_to_parameters(weights, self.module_.core.parameters())

    def _validation_error(self) -> float:
        """Return the free-run error of the held-out trajectories, in deviations of the outputs."""
        errors: list[np.ndarray] = []
        run = self._ready_to_run()
        for each in self._data.validation:
            x, failed = run(each.record)
            if failed >= 0:
                return np.inf
            errors.append(
                ((self._outputs(each.record, x) - each.y) / self._data.spread)[each.scored_from :]
            )
        return float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2)))

    @property
    def _default_callbacks(self):
        return [
            ("epoch_timer", EpochTimer()),
            ("train_loss", PassthroughScoring(name="train_loss", on_train=True)),
            ("valid_loss", PassthroughScoring(name="valid_loss")),
            ("decay", CosineDecay()),
            ("free_run", BestFreeRun(self.n_iter_no_change)),
            ("print_log", PrintLog()),
        ]

    def initialize_module(self) -> Self:
        """Create the network, once its size is known from the data."""
        if not hasattr(self, "model_"):
            raise ValueError(
                f"{type(self).__name__} learns its size from the data. Remedy: call fit first."
            )
        if self.model_ is None:
            X, y = getattr(self, "_rows", (np.zeros((1, self.n_features_in_)), None))
            y = np.zeros((1, self._n_outputs)) if y is None else y
            self._n_outputs = y.shape[1]
            core = self._make_core(X.shape[1], self._n_outputs)
            self.module_ = RowNetwork(core, X, y).double()
        else:
            core = self._make_core(len(self.step_.mean), self.step_.n_network_outputs)
            n_free = len(self._free_names + self._balance_names)
            self.module_ = StepNetwork(core, self.step_, {}, n_free).double()
        return self

    def _make_core(self, n_inputs, n_outputs):
        if isinstance(self.module, nn.Module):
            return copy.deepcopy(self.module)
        sizes = {"n_inputs": n_inputs, "n_outputs": n_outputs}
        return self.initialized_instance(self.module, {**sizes, **self.get_params_for("module")})

    def get_iterator(self, dataset: Any, training: bool = False) -> Any:
        """Return batches of `batch_size` steps, whatever the length of the windows."""
        phase, whole = self._phase, self.batch_size
        if phase is None or phase.horizon == 1 or whole == -1:
            return super().get_iterator(dataset, training)
        self.batch_size = max(1, whole // phase.horizon)
        try:
            return super().get_iterator(dataset, training)
        finally:
            self.batch_size = whole

    def get_loss(self, y_pred: Any, y_true: Any, X: Table = None, training: bool = False) -> Any:
        r"""Return the loss, :math:`(1 - \lambda_{phy})\,L_{error} + \lambda_{phy}\,L_{phy}`.

        `y_pred` are states of windows, or targets of rows; `y_true` are states (single steps),
        outputs (rollouts) or targets (rows), and `X` the windows.
        """
        y_true = to_tensor(y_true, device=self.device)
        if self._phase is None:
            scale = self.module_.scale_y
            return super().get_loss(y_pred / scale, y_true / scale, X, training)
        X = to_tensor(X, device=self.device)
        error = self._error_loss(y_pred, y_true, X)
        if not torch.isfinite(error):
            weights = nn.utils.parameters_to_vector(self.module_.core.parameters())
            raise NotFinite(_why_not_finite(error, weights, self._phase.horizon))
        if training and self._overlap is not None and self.overlap:
            share = (self._overlap(self.module_.core) ** 2).sum()
            error = error + self.overlap * error.detach() * share
        if self.lambda_phy == 0:
            return error
        states = torch.cat([X["x"][:, :1], y_pred], dim=1)
        physics = self._physics(states, X["u"], X["t"], self._tuned())
        if training and self.lambda_phy == ADAPTIVE:
            weights = list(self.module_.core.parameters())
            before = self.lambda_phy_ or None
            self.lambda_phy_ = balanced_lambda(error, physics, weights, before)
        return (1 - self.lambda_phy_) * error + self.lambda_phy_ * physics

    def _error_loss(self, y_pred, y_true, X):
        """Compare states if the measured ones are fed back, outputs if the predicted ones are."""
        if self.module_.teacher_forcing:
            own = torch.as_tensor(corrected_states(self.model_, self.structure_))
            compared = y_pred.index_select(-1, own.to(y_pred.device))
        else:  # an output may depend on the inputs that act at the end of every step
            after = X["index"].cpu().numpy() + 1
            acting = self.module_.samples["acting"][after, : len(self.model_.inputs)]
            u = torch.as_tensor(acting.reshape(*after.shape, -1), device=X["t"].device)
            compared = outputs_of(self.model_, y_pred, u, X["t"][:, 1:], self._tuned())
        compared, y_true = compared / self._phase.scale, y_true / self._phase.scale
        seen = torch.isfinite(y_true)
        if not seen.any():
            return 0.0 * y_pred.sum()
        if not seen.all():
            compared, y_true = compared[seen], y_true[seen]
        return super().get_loss(compared, y_true, X)

    def __getstate__(self):
        state = {name: part for name, part in self.__dict__.items() if name not in _TRAINED}
        state |= {"_phase": None, "_data": None}  # of a training that is going on
        if self.initialized_:
            weights = self.module_.state_dict()
            state["_weights"] = {name: part.cpu().numpy() for name, part in weights.items()}
        return state

    def __setstate__(self, state):
        weights = state.pop("_weights", None)
        self.__dict__.update(state)
        if weights is not None:
            if self.device is not None:  # skorch warns where it is missing here
                self.device = self._check_device(self.device, get_map_location(self.device))
            history, self.history_ = self.history_, None
            with own_random_numbers():
                self.initialize()
            self.history_ = history
            tensors = {name: torch.tensor(part) for name, part in weights.items()}
            self.module_.load_state_dict(tensors)

    def _outputs(self, ready, x) -> np.ndarray:
        u = ready.acting[:, : len(self.model_.inputs)]
        x, u, t = (torch.as_tensor(part) for part in (x, u, ready.t))
        known = {} if self._free is None else self._free.values(self._changes())
        with torch.no_grad():
            return outputs_of(self.model_, x, u, t, known).numpy()


def _why_not_finite(error, weights, steps: int) -> str:
    if not torch.isfinite(weights).all():
        return (
            "the network's weights are not finite: a step was too large, or a term of physics_loss "
            "has no finite gradient. Remedy: a smaller lr; keep that term away from roots and "
            "divisions at 0."
        )
    if steps == 1:
        return (
            f"the error of a single step is {error.item()}, though the network's weights are "
            f"finite. Remedy: a model whose equations are finite at every measured state, without "
            f"a root or a logarithm of what may be negative; or a smaller lr."
        )
    return (
        f"the error of the prediction is {error.item()}. Remedy: a smaller lr, or a shorter "
        f"horizon."
    )


def _warn_of_lost(objective: SimulationObjective, theta) -> None:
    """Warn if runs or slopes that are not finite kept the last phase from making a step."""
    parts = objective.parts(theta)[: len(objective.records)]
    lost = sum(not part.is_finite for part in parts)
    if lost:
        warn_user(
            f"in {lost} of {len(parts)} training trajectories the network's free run, or its "
            f"gradient, is not finite; the last training phase is skipped. Remedy: rollouts "
            f"(horizon=50), structure='correction' or 'increment', more epochs, or shorter "
            f"trajectories.",
            SimulationWarning,
        )
