"""An input as a function of the states: the share that is explained, and by which states."""

from dataclasses import dataclass, field, replace

import numpy as np
import sympy
from scipy.stats import t as student
from sklearn.base import clone
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.limits import ALPHA, FOLDS, ROWS, SHARE
from sklearn_pgnn.simulation.windows import ShootingWindows

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

    def _of_all_states(self, u, x) -> StateLaw | None:
        """Return the simplest law of all states that explains enough of an input."""
        states = tuple(self.states)
        now, before = (self.judge(u, x, StateLaw(states, lag=lag)) for lag in (0, 1))
        lag = int(_is_worse(now, before))
        for regression in REGRESSIONS:
            law = self.judge(u, x, StateLaw(states, regression, lag))
            if law.share >= 1 - SHARE:
                return law
        return None

    def judge(self, u: np.ndarray, x: np.ndarray, law: StateLaw, known=True) -> StateLaw:
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

    def _hold_out(self, features, target, fold, law) -> np.ndarray:
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

    def _features(self, x, states) -> np.ndarray:
        columns = dict(zip(self.states, x.T, strict=True))
        turned = [wave(columns[s]) for s in states if s in self.angles for wave in (np.sin, np.cos)]
        return np.column_stack([*(columns[s] for s in states), *turned])


def _is_worse(one: StateLaw, other: StateLaw) -> bool:
    """Return whether a law leaves more than another, window by window, beyond chance."""
    rise = np.sqrt(one.errors) - np.sqrt(other.errors)
    error = np.std(rise, ddof=1) / np.sqrt(rise.size)
    return bool(rise.mean() > student.isf(ALPHA, rise.size - 1) * error)
