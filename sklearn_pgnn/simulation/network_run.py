r"""The time loop of a network in feedback, compiled, with the sensitivities to its weights.

One step from sample k to k + 1 is

.. math:: x_{k+1} = b_k + \left(A_0 + \Delta t\,A_1 + \Delta t^2 A_2\right) n(z_k; \theta)

with the base :math:`b_k` a constant, the state :math:`x_k`, or the model's own step
:math:`\Phi(x_k, u_k)`, and the standardised features :math:`z_k` of state, input, guide and further
columns. The guide is nothing, the model's open-loop simulation at k + 1, the rate
:math:`(\Phi(x_k, u_k) - x_k)/\Delta t`, or the terms that the model's rates are sums of. In place
of the matrices the network may take energy out, see `sklearn_pgnn.simulation.dissipation`. The
sensitivities :math:`S = \partial x/\partial\theta` follow the same loop.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.expressions import expanded, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.dissipation import Dissipation, energy_model
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.network_loop import run, run_prior_steps, run_terms
from sklearn_pgnn.simulation.simulate import parameter_values

BASES = ("constant", "state", "prior")
GUIDES = (None, "simulation", "step", "terms")
#: shares of a velocity's spread over which the jump of dry friction is seen rounded off
WIDTHS = (0.1, 0.03, 0.01)
CORES = ("feed-forward", "recurrent")
ACTIVATIONS = ("tanh", "relu", "silu", "sigmoid", "identity")


@dataclass(frozen=True)
class NetworkStep:
    """The definition of a network's step, besides its weights.

    The network's output is added to the base, ``"constant"``, ``"state"`` or ``"prior"``; what the
    network sees of the model is its guide, None, ``"simulation"``, ``"step"`` or ``"terms"``.
    `offset`, of shape (n_states,), is the constant base; `gain`, (3, n_states, n_network_outputs),
    are the matrices that multiply 1, the step [s] and its square; `mean` and `scale`,
    (n_network_inputs,), standardise the features; states below the first or above the second row of
    `reach`, (2, n_states), count as diverged. `sizes` are the widths of all layers, from the
    features to the outputs.

    `spread`, of shape (n_states,), are the states' standard deviations for the terms that guide, by
    default from `scale`. These are the terms of `guide_model`, by default `model`, unless that was
    tuned since. `free` names parameters of the model whose relative changes follow the weights.
    With `middle` the network sees the state in the middle of the model's own step, not at its
    start: its contribution is then accurate to second order in the step. With `loss` it takes
    energy out of some states, at the end of the model's own step, instead of adding its output to
    them.
    """

    model: PhysicsModel
    base: str
    guide: str | None
    offset: np.ndarray
    gain: np.ndarray
    mean: np.ndarray
    scale: np.ndarray
    reach: np.ndarray
    sizes: tuple[int, ...] = ()
    core: str = "feed-forward"
    activation: str = "tanh"
    substeps: int = 1
    hold: str = "zoh"
    spread: np.ndarray | None = None
    guide_model: PhysicsModel | None = None
    free: tuple[str, ...] = ()
    middle: bool = False
    loss: Dissipation | None = None

    @property
    def seen_at(self) -> float:
        """Where along the model's step the network sees the state: 0 at its start, 1 at its end."""
        return 1.0 if self.loss else 0.5 * self.middle

    @property
    def terms_from(self) -> PhysicsModel:
        """The model whose terms guide."""
        return self.guide_model or self.model

    @property
    def state_spread(self) -> np.ndarray:
        """Standard deviations of the states."""
        return self.scale[: len(self.model.states)] if self.spread is None else self.spread

    @property
    def needs_prior(self) -> bool:
        """Whether a step simulates the model from the state that is fed back."""
        return self.base == "prior" or self.guide == "step" or self.middle

    @property
    def n_network_outputs(self) -> int:
        """Number of the network's outputs."""
        return self.gain.shape[2]

    def values_at(self, changes) -> dict:
        """Return the free parameters' values after relative changes, of shape (..., n_free)."""
        given = zip(self.free, parameter_units(self.model, self.free), strict=True)
        own = self.model.parameters
        return {name: own[name].value + u * changes[..., i] for i, (name, u) in enumerate(given)}


@dataclass(frozen=True)
class NetworkRecord:
    """One trajectory as the network's loop needs it.

    `acting`, of shape (n_samples, n_inputs + n_delays), are the inputs as they act on the model,
    `u`, (n_samples, n_inputs), as the network sees them, from each sample to the next. `simulated`,
    (n_samples, n_states), is the model's open-loop simulation, without columns where the network is
    not guided by it; `features`, (n_samples, n_features), are further columns. Times are in
    seconds.
    """

    t: np.ndarray
    acting: np.ndarray
    u: np.ndarray
    simulated: np.ndarray
    features: np.ndarray
    x0: np.ndarray

    def piece(self, start: int, end: int, x0=None) -> "NetworkRecord":
        """Return part of the record's samples, from another initial state if one is given."""
        parts = ("t", "acting", "u", "simulated", "features")
        cut = {part: getattr(self, part)[start:end] for part in parts}
        return replace(self, **cut, x0=self.x0 if x0 is None else np.array(x0, dtype=float))


