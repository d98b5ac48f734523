r"""The likelihood of held-out windows under a hypothesis, with an unmeasured disturbance.

A window's simulation contains a disturbance only through its initial state. Therefore, where one
acts, a law with a shorter memory predicts the records better than the true law, also held-out
ones. Here a hypothesis has a hidden input in addition to its causes,
see `sklearn_pgnn.simulation.disturbance`: at the place, and with the variance and the time
constant, of the largest likelihood. Least squares over windows weights residuals as if they were
undisturbed, so the parameters of every fold are estimated again from the innovations of the others,

.. math:: p \leftarrow \arg\min_p \sum_w \left\| \nu_w + N_w (p - p_w) \right\|^2
          + \sum_i \left(\frac{p_i - \bar p_i}{\sigma_i}\right)^2,

with the innovations :math:`\nu` and :math:`N` of the residuals and of their derivatives by the
parameters. No hypothesis is exact, so errors too small for a cause to be named count as output
noise: otherwise, with an accurate sensor, the hypothesis with the slightly better one-step
prediction would be more likely, however wrong its trajectory.
"""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.budgets import KEPT, STRETCHES
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.problem import EstimationProblem, one_of
from sklearn_pgnn.estimation.residuals import HeldOut
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import places_of, typical_at
from sklearn_pgnn.simulation.bounded_step import bounded_step
from sklearn_pgnn.simulation.disturbance import (
    Disturbance,
    LinearWindows,
    innovations,
    likeliest,
)
from sklearn_pgnn.simulation.filtered_response import Starts, linearise_filtered
from sklearn_pgnn.simulation.led_states import Lead, lead
from sklearn_pgnn.simulation.simulate import simulate_acting
from sklearn_pgnn.simulation.window_fit import ParameterPrior
from sklearn_pgnn.simulation.windows import ShootingWindows


def disturbed_likelihood(
    problem: EstimationProblem,
    trial: FittedHypothesis,
    held_out: HeldOut,
    folds: np.ndarray,
    variance: np.ndarray,
    each_run: Callable[[], bool | None] = lambda: None,
) -> float:
    """Return the log-likelihood of held-out windows with the disturbance of largest likelihood."""
    if held_out.x0 is None:
        return -np.inf
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        seen = HeldOutWindows(problem, trial.fit.freedoms, held_out, folds, variance)
        return max(seen.likelihoods(each_run), default=-np.inf)


