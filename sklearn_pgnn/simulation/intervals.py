"""Intervals of predictions: how far outputs may lie from a free run."""

from fractions import Fraction
from functools import partial
from math import ceil
from numbers import Real

import numpy as np

from sklearn_pgnn.exceptions import OptionError, RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import simulate_record
from sklearn_pgnn.simulation.uncertainty import propagated_variance
from sklearn_pgnn.trajectories.measured import of_measured
from sklearn_pgnn.user_line import warn_user

#: largest denominator of a coverage, which is a fraction that was rounded
FINEST = 10**6


def check_coverage(coverage) -> float:
    """Return a coverage; raise `OptionError` unless it is a share between 0 and 1.

    >>> check_coverage(0.9)
    0.9
    """
    if not isinstance(coverage, Real) or not 0 < float(coverage) < 1:
        raise OptionError(f"coverage: expected a number between 0 and 1, got {coverage!r}.")
    return float(coverage)


def warn_of_few_records(coverage: float, n_records: int) -> None:
    """Warn of a coverage that errors on so few records cannot guarantee.

    Of :math:`n + 1` exchangeable records each is as likely as any other to have the largest error.
    The one to be predicted exceeds all :math:`n` others with the probability :math:`1/(n + 1)`:
    only an infinite interval would cover it more often than :math:`n/(n + 1)` [1]_.

    .. [1] J. Lei, M. G'Sell, A. Rinaldo, R. J. Tibshirani, L. Wasserman, "Distribution-free
       predictive inference for regression", Journal of the American Statistical Association
       113(523), 2018, :doi:`10.1080/01621459.2017.1307116`.

    >>> warn_of_few_records(0.9, 9)  # enough
    """
    asked = Fraction(float(coverage)).limit_denominator(FINEST)  # 0.9 is 9/10
    needed = ceil(asked / (1 - asked))
    if n_records >= needed:
        return
    most, further = np.floor(1000 * n_records / (n_records + 1)) / 1000, needed - n_records
    warn_user(
        f"coverage: expected at most {n_records}/{n_records + 1}, which is what held-out errors of "
        f"{n_records} trajectories can guarantee for another one, got {coverage:g}, for which "
        f"{needed} are needed; without a guarantee, the interval covers that share of the errors "
        f"that were seen, and may cover less. Remedy: coverage={most:g} or less, or fit "
        f"{further} more {'trajectory' if further == 1 else 'trajectories'}.",
        RecordWarning,
    )


def quantile_of(magnitudes: np.ndarray, coverage: float) -> np.ndarray:
    """Return the quantile of the magnitudes for every output.

    >>> quantile_of(np.arange(1.0, 11.0)[:, None], 0.9).tolist()
    [9.0]
    """
    share = check_coverage(coverage)
    return of_measured(partial(np.nanquantile, q=share, method="inverted_cdf"), magnitudes)


def interval_around(predicted: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of intervals about a prediction.

    >>> interval_around(np.array([1.0, 2.0]), np.array([0.5]))
    (array([0.5, 1.5]), array([1.5, 2.5]))
    """
    half = np.broadcast_to(half, (len(predicted), np.shape(half)[-1])).reshape(predicted.shape)
    return predicted - half, predicted + half


def output_variance(
    model: PhysicsModel, record, names: tuple[str, ...], covariance: np.ndarray
) -> np.ndarray:
    r"""Return the variance of the simulated outputs that is due to the parameters'.

    .. math:: \sigma_k^2 = \frac{\partial \hat y_k}{\partial p} C
              \left(\frac{\partial \hat y_k}{\partial p}\right)^T

    The variance has shape (n_samples, n_outputs), and is infinite where the simulation becomes
    non-finite.

    >>> from sklearn_pgnn.trajectories import read_records
    >>> gain = PhysicsModel({"y": "V"}, {"y": "K*u"}, {"K": 2.0}, {"u": "V"})
    >>> (record,) = read_records(gain, [[0.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
    >>> output_variance(gain, record, ("K",), np.array([[0.01]])).ravel().round(4).tolist()
    [0.0, 0.01, 0.04]
    """
    run = simulate_record(model, record, wrt=names)
    slopes = np.asarray(run.sensitivities)[:, :, : len(names)]
    variance = propagated_variance(slopes, covariance)
    return np.nan_to_num(variance, nan=np.inf, posinf=np.inf)
