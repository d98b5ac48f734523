"""What cross-validation hides from a fit: whole trajectories, or blocks of time."""

import numpy as np

from sklearn_pgnn.model_selection.trajectory_rows import deal_in_order

WAYS = ("auto", "trajectory", "time")


def hidden_parts(lengths, n_splits: int, by: str = "auto") -> list[np.ndarray]:
    """Return for every fold which samples are hidden from its fit.

    Parameters
    ----------
    lengths : sequence of int
        Samples of every trajectory; they lie end to end.
    n_splits : int
        Number of folds.
    by : {"auto", "trajectory", "time"}, default="auto"
        Whether whole trajectories are hidden, or in each fold another block of time of every
        trajectory, never the first of its ``n_splits + 1`` blocks, so that its start stays known.
        ``"auto"`` hides trajectories where there are at least ``n_splits``.

    Returns
    -------
    list of ndarray of bool, shape (n_samples,)
        A mask a fold.

    Raises
    ------
    ValueError
        If there are fewer trajectories than folds, or fewer samples than blocks.

    Examples
    --------
    >>> [mask.astype(int).tolist() for mask in hidden_parts([6], 2)]
    [[0, 0, 1, 1, 0, 0], [0, 0, 0, 0, 1, 1]]
    >>> [mask.astype(int).tolist() for mask in hidden_parts([2, 2, 2], 2)]
    [[1, 1, 0, 0, 0, 0], [0, 0, 1, 1, 1, 1]]
    """
    trajectory = np.repeat(np.arange(len(lengths)), lengths)
    if by == "time" or (by == "auto" and len(lengths) < n_splits):
        if min(lengths) <= n_splits:
            raise ValueError(
                f"X: expected more samples in every trajectory than the {n_splits + 1} blocks of "
                f"time, got {min(lengths)}. Remedy: lower n_splits, or leave the trajectory out."
            )
        place = np.concatenate([np.arange(n) * (n_splits + 1) // n for n in lengths])
        return [place == fold for fold in range(1, n_splits + 1)]
    if len(lengths) < n_splits:
        raise ValueError(
            f"n_splits: expected at most one fold a trajectory, got {n_splits} folds and "
            f"{len(lengths)} trajectories. Remedy: by='time', or lower n_splits."
        )
    dealt = deal_in_order(lengths, np.full(n_splits, 1 / n_splits))
    return [np.isin(trajectory, fold) for fold in dealt]
