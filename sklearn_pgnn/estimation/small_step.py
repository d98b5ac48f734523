"""How far a parameter is moved to see how the outputs depend on it."""

import numpy as np

from sklearn_pgnn.estimation.budgets import SMALL_CHANGE
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows


def small_step(windows: ShootingWindows, fit: WindowFit, place: int) -> float:
    r"""Return the step of a parameter that changes the outputs by a small part of the noise.

    .. math:: h = c \left/ \sqrt{\tfrac{1}{N} \sum_k |\partial y_k / \partial \theta|^2} \right.

    with the outputs in units of the noise and :math:`c` the `SMALL_CHANGE`: it does not depend on
    the parameter's unit.
    """
    steep = np.sqrt(fit.evaluation.gram[:, place, place].sum() / windows.lengths.sum())
    return SMALL_CHANGE / steep if steep > 0 else SMALL_CHANGE * fit.freedoms[place].scale
