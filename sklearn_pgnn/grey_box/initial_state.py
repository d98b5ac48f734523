"""The initial state of a trajectory, from its first measured samples."""

import numpy as np
from scipy.optimize import least_squares

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.trajectories.record import Record

#: states of the training that are tried as starts, and how many are followed to their minimum
TRIED, FOLLOWED = 200, 5


def find_initial_state(
    model: PhysicsModel, record: Record, met: np.ndarray, noise: np.ndarray
) -> np.ndarray:
    r"""Find where a trajectory starts, from what was measured of its beginning.

    .. math:: \min_{x_0} \sum_{k,o} \left(\frac{y_{ko} - \hat y_{ko}(x_0)}{s_o}\right)^2
              + \sum_i \left(\frac{x_{0i} - \bar x_i}{\sigma_i}\right)^2

    with the error :math:`s_o` that the model leaves in training, and mean and standard deviation
    of the states met there. Some of these are tried, and the best followed to their minima.

    Parameters
    ----------
    model : PhysicsModel
        The fitted model.
    record : Record
        The first samples, measured; initial states that it tells are kept.
    met : ndarray of shape (n_samples, n_states)
        States met in training.
    noise : ndarray of shape (n_outputs,)
        Error of the outputs in training.

    Returns
    -------
    ndarray of shape (n_states,)
        The initial state.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t, u, met = np.arange(5) * 0.1, np.zeros((5, 1)), np.linspace(0, 4, 9)[:, None]
    >>> y = lag.simulate(t, u, [3.0]).y
    >>> record = Record(t, u, y, np.array([np.nan]), "0", np.arange(5))
    >>> find_initial_state(lag, record, met, np.array([1e-3])).round(3).tolist()
    [3.0]
    """
    met = met[np.isfinite(met).all(axis=1)]
    centre, spread = met.mean(axis=0), np.maximum(met.std(axis=0), 1e-12)
    told = np.full(len(model.states), np.nan)
    told[: record.x0.size] = record.x0
    free = ~np.isfinite(told)
    if not free.any():
        return told
    y = np.asarray(record.y)
    measured = np.isfinite(y)

    def state(z) -> np.ndarray:
        x0 = told.copy()
        x0[free] = (centre + z_full(z) * spread)[free]
        return x0

    def z_full(z) -> np.ndarray:
        whole = np.zeros(free.size)
        whole[free] = z
        return whole

    def left(z) -> np.ndarray:
        run = simulate_record(model, _at(record, state(z)))
        error = np.where(measured, (run.y - np.nan_to_num(y)) / noise, 0.0)
        return np.append(np.nan_to_num(error, nan=1e6, posinf=1e6, neginf=-1e6).ravel(), z)

    tried = ((met - centre) / spread)[:: max(1, len(met) // TRIED), free]
    best = sorted(tried, key=lambda z: float(np.sum(left(z) ** 2)))[:FOLLOWED]
    fits = [least_squares(left, z, diff_step=1e-6) for z in best]
    return state(min(fits, key=lambda fit: fit.cost).x)


def _at(record: Record, x0) -> Record:
    return Record(record.t, record.u, None, x0, record.name, record.rows)
