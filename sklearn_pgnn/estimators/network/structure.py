r"""The structures of a network's step, and the choice between them.

- ``output``: :math:`x_{k+1} = n(u_k, x_k, \ldots)`
- ``increment``: :math:`x_{k+1} = x_k + \Delta t\, n(u_k, x_k, \ldots)`
- ``correction``: :math:`x_{k+1} = \Phi(x_k, u_k) + \Delta t\, n(u_k, x_k, \ldots)`, where only
  rates that are not just another state are corrected; positions follow by half the squared step.
- ``dissipative``: :math:`x_{k+1} = \Phi(x_k, u_k) + \delta_n(\Phi(x_k, u_k), u_k, \ldots)`, where
  :math:`\delta_n` only takes energy out, see `sklearn_pgnn.simulation.dissipation`.
"""

import numpy as np

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.dissipation import Dissipation, energy_slopes
from sklearn_pgnn.simulation.network_run import energy_values

STRUCTURES = ("output", "increment", "correction", "dissipative")
#: structures that build on the model's own step
ON_THE_MODEL = ("correction", "dissipative")
_BASES = {
    "output": "constant", "increment": "state", "correction": "prior", "dissipative": "prior",
}  # fmt: skip
#: share of the largest eigenvalue of an energy's Hessian that counts as rounding
CURVATURE_ROUNDING = 1e-9
#: share of the squared change of the states that a model worth a correction leaves, at most
FORETOLD = 0.5
#: share of the dominant period of the outputs over which the model is compared with persistence
TRIAL_SHARE = 0.1


def base_of(structure: str) -> str:
    """Return the base that the network's output is added to."""
    return _BASES[structure]


def corrected_states(model: PhysicsModel, structure: str) -> list[int]:
    """Return the states that have a network output of their own."""
    positions = set(model.slope_pairs.values()) if structure in ON_THE_MODEL else set()
    return [i for i, state in enumerate(model.states) if state not in positions]


def gain_of(model: PhysicsModel, structure: str, x, x_next, prior, dt, corrects=None) -> np.ndarray:
    """Scale the network's outputs by the quantities that they have to explain.

    `x` and `x_next` are measured states at both ends of every step, and `prior` the model's step
    from these, of shape (n, n_states); `dt` are the steps [s], and `corrects` the only states whose
    rates are corrected. Return matrices that multiply 1, the step and its square, of shape (3,
    n_states, n_outputs).
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
    """Return the states that a network can take energy out of.

    `corrects` are the only states to consider, by default all that the stored energy depends on,
    except positions. The energy must be quadratic in them together, and depend on them by no
    parameter that is trained, one of `free`.
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
    """Scale what a network takes out of some states by the model's error in them.

    `samples` has time ``t``, step ``dt`` and acting inputs ``acting`` of every step; `x_next` and
    `prior`, of shape (n, n_states), are the measured states at its end, and those of the model's
    step. An energy that grows less than linearly along some direction of the states raises
    `ValueError`.
    """
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
    """Choose a correction where the model predicts most of the change of the states.

    All have shape (n, n_states): `measured` states at the end of several short windows, those that
    the model predicts from the measured ones at the beginning, and these. The structure is a
    correction where, over the states, the mean of the squared error as a share of persistence's is
    below `FORETOLD`, else an increment.
    """
    by_model = np.mean((measured - foretold) ** 2, axis=0)
    by_persistence = np.mean((measured - begun) ** 2, axis=0)
    moves = by_persistence > 0
    share = np.mean(by_model[moves] / by_persistence[moves]) if moves.any() else 0.0
    return "correction" if share < FORETOLD else "increment"
