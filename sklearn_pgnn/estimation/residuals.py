"""The residuals of a hypothesis, as the statistics that a comparison needs."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class Residuals:
    """The residuals of a hypothesis by output, as the statistics that a comparison needs.

    Parameters
    ----------
    squares : ndarray of shape (n_outputs,)
        Sums of squared residuals; infinite where a simulation becomes non-finite.
    counts : ndarray of shape (n_outputs,)
        Number of residuals.
    times : ndarray of shape (n_outputs,)
        Their integrated autocorrelation time, in samples.
    errors : ndarray of shape (n_samples, n_outputs), optional
        The residuals, NaN where nothing was measured.
    segment : ndarray of shape (n_samples,), optional
        Number of the segment in which each sample was simulated, counted from 0; -1 if in none.

    Examples
    --------
    >>> left = Residuals(np.array([120.0]), np.array([100.0]), times=np.array([1.0]))
    >>> np.sqrt(left.squares / left.counts).round(2)  # times the noise
    array([1.1])
    """

    squares: np.ndarray
    counts: np.ndarray
    times: np.ndarray
    errors: np.ndarray | None = None
    segment: np.ndarray | None = None

    def of(self, outputs: np.ndarray) -> "Residuals":
        """Return the residuals of some outputs.

        Parameters
        ----------
        outputs : ndarray of shape (n_outputs,)
            Whether an output is one of them.

        Returns
        -------
        Residuals
            Of these outputs alone.
        """
        errors = None if self.errors is None else self.errors[:, outputs]
        squares, counts, times = (part[outputs] for part in (self.squares, self.counts, self.times))
        return Residuals(squares, counts, times, errors, self.segment)


@dataclass(frozen=True)
class HeldOut:
    """The residuals of a hypothesis on held-out records.

    Parameters
    ----------
    windows : Residuals
        Over windows, each from its own initial state.
    free_run : Residuals
        Over whole records, or the held-out stretches, from their initial states.
    memory_price : float
        Penalty for the initial values of added states, in natural units of likelihood.
    block_squares : ndarray of shape (n_windows, n_blocks, n_outputs)
        Squared residuals of every block of every window.
    n_added : int, default=0
        States that the hypothesis adds to the prior's.
    n_free : int, default=0
        States that are free at the start of every window: all but those that inputs alone drive.
    tells_in_free_run : ndarray of shape (n_outputs,), optional
        Whether the free run of an output predicts the records better than their mean does; that of
        a chaotic or unstable motion does not. By default all do.
    learned : tuple of PhysicsModel, default=()
        The model of every fold, with the parameters estimated from the other windows.
    x0 : ndarray of shape (n_windows, n_states), optional
        The windows' initial states, fitted with these models.
    uncertain : ndarray of shape (n_outputs,), optional
        Expected increase of the squares in free run due to the errors of parameters and initial
        states.

    Examples
    --------
    >>> left = Residuals(np.array([120.0]), np.array([100.0]), times=np.array([1.0]))
    >>> found = HeldOut(left, left, memory_price=0.0, block_squares=np.full((10, 1, 1), 12.0))
    >>> found.windows.squares.sum() == found.block_squares.sum()
    np.True_
    """

    windows: Residuals
    free_run: Residuals
    memory_price: float
    block_squares: np.ndarray
    n_added: int = 0
    n_free: int = 0
    tells_in_free_run: np.ndarray | None = None
    learned: tuple[PhysicsModel, ...] = ()
    x0: np.ndarray | None = None
    uncertain: np.ndarray | None = None

    @property
    def tells(self) -> np.ndarray:
        """Whether the free run of an output is informative."""
        every = np.ones(self.free_run.squares.shape, dtype=bool)
        return every if self.tells_in_free_run is None else self.tells_in_free_run

    def beyond_uncertainty(self, alpha: float) -> np.ndarray:
        r"""Return the squares in free run that the errors of the fit do not explain.

        These add :math:`z^T M z` with normal :math:`z`, whose quantile is at most that of a single
        direction, :math:`\chi^2_{1, 1 - \alpha} \mathrm{E}\, z^T M z`.

        Parameters
        ----------
        alpha : float
            Probability of a larger increase.

        Returns
        -------
        ndarray of shape (n_outputs,)
            Squares in units of the noise; negative where the errors explain more.
        """
        if self.uncertain is None:
            return self.free_run.squares
        return self.free_run.squares - chi2.ppf(1.0 - alpha, 1) * self.uncertain
