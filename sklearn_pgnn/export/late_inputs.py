r"""Late inputs on a clock of equal steps: each a mean of two past samples.

With the delay :math:`\tau = (n + w)\,\Delta t`, :math:`0 \le w < 1`, an input acts as

.. math:: (1 - w)\,u_{k-n} + w\,u_{k-n-1}

at sample k: its mean over the interval where it is held, its value where it runs straight.
"""

from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class LateInput:
    """An input that acts late.

    Parameters
    ----------
    name : str
        The input.
    place : int
        Where it stands among the inputs.
    samples : int
        Whole samples :math:`n` by which it is late.
    share : float
        Rest :math:`w` of its delay, as a share of the sample interval.
    """

    name: str
    place: int
    samples: int
    share: float


def late_inputs(model: PhysicsModel, interval: float) -> list[LateInput]:
    """Return the inputs of a model that act late.

    Parameters
    ----------
    model : PhysicsModel
        The model, whose delays count at their values.
    interval : float
        Sample interval [s].

    Returns
    -------
    list of LateInput
        They, in the order of the model's delays.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import InputDelay
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> late_inputs(cart_on_spring() + InputDelay("force", delay=0.625), 0.25)
    [LateInput(name='force', place=0, samples=2, share=0.5)]
    """
    found = []
    for name, delay in model.delays.items():
        samples = model.parameters[delay].value / interval
        whole = int(np.floor(samples))
        place = list(model.inputs).index(name)
        found.append(LateInput(name, place, whole, float(samples - whole)))
    return found
