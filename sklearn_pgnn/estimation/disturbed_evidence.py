"""Evidence between two hypotheses, each with the disturbance most likely beside it."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.criterion import HeldOut
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.problem import EstimationProblem


class Judged(NamedTuple):
    """A hypothesis and its held-out residuals."""

    key: Key
    trial: FittedHypothesis
    held_out: HeldOut


class DisturbedEvidence:
    """Evidence between hypotheses with a disturbance; the likelihoods are cached.

    `folds` is the fold of every window.
    """

    def __init__(self, problem: EstimationProblem, folds: np.ndarray):
        self.problem, self.folds = problem, folds
        self._known: dict[tuple, tuple[HeldOut, float]] = {}

    def evidence(
        self,
        without: Judged,
        with_: Judged,
        smallest_share: float,
        each_run: Callable[[], bool | None] = lambda: None,
    ) -> float:
        r"""Return the evidence for the second of two hypotheses.

        Its outputs have a noise with the variance

        .. math:: \max(\sigma_o^2, s \min(S_{o,0}, S_{o,1}) / n_o)

        with the squares :math:`S_o` that the hypotheses leave and the smallest share :math:`s`.
        """
        before, after = without.held_out.windows, with_.held_out.windows
        squares = np.minimum(before.squares, after.squares) / np.maximum(after.counts, 1.0)
        noise = self.problem.windows.scale**2 * np.maximum(1.0, smallest_share * squares)
        less, more = (self._likelihood(each, noise, each_run) for each in (without, with_))
        return more - less if np.isfinite([less, more]).any() else np.nan

    def _likelihood(self, judged: Judged, variance: np.ndarray, each_run) -> float:
        """Return the likelihood of held-out windows with the most likely disturbance."""
        key, (_, trial, held_out) = (judged.key, *variance), judged
        known, likelihood = self._known.get(key, (None, -np.inf))
        if known is not held_out:
            # its loops take two seconds to compile, and where white noise is left are not needed
            from sklearn_pgnn.estimation.disturbed import disturbed_likelihood

            likelihood = disturbed_likelihood(
                self.problem, trial, held_out, self.folds, variance, each_run
            )
            self._known[key] = held_out, likelihood
        return likelihood