def network_record(model: PhysicsModel, t, u, x0, *, hold="zoh", simulated=None, features=None):
    """Prepare a trajectory for the network's loop, with an open-loop simulation that guides it."""
    n = t.size
    acting = _own(delayed_inputs(model, t, u, hold == "foh"))
    seen = acting[:, : u.shape[1]]
    if hold == "foh":
        seen = (seen + np.vstack([seen[1:], seen[-1:]])) / 2
    none = np.zeros((n, 0))
    return NetworkRecord(
        _own(t),
        acting,
        _own(seen),
        none if simulated is None else _own(simulated),
        none if features is None else _own(features),
        _own(x0),
    )


def samples_of(t: np.ndarray, acting: np.ndarray) -> dict[str, np.ndarray]:
    """Return what the model's own steps need of samples: time, step, inputs at both its ends."""
    return {
        "t": t,
        "dt": np.append(np.diff(t), 0.0),
        "acting": acting,
        "acting_next": np.vstack([acting[1:], acting[-1:]]),
    }


class FreeRun:
    """A network in free run along trajectories, prepared once for many of them.

    `theta` are the network's weights, then the relative changes of the step's free parameters; with
    `differs` the states can be differentiated by these, for a feed-forward core.
    """

    def __init__(self, step: NetworkStep, theta: np.ndarray, differs: bool = False):
        self._step, self._n_theta = step, theta.size
        free = step.free if differs else None
        self._functions, self._settings = _functions_and_settings(step, theta, free)
        self._unit = parameter_units(step.model, step.free)

    def __call__(self, record: NetworkRecord):
        """Return the states, repeated once out of reach, and the first such sample, or -1."""
        n, nx = record.t.size, record.x0.size
        hidden = np.zeros(self._step.sizes[1] if self._step.core == "recurrent" else 0)
        states, none = np.empty((n, nx)), np.zeros((n, nx, 0))
        begun = record.x0.copy(), hidden, none[0], 0, np.arange(n)
        failed = self._run(record, *begun, states, none)
        if failed >= 0:
            states[failed:] = states[failed - 1]
        return states, failed

    def pieces(self, record: NetworkRecord, samples, length: int = 512):
        """Run on, piece by piece, with derivatives; each begins with the last sample before it.

        The states are wanted at `samples`, in increasing order; `length` is samples per piece, not
        counting that first one. Yield a piece's samples, its states, infinite once they have left
        the reach, and their derivatives by the weights and the changes, of shape (n, n_states,
        n_weights + n_free).
        """
        nx, n_theta, place = record.x0.size, self._n_theta, 0
        now = record.x0.copy(), np.zeros(0), np.zeros((nx, n_theta))
        for start in range(0, max(1, len(samples) - 1), length):
            wanted = np.array(samples[start : start + length + 1], dtype=np.int64)
            x, S = np.empty((len(wanted), nx)), np.empty((len(wanted), nx, n_theta))
            self._run(record, *now, place, wanted, x, S)
            S[:, :, n_theta - self._unit.size :] *= self._unit
            yield wanted, x, S
            place = wanted[-1]

    def _run(self, record: NetworkRecord, *where) -> int:
        core, linear_hold = CORES.index(self._step.core), self._step.hold == "foh"
        functions = (each.argument for each in self._functions)  # which are held here
        return run(
            *functions, record.t, record.acting, linear_hold, record.u, record.simulated,
            record.features, *self._settings, core, *where,
        )  # fmt: skip


def parameter_units(model: PhysicsModel, names: tuple[str, ...]) -> np.ndarray:
    """Return the unit of every parameter's relative change: its magnitude, or 1 if it is zero."""
    return np.array([abs(model.parameters[name].value) or 1.0 for name in names])


def prior_steps(model: PhysicsModel, substeps: int, hold: str, t, dt, x, u, u_next, free=()):
    """Simulate many samples of a model by one step each, under inputs that act at both its ends.

    Return the states one step later, and their derivatives by the parameters `free`, then by the
    states, (n_samples, n_states, n_free + n_states).
    """
    function, source = compile_model(model, free)
    x_next = np.array(x, dtype=float, order="C")
    jacobian = np.empty((*x_next.shape, len(free) + x_next.shape[1]))
    run_prior_steps(
        function.argument,
        t,
        dt,
        u,
        u_next if hold == "foh" else u,
        parameter_values(model),
        source.dry,
        substeps,
        source.size,
        x_next,
        jacobian,
    )
    return x_next, jacobian


def term_values(model: PhysicsModel, t, x, u, spread):
    """Evaluate terms of rates, and their derivatives by states, (n_samples, n_terms, n_states)."""
    with_terms = _with_terms(model, tuple(float(value) for value in spread))
    return _output_values(with_terms, len(_seen_terms(model)), t, x, u)


def energy_values(model: PhysicsModel, states: tuple[str, ...], t, x, u):
    """Evaluate the slopes and the Hessian of the stored energy by some states, row by row.

    Return also their derivatives by all states, (n_samples, n_lossy + n_lossy**2, n_states).
    """
    return _output_values(energy_model(model, states), len(states) * (1 + len(states)), t, x, u)


