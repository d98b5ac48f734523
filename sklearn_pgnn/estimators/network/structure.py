r"""From records to the step of a network to train: its structure, what it sees, its scale.

- ``output``: :math:`x_{k+1} = n(u_k, x_k, \ldots)`
- ``increment``: :math:`x_{k+1} = x_k + \Delta t\, n(u_k, x_k, \ldots)`
- ``correction``: :math:`x_{k+1} = \Phi(x_k, u_k) + \Delta t\, n(u_k, x_k, \ldots)`, where only
  rates that are not just another state are corrected; positions follow by half the squared step.
- ``dissipative``: :math:`x_{k+1} = \Phi(x_k, u_k) + \delta_n(\Phi(x_k, u_k), u_k, \ldots)`, where
  :math:`\delta_n` only takes energy out, see `sklearn_pgnn.simulation.dissipation`.
"""

from dataclasses import replace

import numpy as np

from sklearn_pgnn.estimators.network.records import TrainingRecord, TrainingWindows, spread_of
from sklearn_pgnn.estimators.simulated_predictions import one_simulation_warning
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.dissipation import Dissipation, energy_slopes
from sklearn_pgnn.simulation.network_run import (
    FreeRun,
    NetworkStep,
    energy_values,
    names_in_terms,
)
from sklearn_pgnn.simulation.record_windows import dominant_period
from sklearn_pgnn.simulation.simulate import simulate
from sklearn_pgnn.trajectories.measured import of_measured

STRUCTURES = ("output", "increment", "correction", "dissipative")
#: structures that build on the model's own step
ON_THE_MODEL = ("correction", "dissipative")
#: the base that the network's output is added to
BASE_OF = {
    "output": "constant", "increment": "state", "correction": "prior", "dissipative": "prior",
}  # fmt: skip
#: share of the largest eigenvalue of an energy's Hessian that counts as rounding
CURVATURE_ROUNDING = 1e-9
#: share of the squared change of the states that a model worth a correction leaves, at most
FORETOLD = 0.5
#: share of the dominant period of the outputs over which the model is compared with persistence
TRIAL_SHARE = 0.1
#: number of windows in which the model is compared with persistence
TRIALS = 200
#: a state this many standard deviations away from its mean has diverged
REACH = 1e3
#: scale of a feature that the network must not see: divided by it, the feature vanishes
UNSEEN = 1e30


def corrected_states(model: PhysicsModel, structure: str) -> list[int]:
    """Return the states that have a network output of their own."""
    positions = set(model.slope_pairs.values()) if structure in ON_THE_MODEL else set()
    return [i for i, state in enumerate(model.states) if state not in positions]


def gain_of(model: PhysicsModel, structure: str, x, x_next, prior, dt, corrects=None) -> np.ndarray:
    """Scale the network's outputs by what they have to explain, in every step of the training.

    Return the matrices that multiply 1, the step and its square, (3, n_states, n_outputs).
    """
    states = list(model.states)
    own = corrected_states(model, structure)
    if corrects is not None:
        own = [i for i in own if states[i] in corrects]
    gain = np.zeros((3, len(states), len(own)))
    if structure == "output":
        size = np.std(x_next, axis=0)
    else:
        base = x if structure == "increment" else prior
        size = np.sqrt(np.mean(((x_next - base) / dt[:, None]) ** 2, axis=0))
    size = np.where(size > 0, size, 1.0)
    power = 0 if structure == "output" else 1
    pairs = model.slope_pairs if structure == "correction" else {}
    for column, i in enumerate(own):
        gain[power, i, column] = size[i]
        position = pairs.get(states[i])
        if position is not None:
            gain[2, states.index(position), column] = size[i] / 2
    return gain


