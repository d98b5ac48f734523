"""The triangle of a QR decomposition of many rows, which stands for them in least squares."""

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.linalg.lapack import dtpqrt

#: rows of a block: small enough for the processor's cache, and for BLAS to start no threads
BLOCK = 256
#: columns that LAPACK treats together; a matrix of few columns would be treated one by one
PANEL = 8


def blocks(n_rows: int) -> Iterator[slice]:
    """Yield the rows of every block."""
    return (slice(a, a + BLOCK) for a in range(0, n_rows, BLOCK))


def triangle(parts: Iterable[np.ndarray]) -> np.ndarray:
    r"""Return the triangle of the QR decomposition of rows that come in blocks.

    With :math:`A = QR` the triangle :math:`R` has the singular values and the right singular
    vectors of :math:`A`, and :math:`|R\theta| = |A\theta|`. The triangle of the blocks so far,
    stacked on the next block, has the same triangle as all of them together; the zeros below its
    diagonal are not computed with.

    >>> A = np.arange(12.0).reshape(6, 2)
    >>> R = triangle([A[:3], A[3:]])
    >>> bool(np.allclose(R.T @ R, A.T @ A))
    True
    """
    found = np.zeros((0, 0))
    for part in parts:
        n = part.shape[1]
        found = found if found.size else np.zeros((n, n), order="F")
        found = dtpqrt(0, min(PANEL, n), found, part, overwrite_a=True)[0]
    return found
