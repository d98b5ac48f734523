"""Squares of residuals by octave of frequency: within an octave, coloured noise is nearly white."""

from typing import NamedTuple

import numpy as np
from scipy.fft import dct


class Octaves(NamedTuple):
    """Squares by octave of frequency, the highest one first.

    Parameters
    ----------
    squares, counts : ndarray of shape (n_octaves, n_outputs)
        Sums of squared coefficients, and how many these are.

    Examples
    --------
    >>> Octaves(np.array([[8.0], [4.0]]), np.array([[4.0], [2.0]])).power.ravel()
    array([2., 2.])
    """

    squares: np.ndarray
    counts: np.ndarray

    @property
    def power(self) -> np.ndarray:
        """Mean square of the coefficients of an octave; 0 where there is none."""
        return self.squares / np.maximum(self.counts, 1.0)

    def of(self, outputs: np.ndarray) -> "Octaves":
        """Return the octaves of some outputs.

        Parameters
        ----------
        outputs : ndarray of shape (n_outputs,)
            Whether an output is one of them.

        Returns
        -------
        Octaves
            Of these outputs alone.
        """
        return Octaves(self.squares[:, outputs], self.counts[:, outputs])


def octaves_of(residual: np.ndarray, segment: np.ndarray, n_fitted=0.0) -> Octaves:
    r"""Return the squares of residuals by octave of frequency.

    The known samples :math:`r_t`, :math:`t = 0, \dots, L - 1`, of a segment have the coefficients
    of the orthonormal discrete cosine transform,

    .. math:: c_k = \sqrt{\frac{2 - \delta_{k0}}{L}} \sum_t r_t \cos\frac{\pi k (t + 1/2)}{L},

    whose squares sum to those of the samples. Coefficient :math:`k` has :math:`k/2` periods in the
    segment, and belongs to octave :math:`\lfloor \log_2(L/k) \rfloor`; what is constant,
    :math:`k = 0`, to the one below all others of its segment. An initial state that was fitted to a
    segment has taken what is slow: so many of its lowest coefficients do not count, and an octave
    of which none is left goes with the one above.

    Parameters
    ----------
    residual : ndarray of shape (n_samples, n_outputs)
        Residuals; NaN where there is none.
    segment : ndarray of shape (n_samples,)
        Number of every sample's window or record; segments lie end to end.
    n_fitted : float or ndarray of shape (n_outputs,), default=0
        Initial states that were fitted to every segment, by output.

    Returns
    -------
    Octaves
        The squares, and the number of coefficients that count.

    Examples
    --------
    >>> found = octaves_of(np.ones((8, 1)), np.zeros(8))
    >>> found.squares.ravel().round(12), found.counts.ravel()
    (array([0., 0., 0., 0., 8.]), array([3., 2., 1., 1., 1.]))
    >>> found = octaves_of(np.ones((8, 1)), np.zeros(8), n_fitted=3)
    >>> found.squares.ravel().round(12), found.counts.ravel()
    (array([0., 8., 0., 0., 0.]), array([3., 2., 0., 0., 0.]))
    """
    fitted = np.broadcast_to(n_fitted, residual.shape[1])
    sums = [_sums(*of_output, segment) for of_output in zip(residual.T, fitted, strict=True)]
    n_octaves = max((squares.size for squares, _ in sums), default=0)
    padded = [
        [np.pad(each, (0, n_octaves - each.size)) for each in of_output] for of_output in sums
    ]
    squares, counts = np.moveaxis(np.reshape(padded, (len(sums), 2, n_octaves)), 0, -1)
    return Octaves(squares, counts)


def _sums(values: np.ndarray, n_fitted: float, segment: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the squares of every octave of one output, and the number of coefficients."""
    known = np.isfinite(values)
    values, segment = values[known], segment[known]
    edges = np.flatnonzero(np.diff(segment, prepend=np.nan, append=np.nan))
    lengths = np.diff(edges)
    n_octaves = _octave(1, lengths.max()) + 2 if lengths.size else 0
    squares, counts = np.zeros(n_octaves), np.zeros(n_octaves)
    for length in np.unique(lengths):
        first = edges[:-1][lengths == length]
        coefficients = dct(values[first[:, None] + np.arange(length)], norm="ortho", axis=1)
        octave = np.append(_octave(1, length) + 1, _octave(np.arange(1, length), length))
        with np.errstate(over="ignore"):
            power = (coefficients**2).sum(axis=0)
        squares += np.bincount(octave, power, n_octaves)
        counts += first.size * np.bincount(octave, minlength=n_octaves)
    return _without(squares, counts, round(n_fitted * lengths.size, 9))


def _without(squares, counts, fitted: float) -> tuple[np.ndarray, np.ndarray]:
    """Take fitted numbers from the lowest octaves; what these still hold goes with the next."""
    for octave in range(counts.size - 1, -1, -1):
        taken = min(fitted, counts[octave])
        counts[octave], fitted = counts[octave] - taken, fitted - taken
        if octave and not counts[octave]:
            squares[octave - 1], squares[octave] = squares[octave - 1] + squares[octave], 0.0
    return squares, counts


def _octave(k, length: int):
    """Return the octave of a coefficient of a segment."""
    return np.floor(np.log2(length / np.asarray(k))).astype(int)