def lossy_states(model: PhysicsModel, corrects=None, free=()) -> tuple[str, ...]:
    """Return the states that a network can take energy out of, positions never.

    The energy must be quadratic in them together, and depend on them by no `free` parameter.
    """
    what, stored = "structure='dissipative'", model.energy.get("stored")
    if stored is None:
        raise ValueError(
            f"{what}: the energy of {model.name!r} is not known: expected the model's 'energy' "
            f"with 'stored', got {', '.join(model.energy) or 'nothing'}. Remedy: give the model "
            f"its energy, or structure='correction'."
        )
    own = [list(model.states)[i] for i in corrected_states(model, "dissipative")]
    states = tuple(
        name for name in own
        if (stored.has(symbol(name)) if corrects is None else name in corrects)
    )  # fmt: skip
    unknown = [name for name in states if not stored.has(symbol(name))]
    if unknown or not states:
        raise ValueError(
            f"{what}: expected states that the stored energy {stored} depends on, besides "
            f"positions, got {', '.join(unknown) or 'none'}. Remedy: name others in 'corrects', "
            f"complete the model's 'energy', or structure='correction'."
        )
    parts = energy_slopes(model, states)
    held = {str(each) for part in parts for each in part.free_symbols}
    bent = {str(each) for part in parts[len(states) :] for each in part.free_symbols}
    if bent & set(states):
        raise ValueError(
            f"{what}: expected an energy that is quadratic in {', '.join(states)}, got {stored}. "
            f"Remedy: name fewer states in 'corrects', or structure='correction'."
        )
    if held & set(free):
        raise ValueError(
            f"{what} with free={sorted(held & set(free))}: what the network may take out is "
            f"measured by the energy, which these parameters would change. Remedy: leave them out "
            f"of 'free', or structure='correction'."
        )
    return states


def dissipation_of(model: PhysicsModel, states, samples, x_next, prior) -> Dissipation:
    """Scale what a network takes out of some states by the model's error in them."""
    parts = energy_values(model, states, samples["t"], prior, samples["acting"])[0]
    m, places = len(states), [list(model.states).index(name) for name in states]
    eigenvalues = np.linalg.eigvalsh(parts[:, m:].reshape(-1, m, m))
    if eigenvalues.min() < -CURVATURE_ROUNDING * np.abs(eigenvalues).max():
        raise ValueError(
            f"structure='dissipative': expected an energy that no motion of {', '.join(states)} "
            f"makes negative, got {model.energy['stored']}. Remedy: correct the model's 'energy', "
            f"or name fewer states in 'corrects'."
        )
    left = ((x_next - prior) / samples["dt"][:, None])[:, places]
    size, slope = (np.sqrt(np.mean(each**2, axis=0)) for each in (left, parts[:, :m]))
    return Dissipation(states, np.sqrt(size / np.where(slope > 0, slope, 1.0)))


def choose_structure(measured, foretold, begun) -> str:
    """Choose a correction where the model foretells the states better than persistence by far."""
    by_model = np.mean((measured - foretold) ** 2, axis=0)
    by_persistence = np.mean((measured - begun) ** 2, axis=0)
    moves = by_persistence > 0
    share = np.mean(by_model[moves] / by_persistence[moves]) if moves.any() else 0.0
    return "correction" if share < FORETOLD else "increment"


