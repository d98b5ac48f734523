r"""Steps from sample to sample: how many explicit ones code makes, and how delayed inputs act.

With the delay :math:`\tau = (n + w)\,\Delta t`, :math:`0 \le w < 1`, an input acts as

.. math:: (1 - w)\,u_{k-n} + w\,u_{k-n-1}

at sample k: its mean over the interval if it is held, its value if it is linearly interpolated.
"""

import math
from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.fastest import fastest
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.simulate import settled_start, substeps_of
from sklearn_pgnn.simulation.substeps import MAX_SUBSTEPS, STABLE


def explicit_substeps(model: PhysicsModel, substeps: int | None, interval: float | None) -> int:
    """Return the steps as given, else as in the model, else enough to be stable at its start.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 0.01}, {"u": "V"})
    >>> explicit_substeps(lag, None, 0.001), explicit_substeps(lag, None, 0.05)
    (1, 3)
    """
    implicit = "method" in model.simulation
    if (
        substeps is not None
        or interval is None
        or ("substeps" in model.simulation and not implicit)
    ):
        return substeps_of(model, substeps)
    t, u = np.array([0.0, interval]), np.zeros((2, len(model.inputs)))
    x = np.tile(list(settled_start(model, u[0]).values()), (2, 1)).astype(float)
    fast = fastest(model, t, delayed_inputs(model, t, u, False), x, math.inf)
    if fast > STABLE * MAX_SUBSTEPS:
        raise OptionError(
            f"substeps: expected a number, since {model.name!r} is stiff and exported code makes "
            f"explicit steps: about {math.ceil(fast / STABLE)} from sample to sample are stable at "
            f"its initial state. Remedy: give substeps, a shorter interval, or replace the fastest "
            f"states by their steady-state values."
        )
    return max(1, math.ceil(fast / STABLE))


@dataclass(frozen=True)
class LateInput:
    """An input by its place, late by so many whole samples and a share of one."""

    name: str
    place: int
    samples: int
    share: float


def late_inputs(model: PhysicsModel, interval: float) -> list[LateInput]:
    """Return the delayed inputs of a model.

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


def past_names(late: list[LateInput]) -> list[str]:
    """Return the names of the past samples that a step needs.

    >>> past_names([LateInput("force", 0, 1, 0.5)])
    ['force_1_ago', 'force_2_ago']
    """
    return [f"{each.name}_{k + 1}_ago" for each in late for k in range(each.samples + 1)]


def acting_inputs(late: list[LateInput], past, u) -> tuple[list, list]:
    """Return the acting inputs, and the next past samples in the order of `past_names`.

    >>> acting_inputs([LateInput("force", 0, 1, 0.5)], [3.0, 5.0], [1.0])
    ([4.0], [1.0, 3.0])
    """
    acting, kept, first = list(u), [], 0
    for each in late:
        seen = [acting[each.place], *past[first : first + each.samples + 1]]
        first += each.samples + 1
        kept += seen[:-1]
        acting[each.place] = (1 - each.share) * seen[-2] + each.share * seen[-1]
    return acting, kept
