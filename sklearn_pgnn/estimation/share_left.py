"""The ratio of a fit's squares to another one's, with its interval."""

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student


class ShareLeft(NamedTuple):
    """A share of squares with its 95 % interval."""

    left: float
    low: float
    high: float


def share_left(before: np.ndarray, after: np.ndarray) -> ShareLeft:
    r"""Return the share of the squares of windows that remains.

    .. math:: s = \frac{\sum_w b_w}{\sum_w a_w}, \qquad
        \operatorname{se}(\log s)^2 = \frac{W}{W - 1}
        \frac{\sum_w (b_w - s\,a_w)^2}{(\sum_w b_w)^2}

    The interval is that of Student's distribution on the logarithm, with the windows less one as
    its degrees of freedom.
    """
    share = float(after.sum() / before.sum())
    if after.size < 2:
        return ShareLeft(share, 0.0, np.inf)
    if not (np.isfinite(share) and share > 0):
        return ShareLeft(share, share, share)
    scatter = np.sum((after - share * before) ** 2) * after.size / (after.size - 1)
    reach = student.ppf(0.975, after.size - 1) * np.sqrt(scatter) / after.sum()
    return ShareLeft(share, float(share * np.exp(-reach)), float(share * np.exp(reach)))
