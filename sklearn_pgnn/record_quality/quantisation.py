"""Quantisation: steps of the resolution that are larger than the noise."""

import numpy as np

from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.signals import Signal


def find_quantisation(signal: Signal, left: float = 0.0) -> Finding | None:
    """Find steps of the resolution that are larger than the noise, and than what is left.

    From a noise of half a step on, rounding is like more white noise of variance
    :math:`q^2/12`; below, its error depends on the signal. Where a model leaves more than a step,
    it is not the steps that stand in the way.

    References
    ----------
    .. [1] R. M. Gray, D. L. Neuhoff, "Quantization", IEEE Transactions on Information Theory
       44(6), 1998, :doi:`10.1109/18.720541`.
    """
    step = signal.resolution
    if not step > max(np.sqrt(1 / (1 / 4 + 1 / 12)) * max(signal.noise, signal.finest), left):
        return None
    levels = np.unique(np.rint(signal.values[np.isfinite(signal.values)] / step)).size
    return Finding(
        "quantisation",
        signal.name,
        f"{signal.name} is quantised in steps of {signal.measured(step)}, larger than its noise "
        f"({levels} different values)",
        step,
        "use a finer sensor or range; effects smaller than a step cannot be detected",
    )
