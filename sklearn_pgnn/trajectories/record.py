"""A record: one trajectory of a machine, as measured."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Record:
    """One trajectory.

    Parameters
    ----------
    t : ndarray of shape (n_samples,)
        Time [s], increasing.
    u : ndarray of shape (n_samples, n_inputs)
        Inputs.
    y : ndarray of shape (n_samples, n_outputs) or None
        Measured outputs, NaN where there is no value; None if only inputs are known.
    x0 : ndarray of shape (n_states,)
        Initial state, NaN where unknown.
    name : str
        Name of the trajectory.
    rows : ndarray of shape (n_samples,)
        Row numbers of its samples in the original table.
    origin : float, default=0
        Offset subtracted from the table's clock [s], which showed ``origin + t``.
    """

    t: np.ndarray
    u: np.ndarray
    y: np.ndarray | None
    x0: np.ndarray
    name: str
    rows: np.ndarray
    origin: float = 0.0

    @property
    def is_measured(self) -> bool:
        """Whether any output was measured."""
        return self.y is not None and bool(np.isfinite(self.y).any())
