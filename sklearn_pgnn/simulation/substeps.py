"""How many integration steps from sample to sample are enough."""

import math
from collections.abc import Callable

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.user_line import warn_user

#: most steps that are tried
MAX_SUBSTEPS = 32


def double_substeps(
    run: Callable[[int], object], change: Callable[[object, object], float], substeps: int = 1
) -> int:
    """Double the substeps until a simulation hardly changes.

    Parameters
    ----------
    run : callable
        Simulates with a given number of steps from sample to sample.
    change : callable
        Returns the difference of two simulations, the coarse one first, as a multiple of the
        tolerance; not finite if one of them diverges.
    substeps : int, default=1
        The steps to begin with.

    Returns
    -------
    int
        Steps from sample to sample, at most `MAX_SUBSTEPS`.

    Warns
    -----
    SimulationWarning
        If these are not enough. A simulation that diverges is reported elsewhere.

    Examples
    --------
    >>> double_substeps(lambda n: (1 + 1 / n) ** n, lambda one, other: abs(one - other) / 0.1)
    8
    """
    coarse, changed = run(substeps), math.nan
    while substeps < MAX_SUBSTEPS:
        finer = run(2 * substeps)
        changed = change(coarse, finer)
        if changed < 1.0:
            return substeps
        substeps, coarse = 2 * substeps, finer
    if math.isfinite(changed):
        warn_user(
            f"the simulation still changes with {MAX_SUBSTEPS} integration steps from sample to "
            f"sample, the largest number tried: the model has dynamics much faster than the "
            f"sampling. Remedy: replace the fastest states by their steady-state values, sample "
            f"faster, or set substeps.",
            SimulationWarning,
        )
    return substeps
