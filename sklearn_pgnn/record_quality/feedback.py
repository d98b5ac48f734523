"""Feedback: an input that a controller computed from the states, or that follows the noise."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import sympy
from scipy.stats import chi2
from scipy.stats import t as student
from sklearn.base import clone
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import Finding, listed
from sklearn_pgnn.record_quality.imitation import imitators
from sklearn_pgnn.record_quality.limits import ALPHA, FOLDS, LAGS, MOST, REPLAYS, ROWS, SHARE, TWICE
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows

# -- an input as a function of the states ----------------------------------------------------------

#: regressions that a law is sought among, the simplest first: a linear controller, a smooth one
#: (energy shaping has products of three states), and any other
REGRESSIONS = {
    "linear": make_pipeline(StandardScaler(), Ridge(1e-6)),
    "cubic": make_pipeline(
        StandardScaler(), PolynomialFeatures(3, include_bias=False), StandardScaler(), Ridge(1e-6)
    ),
    "trees": ExtraTreesRegressor(20, min_samples_leaf=3, random_state=0),
}


@dataclass(frozen=True)
class StateLaw:
    """How well a function of some states predicts an input.

    `regression` is a key of `REGRESSIONS`; `lag` is by how many samples the states are earlier than
    the input, and `errors` the held-out squared error of every window, as a share of the input's
    power.
    """

    states: tuple[str, ...]
    regression: str = "linear"
    lag: int = 0
    errors: np.ndarray = field(default_factory=lambda: np.ones(1))

    @property
    def share(self) -> float:
        """Share of the input's variance that the law explains held out; negative if useless."""
        return 1.0 - float(self.errors.sum())


