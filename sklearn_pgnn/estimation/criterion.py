r"""The comparison of two hypotheses: a held-out likelihood ratio, and a decision rule based on it.

Let :math:`S_o` be the sum of squared residuals of a hypothesis in output :math:`o` on :math:`n_o`
samples its parameters were not fitted to. With Gaussian errors whose variance is profiled out, the
evidence for hypothesis 1 over hypothesis 0 is

.. math:: \Lambda = \sum_o \frac{n_o}{2 \tau_o} \log \frac{S_{o,0}}{S_{o,1}} - (V_1 - V_0)

in natural units. :math:`\tau_o` is the longer of the integrated autocorrelation times of the two
residuals: coloured residuals count by their effective number, and a slow residual of the worse
hypothesis does not count for more because the better one removes it. :math:`V` is the penalty for
the states that a hypothesis adds, whose values at the start of every window are integrated out by
Laplace's method.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from scipy.stats import norm

from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.physics.effect import Effect


def accuracy_gained(before: Residuals, after: Residuals) -> float:
    r"""Return the gain in accuracy of the second of two simulations, in standard errors.

    .. math:: z = \frac{\sum_k d_k}{\sqrt{n \tau_d \operatorname{var} d}}, \qquad
        d_k = \sum_o \frac{e_{o,0}^2(k) - e_{o,1}^2(k)}{S_{o,0} + S_{o,1}}

    The errors of two wrong models may differ by chance by much more than a likelihood ratio says:
    where one of them sticks, the other slips.

    .. [1] F. X. Diebold, R. S. Mariano, "Comparing predictive accuracy", Journal of Business and
       Economic Statistics 13(3), 1995, :doi:`10.1080/07350015.1995.10524599`.
    """
    if before.errors is None or after.errors is None or before.segment is None:
        raise ValueError("expected residuals with their errors, got squares only.")
    known = np.isfinite(before.squares).all(), np.isfinite(after.squares).all()
    if not all(known):
        return 0.0 if known[0] == known[1] else float(np.inf if known[1] else -np.inf)
    weight = 1.0 / (before.squares + after.squares)
    difference = ((before.errors**2 - after.errors**2) * weight).sum(axis=1)
    known = np.isfinite(difference)
    if known.sum() < 2:
        return 0.0
    spread = difference - difference[known].mean()
    (time,) = autocorrelation_times(np.where(known, spread, np.nan)[:, None], before.segment)
    error = np.sqrt(known.sum() * time * np.var(difference[known]))
    return float(difference[known].sum() / error) if error > 0 else 0.0


def log_likelihood_ratio(worse: Residuals, better: Residuals) -> float:
    r"""Return the logarithm of the ratio of two likelihoods, their variances profiled out.

    .. math:: \sum_o \frac{n_o}{2 \tau_o} \log \frac{S_{o,0}}{S_{o,1}}

    Parameters
    ----------
    worse, better : Residuals
        Hypotheses 0 and 1 on the same samples.

    Returns
    -------
    float
        Positive if hypothesis 1 is more likely; infinite if only one of them can be simulated.

    Examples
    --------
    >>> one = np.ones(1)
    >>> wide, narrow = Residuals(200 * one, 100 * one, one), Residuals(100 * one, 100 * one, one)
    >>> bool(np.isclose(log_likelihood_ratio(wide, narrow), 50 * np.log(2)))
    True
    """
    known = np.isfinite(worse.squares).all(), np.isfinite(better.squares).all()
    if not all(known):
        return 0.0 if known[0] == known[1] else float(np.inf if known[1] else -np.inf)
    times = np.maximum(worse.times, better.times)
    measured = (worse.counts > 0) & (worse.squares > 0) & (better.squares > 0)
    ratio = np.log(worse.squares[measured] / better.squares[measured])
    return float((worse.counts[measured] / (2.0 * times[measured]) * ratio).sum())


def explained_share(worse: Residuals, better: Residuals) -> float:
    """Return the largest share of hypothesis 0's squares in an output that hypothesis 1 explains.

    Parameters
    ----------
    worse, better : Residuals
        Hypotheses 0 and 1 on the same samples.

    Returns
    -------
    float
        At most 1; negative where the error of no output falls.

    Examples
    --------
    >>> one = np.ones(1)
    >>> before, after = (Residuals(squares * one, 100 * one, one) for squares in (400.0, 100.0))
    >>> explained_share(before, after)
    0.75
    """
    if not np.isfinite(better.squares).all():
        return -np.inf
    if not np.isfinite(worse.squares).all():
        return 1.0
    measured = worse.squares > 0
    return float(np.max(1.0 - better.squares[measured] / worse.squares[measured], initial=-np.inf))


def free_runs_that_tell(first: HeldOut, second: HeldOut) -> tuple[Residuals, Residuals]:
    """Return the free runs of the outputs for which one of two hypotheses is informative.

    >>> left, no_blocks = Residuals(*np.full((3, 2), 100.0)), np.zeros((1, 1, 2))
    >>> unstable = HeldOut(left, left, 0.0, no_blocks, tells_in_free_run=np.array([True, False]))
    >>> free_runs_that_tell(unstable, unstable)[0].squares
    array([100.])
    """
    tells = first.tells | second.tells
    return first.free_run.of(tells), second.free_run.of(tells)


def ratio_error(one: HeldOut, other: HeldOut) -> float:
    r"""Return the standard error of the likelihood ratio of two hypotheses, by leaving out windows.

    .. math::
        \sigma^2 = \frac{W}{W - 1} \sum_w \Big(\sum_o \frac{n_o}{2 \tau_o}
        \Big(\frac{S_{o,w,0}}{S_{o,0}} - \frac{S_{o,w,1}}{S_{o,1}}\Big)\Big)^2
    """
    times = np.maximum(one.windows.times, other.windows.times)
    left = [each.block_squares.sum(axis=1) for each in (one, other)]
    with np.errstate(invalid="ignore"):  # an output that is not measured has no squares
        shares = [np.nan_to_num(squares / squares.sum(axis=0)) for squares in left]
    told = ((shares[0] - shares[1]) * one.windows.counts / (2.0 * times)).sum(axis=1)
    return float(np.sqrt(told.size / max(told.size - 1, 1) * np.sum(told**2)))


@dataclass(frozen=True)
class SelectionCriterion:
    r"""The rule by which a cause is named.

    A cause is named in addition to others if the evidence for it exceeds :math:`\log(N/\alpha)`, if
    it explains the smallest share of an output over windows or in free run, and if the free run,
    where informative, does not contradict it: the free run is not worse than without the cause,
    beyond chance and by the smallest share, and not worse than that of the re-tuned prior by more
    than :math:`\log(1/\alpha)`. For a cause that adds states, whose initial values are free in
    every window, the free run must be better than both by the smallest share.
    Of hypotheses that are not separated by evidence of :math:`\log(1/\alpha)`, the one with the
    fewest parameters is preferred, and among equally many the more likely one. Where residuals
    over windows exceed white noise, the evidence given a disturbance must exceed
    :math:`\log(N/\alpha)`, too.

    Parameters
    ----------
    alpha : float
        False-alarm rate.
    smallest_share : float
        Smallest share of an output's squares that matters.
    n_candidates : int
        Number of candidates considered, :math:`N`.

    Examples
    --------
    >>> rule = SelectionCriterion(alpha=0.01, smallest_share=0.05, n_candidates=40)
    >>> round(rule.to_name, 2), round(rule.to_refute, 2)
    (8.29, 4.61)
    >>> rule.probabilities([2.0, 30.0]).round(2)  # the cause, its rival, none
    array([0.88, 0.12, 0.  ])
    """

    alpha: float
    smallest_share: float
    n_candidates: int

    @property
    def to_name(self) -> float:
        """Evidence required for a cause to be named."""
        return log(max(self.n_candidates, 1) / self.alpha)

    @property
    def to_refute(self) -> float:
        """Evidence required to refute one of two given hypotheses."""
        return log(1.0 / self.alpha)

    @staticmethod
    def evidence(without: HeldOut, with_: HeldOut) -> float:
        """Return the evidence for a hypothesis over another one over windows."""
        ratio = log_likelihood_ratio(without.windows, with_.windows)
        return ratio if np.isinf(ratio) else ratio - (with_.memory_price - without.memory_price)

    def names(
        self,
        without: HeldOut,
        with_: HeldOut,
        n_causes: int = 1,
        overdispersion: float = 1.0,
        retuned: HeldOut | None = None,
    ) -> bool:
        """Return whether causes are named in addition to a hypothesis without them.

        Parameters
        ----------
        without, with_ : HeldOut
            The hypothesis without the causes, and with them.
        n_causes : int, default=1
            Number of these causes.
        overdispersion : float, default=1
            Overdispersion of the residuals along the causes, over windows.
        retuned : HeldOut, optional
            The prior, re-tuned; by default the hypothesis without the causes.

        Returns
        -------
        bool
            Whether the rule is met.
        """
        evidence = self.evidence(without, with_) / overdispersion
        if not self.stands_in_free_run(retuned or without, with_):
            return False
        if self.runs_worse(without, with_) or self.remembers_in_vain(without, with_):
            return False
        return evidence > n_causes * self.to_name and self.explains_enough(without, with_)

    def explains_enough(self, without: HeldOut, with_: HeldOut) -> bool:
        """Return whether a hypothesis explains the smallest share of another one's error.

        Parameters
        ----------
        without, with_ : HeldOut
            The other hypothesis, and this one.

        Returns
        -------
        bool
            Whether it does for some output over windows, or in free run where that is informative.
        """
        pairs = (without.windows, with_.windows), free_runs_that_tell(without, with_)
        return any(explained_share(*pair) >= self.smallest_share for pair in pairs)

    def runs_worse(self, other: HeldOut, trial: HeldOut) -> bool:
        """Return whether a free run is worse than another by the smallest share, beyond chance.

        Parameters
        ----------
        other, trial : HeldOut
            The other hypothesis, and this one.

        Returns
        -------
        bool
            False where the free run is not informative.
        """
        before, after = free_runs_that_tell(other, trial)
        if before.errors is None or after.errors is None or not before.counts.size:
            return False
        surely = accuracy_gained(before, after) < -norm.ppf(1.0 - self.alpha)
        return surely and explained_share(after, before) >= self.smallest_share

    def stands_in_free_run(self, retuned: HeldOut, trial: HeldOut) -> bool:
        """Return whether the free run is no worse than the re-tuned prior's; better if with states.

        Parameters
        ----------
        retuned, trial : HeldOut
            The prior, re-tuned, and the hypothesis.

        Returns
        -------
        bool
            Whether the free run, where informative, does not contradict the hypothesis.
        """
        is_worse = log_likelihood_ratio(*free_runs_that_tell(retuned, trial)) < -self.to_refute
        return not is_worse and not self.remembers_in_vain(retuned, trial)

    def remembers_in_vain(self, simpler: HeldOut, trial: HeldOut) -> bool:
        """Return whether added states do not improve the free run.

        An explanation by states that start anew in every window does not count. Nor does one whose
        free run tells nothing, unless the errors of the fit explain that: the motion is unstable.

        Parameters
        ----------
        simpler, trial : HeldOut
            A hypothesis, and one that may have more states.

        Returns
        -------
        bool
            False where the second has no more states.
        """
        if trial.n_added <= simpler.n_added:
            return False
        before, after = free_runs_that_tell(simpler, trial)
        if not before.counts.size:
            return bool((trial.beyond_uncertainty(self.alpha) > trial.free_run.counts).all())
        return explained_share(before, after) < self.smallest_share

    def separation(self, one: HeldOut, other: HeldOut, overdispersion: float) -> float:
        r"""Return how surely the second of two hypotheses that may replace each other is likelier.

        .. math:: \mathrm{sign}(\Lambda)\, \min(|\Lambda| / \phi,\; 2 \Lambda^2 / \sigma^2),
                  \quad 0 \text{ if } |\Lambda| \le \sigma

        with the standard error :math:`\sigma` of :math:`\Lambda`, see `ratio_error`: for the true
        hypothesis :math:`\sigma^2 = 2 \Lambda`, and what lies within its own error says nothing.
        """
        ratio = self.evidence(one, other)
        if not np.isfinite(ratio):
            return ratio
        error = ratio_error(one, other)
        if abs(ratio) <= error:
            return 0.0
        surely = min(abs(ratio) / overdispersion, 2.0 * (ratio / error) ** 2 if error else np.inf)
        return float(np.copysign(surely, ratio))

    def probable(
        self, rivals: Sequence[tuple[Effect, float]], over_none: float
    ) -> list[tuple[Effect, float]]:
        """Return the rivals, nearest first, that are at least as probable as a false alarm."""
        nearest = sorted(rivals, key=lambda rival: rival[1])
        chances = self.probabilities([*(value for _, value in nearest), over_none])[1:-1]
        pairs = zip(nearest, chances, strict=True)
        return [rival for rival, chance in pairs if chance >= self.alpha]

    def probabilities(self, evidence: Sequence[float]) -> np.ndarray:
        """Return the probability of a cause, of each of its rivals, and of no cause.

        The prior odds of a cause against none are alpha to the number of candidates, the same for
        all.

        Parameters
        ----------
        evidence : sequence of float
            Evidence for the cause over each rival, and last over none.

        Returns
        -------
        ndarray of shape (1 + len(evidence),)
            Probabilities that sum to 1: the cause, its rivals, none.
        """
        weights = np.nan_to_num([0.0, *(-value for value in evidence)])  # infinite is very large
        weights[-1] += self.to_name
        weights = np.exp(np.maximum(weights - weights.max(), -700.0))
        return weights / weights.sum()
