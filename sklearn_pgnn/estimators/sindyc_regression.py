r"""Sparse regression on the terms of a library, scaled so that a threshold has a meaning.

With the terms :math:`\Psi` divided by their root mean squares and the target by its standard
deviation :math:`\sigma`, a coefficient is the share of the target's motion that its term makes up:

.. math:: \theta_{ij} = \Xi_{ij}\, \mathrm{rms}(\Psi_j) / \sigma_i
"""

import warnings

import numpy as np
from sklearn import config_context
from sklearn.base import clone

from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.trajectories.triangle import blocks, triangle

#: a target whose variation is below this share of its root mean square counts as constant
STILL = 1e-9


def sparse_coefficients(terms, targets, optimizer, *, squares_only=False) -> np.ndarray:
    r"""Find the few terms that explain the targets.

    Terms and targets have shapes (n_rows, n_terms) and (n_rows, n_targets), the coefficients, in
    their units, (n_targets, n_terms); zero for terms that are left out. The optimizer sees scaled
    terms and targets; it is cloned, not fitted itself. `squares_only` is whether it depends on sums
    of squares alone. It then sees the triangle of a QR decomposition, :math:`|R_\Psi \theta - R_y|
    = |\Psi\theta - y|` up to what no :math:`\theta` changes, instead of as many rows as there are
    samples.
    """
    size, spread = _sizes(terms), _spreads(targets)
    if squares_only:
        rows = triangle(np.vstack([terms[of].T, targets[of].T]).T for of in blocks(len(terms)))
        terms, targets = np.split(rows, [terms.shape[1]], axis=1)
    optimizer = clone(optimizer)
    # the numbers of the default are checked; sklearn would check them for every term dropped
    unchecked = config_context(skip_parameter_validation=squares_only)
    with unchecked, warnings.catch_warnings():
        # the caller raises it with the state's name
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
        optimizer.fit(terms / size, targets / spread)
    if np.any(getattr(optimizer, "intercept_", 0.0)):
        raise ValueError(
            f"optimizer: {type(optimizer).__name__} fits an intercept, which no term represents. "
            f"Remedy: fit_intercept=False; 'polynomial' and '1' hold the constant."
        )
    shares = np.reshape(optimizer.coef_, (targets.shape[1], terms.shape[1]))
    return shares * spread[:, None] / size


def stepwise_least_squares(threshold: float, alpha: float, n_rows: int, n_terms: int):
    r"""Return the sequentially thresholded ridge regression of the SINDy paper.

    It minimises :math:`\frac1n |y - \Psi\theta|^2 + \alpha |\theta|^2`, drops every coefficient
    below the threshold, repeats until none is left below it, and ends without the ridge.

    The ridge penalty `alpha` is per row.

    References
    ----------
    .. [1] S. L. Brunton, J. L. Proctor, J. N. Kutz, "Discovering governing equations from data by
       sparse identification of nonlinear dynamical systems", PNAS 113(15), 2016,
       :doi:`10.1073/pnas.1517384113`.
    """
    with needed_by("SINDYcRegressor"):
        from pysindy import STLSQ
    # every round but the last drops a term
    return STLSQ(threshold=threshold, alpha=alpha * n_rows, max_iter=n_terms + 1)


def _sizes(terms) -> np.ndarray:
    size = np.sqrt(np.mean(terms**2, axis=0))
    return np.where(size > 0, size, 1.0)


def _spreads(targets) -> np.ndarray:
    size, spread = np.sqrt(np.mean(targets**2, axis=0)), np.std(targets, axis=0)
    spread = np.where(spread > STILL * size, spread, size)
    return np.where(spread > 0, spread, 1.0)
