r"""What a network takes out of the states of a model, whatever its weights: never a gain of energy.

The slopes :math:`e = \partial E/\partial x` of the stored energy by some states and its Hessian
:math:`H` by them make the resistive part of a port-Hamiltonian system [1]_,
:math:`\dot x = -R\,e` with :math:`R = L L^T \ge 0`, so that
:math:`\dot E = -e^T R\,e \le 0`. After the model's own step it acts implicitly,

.. math:: \delta = -\Delta t\,R\,(e + H \delta)
          = -\Delta t\,L\,(1 + \Delta t\,L^T H L)^{-1} L^T e,

so that the same holds for a step of any length: with :math:`f = e + H \delta`, of an energy that
is quadratic in these states and :math:`H \ge 0`,

.. math:: E(x + \delta) - E(x) = -\Delta t\,f^T R f - \tfrac{1}{2} \delta^T H \delta \le 0.

References
----------
.. [1] A. van der Schaft, D. Jeltsema, "Port-Hamiltonian Systems Theory: An Introductory Overview",
   Foundations and Trends in Systems and Control 1(2-3), 2014, :doi:`10.1561/2600000002`.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class Dissipation:
    """The states that a network takes energy out of.

    The network's outputs are the entries of a lower triangle, row by row; with 1 added to those of
    the diagonal they are `root` times L.

    `root`, of shape (n_lossy,), is what every row of L is measured in.
    """

    states: tuple[str, ...]
    root: np.ndarray

    @property
    def n_outputs(self) -> int:
        """Number of entries of the lower triangle."""
        return len(self.states) * (len(self.states) + 1) // 2


def energy_slopes(model: PhysicsModel, states: tuple[str, ...]) -> list[sympy.Expr]:
    """Return the slopes of the stored energy by some states, then its Hessian, row by row.

    >>> cart = PhysicsModel({"x": "m", "v": "m/s"}, {"x": "v", "v": "-k*x/m"},
    ...                     {"m": 2.0, "k": 8.0}, energy={"stored": "m*v**2/2 + k*x**2/2"})
    >>> energy_slopes(cart, ("v",))
    [m*v, m]
    """
    by = [symbol(name) for name in states]
    slopes = [sympy.diff(model.energy["stored"], each) for each in by]
    return slopes + [sympy.diff(slope, each) for slope in slopes for each in by]


@lru_cache(maxsize=64)
def energy_model(model: PhysicsModel, states: tuple[str, ...]) -> PhysicsModel:
    """Return a model whose outputs are the energy's slopes and Hessian, with all rates zero."""
    parts = energy_slopes(model, states)
    return model.replace(
        equations=dict.fromkeys(model.states, 0),
        outputs={f"part{i}": part for i, part in enumerate(parts)},
        columns={},
    )
