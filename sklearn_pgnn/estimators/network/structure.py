r"""The structures of a network's step, and the choice between them.

- ``output``: :math:`x_{k+1} = n(u_k, x_k, \ldots)`
- ``increment``: :math:`x_{k+1} = x_k + \Delta t\, n(u_k, x_k, \ldots)`
- ``correction``: :math:`x_{k+1} = \Phi(x_k, u_k) + \Delta t\, n(u_k, x_k, \ldots)`, where only
  rates that are not just another state are corrected; a position moves by half a step's square.
"""

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel

STRUCTURES = ("output", "increment", "correction")
_BASES = {"output": "constant", "increment": "state", "correction": "prior"}
#: share of the squared change of the states that a model worth a correction leaves, at most
FORETOLD = 0.5
#: share of the dominant period of the outputs over which the model is compared with persistence
TRIAL_SHARE = 0.1


def base_of(structure: str) -> str:
    """Return what the network's output is added to."""
    return _BASES[structure]


def corrected_states(model: PhysicsModel, structure: str) -> list[int]:
    """Return the states that have a network output of their own.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    structure : {"output", "increment", "correction"}
        What the output means.

    Returns
    -------
    list of int
        Their places.
    """
    positions = set(model.slope_pairs.values()) if structure == "correction" else set()
    return [i for i, state in enumerate(model.states) if state not in positions]


def gain_of(model: PhysicsModel, structure: str, x, x_next, prior, dt, corrects=None) -> np.ndarray:
    """Scale the network's outputs by what they have to explain.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    structure : {"output", "increment", "correction"}
        What the output means.
    x, x_next : ndarray of shape (n, n_states)
        Measured states at both ends of every step.
    prior : ndarray of shape (n, n_states) or None
        The model's step from the measured states.
    dt : ndarray of shape (n,)
        Steps [s].
    corrects : sequence of str, optional
        The only states whose rates are corrected.

    Returns
    -------
    ndarray of shape (3, n_states, n_outputs)
        Matrices that stand before 1, the step and its square.
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


def choose_structure(measured, foretold, begun) -> str:
    """Choose a correction where the model predicts most of the change of the states.

    Parameters
    ----------
    measured : ndarray of shape (n, n_states)
        Measured states at the end of several short windows.
    foretold : ndarray of shape (n, n_states)
        What the model makes of the measured states at their beginning.
    begun : ndarray of shape (n, n_states)
        The measured states at their beginning.

    Returns
    -------
    {"correction", "increment"}
        The structure: a correction where, over the states, the mean of the squared error as a
        share of persistence's is below `FORETOLD`.
    """
    by_model = np.mean((measured - foretold) ** 2, axis=0)
    by_persistence = np.mean((measured - begun) ** 2, axis=0)
    moves = by_persistence > 0
    share = np.mean(by_model[moves] / by_persistence[moves]) if moves.any() else 0.0
    return "correction" if share < FORETOLD else "increment"