class StateRegression:
    """Regress an input on the states of the same sample, or of the one before.

    What is held out are windows. A law saturates where the input has its least and its largest
    value: it is learned between them, and predicts no more.

    Of a state whose sine or cosine the model contains, both are features.
    """

    def __init__(self, model: PhysicsModel, windows: ShootingWindows):
        self.states = model.states
        arguments = {
            argument
            for equation in model.equations.values()
            for wave in equation.atoms(sympy.sin, sympy.cos)
            for argument in wave.args
        }
        self.angles = [state for state in model.states if symbol(state) in arguments]
        first = np.repeat(windows.bounds[:-1], np.diff(windows.bounds))
        inside = np.flatnonzero(np.arange(windows.t.size) > first)  # the sample before is known
        self.rows = inside[:: -(-inside.size // ROWS)]
        self.window = np.searchsorted(windows.starts, self.rows, side="right") - 1
        folds = np.random.default_rng(0).permutation(len(windows)) % FOLDS
        self.fold = folds[self.window]

    def find(self, u: np.ndarray, x: np.ndarray) -> StateLaw | None:
        """Find the law of an input with the fewest states."""
        law = self._of_all_states(u, x)
        while law is not None and len(law.states) > 1:
            fewer = [
                replace(law, states=tuple(s for s in law.states if s != left_out))
                for left_out in law.states
            ]
            best = max((self.judge(u, x, other) for other in fewer), key=lambda law: law.share)
            if best.share < 1 - SHARE or _is_worse(best, law):
                break
            law = best
        return law

    def _of_all_states(self, u: np.ndarray, x: np.ndarray) -> StateLaw | None:
        """Return the simplest law of all states that explains enough of an input."""
        states = tuple(self.states)
        now, before = (self.judge(u, x, StateLaw(states, lag=lag)) for lag in (0, 1))
        lag = int(_is_worse(now, before))
        for regression in REGRESSIONS:
            law = self.judge(u, x, StateLaw(states, regression, lag))
            if law.share >= 1 - SHARE:
                return law
        return None

    def judge(
        self, u: np.ndarray, x: np.ndarray, law: StateLaw, known: np.ndarray | bool = True
    ) -> StateLaw:
        """Return a law of the same states with the held-out errors that it makes of an input."""
        kept = np.broadcast_to(known, u.shape)[self.rows]
        rows, fold, window = self.rows[kept], self.fold[kept], self.window[kept]
        target = u[rows]
        power = np.sum((target - target.mean()) ** 2) if rows.size else 0.0
        if not power > 0 or np.unique(fold).size < 2:
            return replace(law, errors=np.ones(1))
        predicted = self._hold_out(self._features(x[rows - law.lag], law.states), target, fold, law)
        errors = np.bincount(window, (target - predicted) ** 2 / power, minlength=window.max() + 1)
        return replace(law, errors=errors)

    def _hold_out(
        self, features: np.ndarray, target: np.ndarray, fold: np.ndarray, law: StateLaw
    ) -> np.ndarray:
        """Return what is predicted of every fold by the others."""
        low, high = target.min(), target.max()
        between = (target > low) & (target < high)
        taught = np.ones_like(between) if law.regression == "trees" else between
        predicted = np.full(target.size, target.mean())
        for each in np.unique(fold):
            rest, out = taught & (fold != each), fold == each
            if rest.any():
                found = clone(REGRESSIONS[law.regression]).fit(features[rest], target[rest])
                predicted[out] = found.predict(features[out])
        return np.clip(predicted, low, high)

    def _features(self, x: np.ndarray, states: tuple[str, ...]) -> np.ndarray:
        columns = dict(zip(self.states, x.T, strict=True))
        turned = [wave(columns[s]) for s in states if s in self.angles for wave in (np.sin, np.cos)]
        return np.column_stack([*(columns[s] for s in states), *turned])


def _is_worse(one: StateLaw, other: StateLaw) -> bool:
    """Return whether a law leaves more than another, window by window, beyond chance."""
    rise = np.sqrt(one.errors) - np.sqrt(other.errors)
    error = np.std(rise, ddof=1) / np.sqrt(rise.size)
    return bool(rise.mean() > student.isf(ALPHA, rise.size - 1) * error)


# -- the records' inputs, played back faster or slower to the model --------------------------------


@dataclass(frozen=True)
class Replay:
    """Inputs at another speed, and what the states would then have been.

    `known` is where the inputs had not come to their end; all have a row per sample.
    """

    u: np.ndarray
    x: np.ndarray
    known: np.ndarray


def replay_inputs(
    problem: EstimationProblem, fit: WindowFit, x: np.ndarray
) -> Iterator[list[Replay]]:
    """Yield the trajectories of the machine if its inputs had run at other speeds.

    The speeds are up to twice as fast and as slow, and at least by the root of two; all inputs run
    together. Every speed is replayed in several ways, for the one or the other is unlike an
    experiment. The speed changes at once, or over the time in which the outputs do: a machine may
    have been at rest when the record began, or in motion. And the states are those of a free run of
    the model, or those of the records with the change that the other inputs make of such a run: the
    first have the errors of the model, the second those of the records.
    """
    windows = problem.windows
    run = _free_runs(fit.model, windows, x)
    powers = np.linspace(0.5, 1.0, REPLAYS // 2)
    for speed in TWICE ** np.concatenate([-powers, powers]):
        ways = []
        for time in (0.0, problem.period / (2 * np.pi)):
            u, known = _at_speed(windows, float(speed), time)
            other = _free_runs(fit.model, replace(windows, u=u), x)
            ways += [Replay(u, other, known), Replay(u, x + other - run, known)]
        yield ways


def _free_runs(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray) -> np.ndarray:
    """Return the states of every record, simulated from where it begins."""
    spans = pairwise(windows.bounds)
    return np.concatenate([free_run(model, windows, a, b, x[a]).x for a, b in spans])


def _at_speed(windows: ShootingWindows, speed: float, time: float) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the inputs at the time :math:`s t + (1 - s) T (1 - e^{-t/T})`, and where there are.

    At :math:`t = 0` nothing changes, and after some times :math:`T` the speed is :math:`s`.
    """
    u, known = np.empty_like(windows.u), np.zeros(windows.t.size, dtype=bool)
    for a, b in pairwise(windows.bounds):
        t = windows.t[a:b] - windows.t[a]
        late = -time * np.expm1(-t / time) if time > 0 else 0.0
        at = speed * t + (1 - speed) * late
        known[a:b] = at <= t[-1]
        # held values that were repeated or left out would make a smooth input rough
        u[a:b] = np.column_stack([np.interp(at, t, column) for column in windows.u[a:b].T])
    return u, known


def window_states(problem: EstimationProblem, fit: WindowFit) -> np.ndarray:
    """Return the states of a fitted model, every window simulated from its fitted initial state."""
    windows, x = problem.windows, problem.states.values(fit.model).copy()
    for a, n, x0 in zip(windows.starts, windows.lengths, fit.x0, strict=True):
        run = free_run(fit.model, windows, a, a + n, x0).x
        if np.isfinite(run).all():
            x[a : a + n] = run
    return x


# -- the finding -----------------------------------------------------------------------------------


def find_state_feedback(
    problem: EstimationProblem,
    final: WindowFit,
    each_step: Callable[[], bool | None] = lambda: None,
) -> list[Finding]:
    r"""Find inputs that are functions of the states at the same time.

    Where :math:`u = h(x)`, a gain of the input acts as any part of the model does that is
    :math:`h(x)`. But a machine that merely follows its input looks alike: a warm one shows how
    long it was heated. The two cases differ in that an input chosen in advance could as well have
    been run faster or slower. Let a regression on the states leave the share
    :math:`\rho` of an input, held out, and :math:`\rho_1, \dots, \rho_n` where the model is
    simulated with the inputs at :math:`n` other speeds. In open loop all these are alike. Under
    feedback :math:`\rho` is the least by far, beyond chance and by as much as is worth saying,

    .. math::
        \overline{\log \rho_i} - \log \rho > \max\left(
            t_{n - 1, 1 - \alpha}\, s(\log \rho_i) \sqrt{1 + 1/n}, \; -\log c\right),

    with the error rate :math:`\alpha` = `ALPHA` and the share :math:`c` = `SHARE`, which
    :math:`\rho` itself must not exceed either.
    """
    windows, model = problem.windows, final.model
    moving = [i for i in range(windows.u.shape[1]) if np.ptp(windows.u[:, i]) > 0]
    if not moving or not final.usable:
        return []
    x = window_states(problem, final)
    regression = StateRegression(model, windows)
    laws = {}
    for i in moving:
        each_step()
        laws[i] = regression.find(windows.u[:, i], x)
    told = {i: law for i, law in laws.items() if law is not None}
    if not told:
        return []
    replays, findings = [], []
    for ways in replay_inputs(problem, final, x):
        each_step()
        replays.append(ways)
    for i, law in told.items():
        others = [_left(regression, ways, i, law) for ways in replays]
        if _is_least(np.log(_share_left(law)), np.log(others), ALPHA / len(moving)):
            name = list(model.inputs)[i]
            parts = imitators(model, windows, x, name, _share_left(law))
            findings.append(_feedback(name, law, parts))
    return findings


def _left(regression: StateRegression, ways: list[Replay], i: int, law: StateLaw) -> float:
    """Return the least share that a law leaves of an input at one speed; NaN for none."""
    shares = []
    for way in ways:
        finite = (np.abs(way.x) < np.finfo(np.float32).max).all(axis=1)  # as large as trees take
        good = way.known & finite & np.roll(finite, 1)
        if good.sum() > (1 - MOST) * way.known.sum():
            shares.append(_share_left(regression.judge(way.u[:, i], way.x, law, good)))
    return min(shares, default=np.nan)


def _share_left(law: StateLaw) -> float:
    """Return the share of an input that a law leaves, between rounding and all."""
    return float(np.clip(1.0 - law.share, np.finfo(float).eps, 1.0))


def _is_least(value: float, others: np.ndarray, chance: float) -> bool:
    """Return whether a logarithm lies below others of its kind, by `SHARE` and beyond chance.

    That is a t test of one more draw.
    """
    others = others[np.isfinite(others)]
    if others.size < 2:
        return False
    error = np.std(others, ddof=1) * np.sqrt(1 + 1 / others.size)
    least = max(student.isf(chance, others.size - 1) * error, -np.log(SHARE))
    return bool(np.mean(others) - value > least)


def _feedback(name: str, law: StateLaw, parts: tuple[str, ...]) -> Finding:
    """Return the finding that an input follows a law, and that parts act as its gain does."""
    of = listed(law.states)
    if parts:
        like = f"as {listed(parts)} {'do together' if len(parts) > 1 else 'does'}"
    else:
        like = f"as any missing part does that is the same function of {of}"
    percent = np.floor(1e3 * law.share) / 10
    return Finding(
        "state feedback",
        name,
        f"{name} is a function of {of} at the same time ({percent:.1f} % of its variance, held "
        f"out): a controller computed it. A gain of {name} then acts {like}, and these records "
        f"cannot separate them",
        law.share,
        f"add a test signal to the controller's output that {of} cannot predict, and record the "
        f"reference too; or record in open loop",
    )


# -- feedback of the noise: an input that responds to that of an output's sensor -------------------


def find_closed_loop(
    outputs: Sequence[Signal], inputs: Sequence[Signal], left: Sequence[Signal]
) -> Finding | None:
    r"""Find an input that follows the noise of an output.

    The noise :math:`\varepsilon` that the extended model leaves and the part :math:`\nu` of an
    input that its own past does not tell are independent in open loop, whatever the input. With
    the share :math:`R^2` of :math:`\varepsilon_k` that a regression on
    :math:`\nu_k, \dots, \nu_{k+M}` explains,

    .. math:: n R^2 \sim \chi^2_{M+1}.

    It is looked for only where the model leaves no more than noise, and counts only where the
    noise makes up a part of :math:`\nu`.

    .. [1] L. D. Haugh, "Checking the independence of two covariance-stationary time series",
       Journal of the American Statistical Association 71, 1976,
       :doi:`10.1080/01621459.1976.10480353`.
    """
    chance = ALPHA / max(len(outputs) * len(inputs), 1)
    for signal, rest in zip(outputs, left, strict=True):
        if not signal.noisy or _excess(rest) > SHARE:
            continue
        noise = _innovations(rest.pieces)
        for source in inputs:
            correlation = _follows(noise, _innovations(source.pieces), chance)
            if correlation:
                return _loop(signal.name, source.name, correlation)
    return None


def _loop(output: str, source: str, correlation: float) -> Finding:
    return Finding(
        "closed loop",
        source,
        f"{source} follows the noise of {output} (correlation {correlation:.2f}): it was commanded "
        f"by a controller that measures {output}",
        correlation,
        "record in open loop, or add a test signal to the command that is large compared with the "
        "noise; do not trust a cause found from an input that follows the error",
    )


def _excess(rest: Signal) -> float:
    """Return the share of the left power that is more than white noise."""
    steps = np.concatenate([np.diff(piece[np.isfinite(piece)]) for piece in rest.pieces])
    return float(1 - np.nanmean(steps**2) / 2 / np.nanmean(rest.values**2))


def _innovations(pieces: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return what the past does not predict of a series; NaN where it is not known."""
    windows = [np.lib.stride_tricks.sliding_window_view(p, LAGS + 1) for p in pieces
               if p.size > LAGS]  # fmt: skip
    if not windows:
        return [np.full(p.size, np.nan) for p in pieces]
    rows = np.concatenate(windows)
    rows = rows[np.isfinite(rows).all(axis=1)]
    past = np.column_stack([rows[:, :-1], np.ones(len(rows))])
    weights = np.linalg.lstsq(past, rows[:, -1], rcond=None)[0]
    found = []
    for piece in pieces:
        new = np.full(piece.size, np.nan)
        if piece.size > LAGS:
            window = np.lib.stride_tricks.sliding_window_view(piece, LAGS + 1)
            new[LAGS:] = window[:, -1] - window[:, :-1] @ weights[:-1] - weights[-1]
        found.append(new)
    return found


def _follows(noise: Sequence[np.ndarray], news: Sequence[np.ndarray], chance: float) -> float:
    """Return the largest correlation of noise with what an input brings next; 0 if by chance."""
    pairs = [_ahead(e, v) for e, v in zip(noise, news, strict=True) if e.size > LAGS]
    rows = np.concatenate([np.zeros((0, LAGS + 2)), *pairs])
    rows = rows[np.isfinite(rows).all(axis=1)]
    size = np.sqrt(np.mean(rows**2, axis=0)) if len(rows) else np.zeros(1)
    if not size.min() > 0:
        return 0.0
    own, ahead = rows[:, 0] / size[0], rows[:, 1:] / size[1:]
    weights, _, rank, _ = np.linalg.lstsq(ahead, own, rcond=1e-8)
    statistic = len(rows) - float(np.sum((own - ahead @ weights) ** 2))
    correlations = own @ ahead / len(rows)
    part = float(np.sum(correlations**2)) - ahead.shape[1] / len(rows)
    follows = statistic > chi2.isf(chance, rank) and part > SHARE
    return float(np.abs(correlations).max()) if follows else 0.0


def _ahead(noise: np.ndarray, news: np.ndarray) -> np.ndarray:
    """Return the noise of every sample beside what the input brings from there on."""
    future = np.lib.stride_tricks.sliding_window_view(news, LAGS + 1)
    return np.column_stack([noise[: len(future)], future])
