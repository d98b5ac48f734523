"""The initial state of a trajectory, from its first measured samples."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

#: training states that are tried as initial states, and how many are refined to a minimum
TRIED, FOLLOWED = 200, 5
#: the error assigned to a run that is not finite
FAR = 1e6
#: step of the differences by the initial state, in standard deviations of the states
STEP = 1e-6


def find_initial_state(
    run: Callable[[np.ndarray], np.ndarray],
    told: np.ndarray,
    y: np.ndarray,
    met: np.ndarray,
    noise: np.ndarray,
) -> np.ndarray:
    r"""Find the initial state of a trajectory from its first measured samples.

    .. math:: \min_{x_0} \sum_{k,o} \left(\frac{y_{ko} - \hat y_{ko}(x_0)}{s_o}\right)^2
              + \sum_i \left(\frac{x_{0i} - \bar x_i}{\sigma_i}\right)^2

    with the training error :math:`s_o` of the prediction, and the mean and standard deviation of
    the states reached in training. Some of these states are tried, and the best are refined to
    their minima.
    """
    if np.isfinite(told).all():
        return told
    met = met[np.isfinite(met).all(axis=1)]
    beginning = _Beginning(
        run, told, y, met.mean(axis=0), np.maximum(met.std(axis=0), 1e-12), noise
    )
    tried = beginning.places(met[:: max(1, len(met) // TRIED)])
    costs = np.sum(beginning.left(tried) ** 2, axis=1)
    best = tried[np.argsort(costs, kind="stable")[:FOLLOWED]]
    fits = [
        least_squares(lambda place: beginning.left(place[None])[0], z, jac=beginning.slopes)
        for z in best
    ]
    return beginning.states(min(fits, key=lambda fit: fit.cost).x[None])[0]


@dataclass(frozen=True)
class _Beginning:
    """Residuals at a start by its unknown states, as deviations from their mean in training."""

    run: Callable[[np.ndarray], np.ndarray]
    told: np.ndarray
    y: np.ndarray
    centre: np.ndarray
    spread: np.ndarray
    noise: np.ndarray

    def places(self, states: np.ndarray) -> np.ndarray:
        """Return the unknown states, as scaled deviations from their mean."""
        return ((states - self.centre) / self.spread)[:, np.isnan(self.told)]

    def states(self, places: np.ndarray) -> np.ndarray:
        """Return complete states, with the known ones as given."""
        states, free = np.tile(self.told, (len(places), 1)), np.isnan(self.told)
        states[:, free] = self.centre[free] + places * self.spread[free]
        return states

    def left(self, places: np.ndarray) -> np.ndarray:
        """Return the errors, relative to those in training, and the deviations; a row per start."""
        measured = np.isfinite(self.y)
        error = (self.run(self.states(places)) - np.where(measured, self.y, 0.0)) / self.noise
        error = np.nan_to_num(np.where(measured, error, 0.0), nan=FAR, posinf=FAR, neginf=-FAR)
        return np.column_stack([error.reshape(len(places), -1), places])

    def slopes(self, place: np.ndarray) -> np.ndarray:
        """Return the slopes of the residuals, from runs that are made in one call."""
        steps = STEP * np.maximum(1.0, np.abs(place))
        runs = self.left(place + np.vstack([np.zeros_like(place), np.diag(steps)]))
        return (runs[1:] - runs[0]).T / steps
