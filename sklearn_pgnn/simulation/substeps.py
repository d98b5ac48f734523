"""How many integration steps from sample to sample are enough."""

from collections.abc import Callable

#: most steps that are tried
MAX_SUBSTEPS = 32


def double_substeps(
    run: Callable[[int], object], is_close: Callable[[object, object], bool], substeps: int = 1
) -> int:
    """Double the substeps until a simulation hardly changes.

    Parameters
    ----------
    run : callable
        Simulates with so many steps from sample to sample.
    is_close : callable
        Whether two simulations, the coarse one first, are as good as the same.
    substeps : int, default=1
        The steps to begin with.

    Returns
    -------
    int
        Steps from sample to sample, at most `MAX_SUBSTEPS`.

    Examples
    --------
    >>> double_substeps(lambda n: (1 + 1 / n) ** n, lambda one, other: abs(one - other) < 0.1)
    8
    """
    coarse = run(substeps)
    while substeps < MAX_SUBSTEPS:
        finer = run(2 * substeps)
        if is_close(coarse, finer):
            return substeps
        substeps, coarse = 2 * substeps, finer
    return substeps