class HeldOutWindows:
    """Held-out windows under the parameters estimated from the others, linearised.

    `held_out` are the models fitted to the other windows, and the initial states fitted with them;
    `folds` has shape (n_windows,), the `variance` of the noise (n_outputs,).
    """

    def __init__(
        self,
        problem: EstimationProblem,
        freedoms: tuple[ParameterPrior, ...],
        held_out: HeldOut,
        folds: np.ndarray,
        variance: np.ndarray,
    ):
        self.problem, self.freedoms = problem, freedoms
        self.folds, self.variance = folds, variance
        learned, x0 = held_out.learned, np.asarray(held_out.x0)
        names, windows = tuple(free.name for free in freedoms), problem.windows
        n_states = len(learned[0].states)
        self.slopes = np.full((*windows.y.shape, len(names)), np.nan)
        self.mean = np.empty((len(windows), n_states))
        self.covariance = np.empty((len(windows), n_states, n_states))
        self.taught = np.empty((len(windows), len(names)))
        self.parts: list[tuple[PhysicsModel, ShootingWindows, Starts]] = []
        for model, fold in zip(learned, np.unique(folds), strict=True):
            inside = folds == fold
            part = windows.select(inside)
            led = lead(model, part, names, x0[inside])
            begun = x0[inside] if led is None else led.initial_states(x0[inside])
            expected = problem.states.expected_starts(model, part)
            self.mean[inside], self.covariance[inside] = _starts(led, begun, *expected)
            self.taught[inside] = [model.parameters[name].value for name in names]
            self._simulate(model, part, begun, led, names)
            starts = Starts(begun, self.mean[inside], self.covariance[inside])
            self.parts.append((model, part, starts))

    def _simulate(
        self,
        model: PhysicsModel,
        part: ShootingWindows,
        begun: np.ndarray,
        led: Lead | None,
        names: tuple[str, ...],
    ) -> None:
        """Fill in the derivatives of the residuals of windows by parameters."""
        u, count = part.acting_inputs(model), len(names)
        spans = zip(part.starts, part.starts + part.lengths, strict=True)
        for w, (a, b) in enumerate(spans):
            options = {**part.options_in(int(part.record_at(a))), "wrt": names}
            run = simulate_acting(model, part.t[a:b], u[a:b], begun[w], **options)
            slopes, by_start = np.split(np.asarray(run.sensitivities), [count], axis=-1)
            if led is not None:
                follow = led.slopes[w, :, : len(led.numbers)]
                slopes[..., led.numbers] += by_start[..., led.states] @ follow
            self.slopes[a:b] = -slopes

    def likelihoods(self, each_run: Callable[[], bool | None] = lambda: None) -> Iterator[float]:
        """Yield the likelihood with the parameters as they are, and as estimated again."""
        looks = [self._first_look(each, each_run) for each in self._places]
        looks = sorted(looks, key=lambda look: -look.likelihood)[:KEPT]
        found = (self._likeliest(look, each_run) for look in looks)
        best = max(found, key=lambda one: one.likelihood, default=None)
        if best is None:
            return
        yield best.likelihood
        residual = best.linear.columns
        every = replace(best.linear, columns=np.concatenate([self.slopes, residual], axis=-1))
        gram = innovations(every, best.disturbance).gram
        again = replace(best.linear, columns=self._learned_again(gram, residual))
        size, time = self._typical(best.channel)
        yield likeliest(again, size, time, best.disturbance, each_run)[1]

    @property
    def _places(self) -> tuple[str, ...]:
        """Where the hidden input may act."""
        return places_of(self.problem.prior)

    def _first_look(self, channel: str, each_run: Callable[[], bool | None]) -> "_Look":
        """Find the likely hidden input at a channel on some windows, fewer for many places."""
        windows, (size, time) = self.problem.windows, self._typical(channel)
        share = min(len(self._places) // KEPT, len(windows) // STRETCHES)
        few = np.arange(0, len(windows), max(one_of(windows), share))
        linear = self._linearised(channel, Disturbance(size**2, time), few)
        found = likeliest(linear.select(few), size, time, each_run=each_run)
        return _Look(channel, *found, linear if few.size == len(windows) else None)

    def _likeliest(self, look: "_Look", each_run: Callable[[], bool | None]) -> "_Beside":
        """Find the most likely hidden input at a channel, first along a typical one's effect."""
        channel, disturbance = look.channel, look.disturbance
        size, time = self._typical(channel)
        linear = look.linear or self._linearised(channel, Disturbance(size**2, time))
        likelihood = innovations(linear, disturbance).log_likelihood
        first = _Beside(channel, linear, disturbance, likelihood)
        linear = self._linearised(channel, disturbance)
        disturbance, likelihood = likeliest(linear, size, time, disturbance, each_run)
        second = _Beside(channel, linear, disturbance, likelihood)
        return max(first, second, key=lambda one: one.likelihood)

    def _typical(self, channel: str) -> tuple[float, float]:
        """Return a typical value of a channel, and the time of a window."""
        scales = self.problem.scales
        return typical_at(self.problem.prior, channel, scales), scales.window

    def _linearised(
        self, channel: str, disturbance: Disturbance, few: np.ndarray | slice = slice(None)
    ) -> LinearWindows:
        """Linearise windows with a hidden input, along its effect."""
        windows = self.problem.windows
        asked = np.zeros(len(windows), dtype=bool)
        asked[few] = True
        (size, n_outputs), n = windows.y.shape, self.mean.shape[1] + 1
        F, H = np.zeros((size, n, n)), np.zeros((size, n_outputs, n))
        columns = np.full((size, n_outputs, 1), np.nan)
        for fold, (model, part, starts) in zip(np.unique(self.folds), self.parts, strict=True):
            some = asked[self.folds == fold]
            part, starts = part.select(some), Starts(*(each[some] for each in starts))
            if not len(part):
                continue
            near = linearise_filtered(model, part, starts, channel, disturbance, self.variance)
            rows = part.rows
            F[rows], H[rows], columns[rows, :, 0] = (each[rows] for each in near)
        return LinearWindows(windows, F, H, columns, self.mean, self.covariance, self.variance)

    def _learned_again(self, gram: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return the residuals with parameters estimated from the other folds' innovations."""
        moved = np.empty_like(self.taught)
        for fold in np.unique(self.folds):
            inside = self.folds == fold
            here = self.taught[inside][0]
            moved[inside] = self._step(gram[~inside], self.taught[~inside] - here, here)
        windows = self.problem.windows
        by_sample = np.repeat(moved, windows.lengths, axis=0)
        rows, left = windows.rows, residual.copy()
        left[rows, :, 0] += np.einsum("kop,kp->ko", self.slopes[rows], by_sample)
        return left

    def _step(self, gram: np.ndarray, off: np.ndarray, here: np.ndarray) -> np.ndarray:
        """Return the change of parameters from the values used to simulate a fold's windows."""
        own = {name: np.array([getattr(free, name) for free in self.freedoms]) for name in _PRIOR}
        pull = 1.0 / own["spread"] ** 2
        slopes = gram[:, :-1, :-1]
        gradient = np.einsum("wij,wj->i", slopes, off) - gram[:, :-1, -1].sum(axis=0)
        gradient += pull * (own["centre"] - here)
        hessian = slopes.sum(axis=0) + np.diag(pull)
        if not (np.isfinite(hessian).all() and np.isfinite(gradient).all()):
            return np.zeros_like(here)
        return bounded_step(hessian, gradient, 0.0, own["low"] - here, own["high"] - here)


class _Look(NamedTuple):
    """The most likely hidden input at a channel on some windows; all of them, if they are."""

    channel: str
    disturbance: Disturbance
    likelihood: float
    linear: LinearWindows | None


@dataclass(frozen=True)
class _Beside:
    """The hidden input of largest likelihood at a channel."""

    channel: str
    linear: LinearWindows
    disturbance: Disturbance
    likelihood: float


_PRIOR = ("centre", "spread", "low", "high")


def _starts(
    led: Lead | None, begun: np.ndarray, expected: np.ndarray, spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the expected initial states less those of the windows, and their covariances."""
    variances = np.tile(np.diag(spread**2), (len(begun), 1, 1))
    if led is None:
        return expected - begun, variances
    by_start, states = led.slopes[..., len(led.numbers) :], np.array(led.states)
    there = by_start * spread[states]
    variances[:, states[:, None], states] = there @ np.swapaxes(there, 1, 2)
    return led.initial_states(expected) - begun, variances


class Judged(NamedTuple):
    """A hypothesis and its held-out residuals."""

    key: Key
    trial: FittedHypothesis
    held_out: HeldOut


class DisturbedEvidence:
    """Evidence between hypotheses with a disturbance; the likelihoods are cached, by fold."""

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

    def _likelihood(
        self, judged: Judged, variance: np.ndarray, each_run: Callable[[], bool | None]
    ) -> float:
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