def _output_values(model: PhysicsModel, count: int, t, x, u):
    """Evaluate so many outputs of a model, all or none, with their derivatives by the state."""
    values = np.empty((len(t), count))
    jacobian = np.empty((*values.shape, x.shape[1]))
    if values.size:
        function, source = compile_model(model, ())
        p = parameter_values(model)
        run_terms(function.argument, _own(t), _own(x), _own(u), p, source.size, values, jacobian)
    return values, jacobian


def names_in_terms(model: PhysicsModel) -> list[set[str]]:
    """Return for every term that can guide a network the quantities that stand in it."""
    made_up = {f"spread_of_{name}" for name in model.states}
    return [{str(s) for s in term.free_symbols} - made_up for term in _seen_terms(model)]


@lru_cache(maxsize=64)
def _seen_terms(model: PhysicsModel) -> tuple:
    """Return the terms of a model's rates that are neither a state nor an input.

    A jump of dry friction is seen rounded off, over several shares of the velocity's spread. A
    limit of a whole rate is no term of it but all of it: what the model's own step says already.
    """
    terms, signs = [], {*dry_friction(model).signs, *map(sympy.sign, map(symbol, model.states))}
    for term in model_terms(model):
        jumps = [(each, each.args[0]) for each in term.atoms(sympy.sign) & signs]
        for share in WIDTHS if jumps else WIDTHS[:1]:
            round_off = {each: sympy.tanh(x / (share * _spread(x))) for each, x in jumps}
            terms.append(term.xreplace(round_off))
    limits = sympy.Max, sympy.Min
    return tuple(t for t in terms if not (t.is_Symbol or t.is_number or isinstance(t, limits)))


def _spread(flow) -> sympy.Expr:
    """Return the spread of a state, or that of a difference at most."""
    return sympy.Add(*(symbol(f"spread_of_{x}") for x in flow.free_symbols))


@lru_cache(maxsize=64)
def _with_terms(model: PhysicsModel, spread: tuple[float, ...]) -> PhysicsModel:
    """Return a model whose outputs are the terms, with all rates zero."""
    spreads = [
        Parameter(f"spread_of_{x}", value) for x, value in zip(model.states, spread, strict=True)
    ]
    return model.replace(
        equations=dict.fromkeys(model.states, 0),
        outputs={f"term{i}": term for i, term in enumerate(_seen_terms(model))},
        parameters=[*model.parameters.values(), *spreads],
        columns={},
    )


def terms_model(step: NetworkStep) -> PhysicsModel:
    """Return the model whose outputs are the terms that guide a network."""
    if step.guide != "terms" or not _seen_terms(step.terms_from):
        return step.model
    model = _with_terms(step.terms_from, tuple(float(value) for value in step.state_spread))
    if step.guide_model is None:
        return model
    values = {name: parameter.value for name, parameter in step.model.parameters.items()}
    return model.with_parameters(**values)


def _own(values) -> np.ndarray:
    """Return a contiguous copy of floats, as the compiled loops take it."""
    return np.array(values, dtype=float, order="C")


def _functions_and_settings(step, theta, wrt=None):
    """Return what stands before and behind the trajectory in the arguments of both loops."""
    with_terms = terms_model(step)
    function, source = compile_model(step.model, wrt)
    terms, of_terms = compile_model(with_terms, wrt)
    lossy, root = (step.loss.states, step.loss.root) if step.loss else ((), np.zeros(0))
    energy, of_energy = function, source
    if lossy:
        energy, of_energy = compile_model(energy_model(step.model, lossy), wrt)
    parameters = parameter_values(with_terms)  # the model's own come first
    if step.free:
        theta, changes = np.split(theta, [-len(step.free)])
        places = [list(step.model.parameters).index(name) for name in step.free]
        parameters[places] += parameter_units(step.model, step.free) * changes
    return (function, terms, energy), (
        parameters,
        source.dry,
        step.substeps,
        source.size,
        of_terms.size,
        of_energy.size,
        BASES.index(step.base),
        GUIDES.index(step.guide),
        step.seen_at,
        # copies, for a model that was loaded as a map of its file is read-only
        _own(step.offset),
        _own(step.gain),
        np.array([list(step.model.states).index(name) for name in lossy], dtype=np.int64),
        *(_own(part) for part in (root, step.mean, step.scale, step.reach)),
        np.array(step.sizes, dtype=np.int64),
        ACTIVATIONS.index(step.activation),
        np.ascontiguousarray(theta),
    )


def model_terms(model: PhysicsModel) -> list[sympy.Expr]:
    """Return a model's states, inputs and the terms of its rates, without constant factors."""
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    terms = [symbol(name) for name in (*model.states, *model.inputs)]
    for rate in model.equations.values():
        rate = expanded(rate.xreplace(values), log=False, power_base=False, power_exp=False)
        for addend in sympy.Add.make_args(rate):
            terms.append(addend.as_independent(*addend.free_symbols, as_Add=False)[1])
    return [term for term in dict.fromkeys(terms) if not term.is_zero]
