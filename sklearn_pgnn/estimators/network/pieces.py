"""A trained network run along short pieces of a trajectory, very many times.

A filter runs a network from many states by single steps. What these runs have in common, the
weights in the order of the loop and the outputs as functions, is prepared once.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from torch import nn

from sklearn_pgnn.estimators.network.free_run import ready_to_run
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import NetworkRecord, NetworkStep
from sklearn_pgnn.simulation.pointwise import numpy_function


class PieceRuns:
    """The runs of a trained network along pieces of trajectories."""

    def __init__(self, core: nn.Module, step: NetworkStep):
        self._run, self._outputs = ready_to_run(core, step), output_function(step.model)
        self._n_inputs = len(step.model.inputs)

    def along(self, ready: NetworkRecord, kept: np.ndarray) -> Callable:
        """Return the run along one trajectory, between two of its own samples."""
        return partial(self._piece, ready, kept)

    def _piece(self, ready, kept, a, b, x):
        piece = ready.piece(kept[a], kept[b] + 1, x)
        states = self._run(piece)[0]
        own = kept[a : b + 1] - kept[a]
        x, t, u = states[own], piece.t[own], piece.acting[own, : self._n_inputs]
        return x, np.array(np.broadcast_arrays(*self._outputs(t, *x.T, *u.T), t)[:-1]).T


def output_function(model: PhysicsModel) -> Callable:
    """Return the outputs as a function of time, states and inputs."""
    fixed = {symbol(name): parameter.value for name, parameter in model.parameters.items()}
    outputs = [output.xreplace(fixed) for output in model.outputs.values()]
    return numpy_function(["t", *model.states, *model.inputs], outputs)