@one_simulation_warning()
def find_structure(model: PhysicsModel, records, states, **options) -> str:
    """Compare the model with persistence, a tenth of the outputs' dominant period ahead."""
    ahead = TRIAL_SHARE * dominant_period(records)
    count = max(1, TRIALS // len(records))
    trials = []
    for record, x in zip(records, states, strict=True):
        length = int(np.clip(round(ahead / np.median(np.diff(record.t))), 1, len(x) - 1))
        starts = np.linspace(0, len(x) - 1 - length, count).astype(int)
        for k in np.unique(starts):
            rows = slice(k, k + length + 1)
            run = simulate(model, record.t[rows], record.u[rows], x[k], **options)
            if run.success:
                trials.append((x[k + length], run.x[-1], x[k]))
    return choose_structure(*np.swapaxes(trials, 0, 1)) if trials else "increment"


def check_structure(structure: str, guide, has_model: bool) -> None:
    """Refuse a structure or a guide that is invalid, or that lacks the model it needs."""
    if structure not in ("auto", *STRUCTURES):
        raise ValueError(
            f"structure: expected 'auto' or one of {', '.join(STRUCTURES)}, got {structure!r}."
        )
    if guide not in ("auto", "simulation", "step", "terms", None):
        raise ValueError(
            f"guide: expected 'auto', 'simulation', 'step', 'terms' or None, got {guide!r}."
        )
    if not has_model and (structure in ON_THE_MODEL or guide not in ("auto", None)):
        what = f"structure={structure!r}" if structure in ON_THE_MODEL else f"guide={guide!r}"
        raise ValueError(f"{what} needs a model, got none. Remedy: give model=.")
    if structure == "dissipative" and guide == "step":
        raise ValueError(
            "guide='step' cannot be combined with structure='dissipative', whose network sees the "
            "end of the model's step. Remedy: guide='terms' or guide=None."
        )


def check_features(model: PhysicsModel, structure, guide, corrects, sees, further=()) -> None:
    """Refuse quantities that a network cannot correct or see, `further` columns among them."""
    own = [list(model.states)[i] for i in corrected_states(model, structure)]
    _check_names("corrects", corrects, own)
    _check_names("sees", sees, (*model.states, *model.inputs, *further))
    if corrects is not None and structure not in ON_THE_MODEL:
        raise ValueError(
            f"corrects={corrects!r} needs structure='correction' or 'dissipative', got "
            f"{structure!r}: any other network has an output for every state. Remedy: "
            f"structure='correction', or corrects=None."
        )
    if sees is not None and guide in ("simulation", "step"):
        raise ValueError(
            f"sees={sees!r} cannot be combined with guide={guide!r}, which depends on all "
            f"quantities. Remedy: guide='terms' or guide=None."
        )


def _check_names(name, given, expected) -> None:
    if given is None:
        return
    if isinstance(given, str) or not list(given) or not set(given) <= set(expected):
        raise ValueError(
            f"{name}: expected a list of names among {', '.join(map(str, expected))}, "
            f"got {given!r}."
        )


def feature_scale(model: PhysicsModel, guide, scale, sees, further) -> np.ndarray:
    """Return the divisors of the features, so large for features not seen that 0 is left."""
    if sees is None:
        return scale
    names = [{name} for name in (*model.states, *model.inputs)]
    names += names_in_terms(model) if guide == "terms" else []
    names += [{name} for name in further]
    return np.where([each <= set(sees) for each in names], scale, UNSEEN)


def make_step(
    model: PhysicsModel,
    windows: TrainingWindows,
    structure: str,
    guide,
    *,
    hold: str,
    substeps: int,
    corrects=None,
    sees=None,
    further=(),
    middle=False,
) -> NetworkStep:
    """Scale the inputs and outputs of the network by the training data, still without a core."""
    now = windows.pairs
    after, dt = now + 1, windows.samples["dt"][now]
    x, prior = windows.x[now], windows.prior[now]
    z = windows.features_of(guide, now)
    mean, spread = x.mean(axis=0), spread_of(x)
    if structure == "dissipative":
        here = {name: part[now] for name, part in windows.samples.items()}
        states = lossy_states(model, corrects)
        loss = dissipation_of(model, states, here, windows.x[after], prior)
        gain = np.zeros((3, x.shape[1], loss.n_outputs))
    else:
        loss, gain = None, gain_of(model, structure, x, windows.x[after], prior, dt, corrects)
    return NetworkStep(
        model,
        BASE_OF[structure],
        guide,
        windows.x[after].mean(axis=0),
        gain,
        z.mean(axis=0),
        feature_scale(model, guide, spread_of(z), sees, further),
        mean + REACH * np.array([[-1.0], [1.0]]) * spread,
        substeps=substeps,
        hold=hold,
        spread=spread_of(windows.seen[now]),
        middle=middle,
        loss=loss,
    )


def base_error(step: NetworkStep, records: list[TrainingRecord], outputs, length: int | None):
    """Measure the base's RMS error, restarted from measured states after `length` steps."""
    n_in, n_out = len(step.mean), step.n_network_outputs
    idle = replace(step, sizes=(n_in, n_out), loss=None)
    run = FreeRun(idle, np.zeros((n_in + 1) * n_out))
    squares = []
    for each in records:
        count = len(each.x) - 1
        for k in range(0, count, length or count):
            end = min(k + (length or count), count) + 1
            piece = each.record.piece(k, end, each.x[k] if k else None)
            x = run(piece)[0]
            squares.append((outputs(piece, x) - each.y[k : k + len(x)])[1:] ** 2)
    error = np.sqrt(of_measured(np.nanmean, np.concatenate(squares)))
    return np.where(error > 0, error, 1.0)
