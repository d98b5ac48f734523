r"""An unmeasured input that, added to an equation, would make a model follow a record.

The model is extended by a hidden input :math:`d` that wanders,

.. math:: \dot x_i = f_i(x, u) + d, \qquad \mathrm{d}d = \sqrt{q}\, \mathrm{d}w

(or added to the effort of a port, an input or an output), and the states and :math:`d` are smoothed
by an extended Kalman filter and a Rauch-Tung-Striebel smoother. The intensity :math:`q` is the one
that makes the record most likely.

References
----------
.. [1] H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic
   systems", AIAA Journal 3(8), 1965, :doi:`10.2514/3.3166`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import sympy
from scipy.optimize import minimize_scalar

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import add_at
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.kalman import filter_samples, run_smoother
from sklearn_pgnn.simulation.simulate import parameter_values
from sklearn_pgnn.simulation.stepping import usual_interval
from sklearn_pgnn.simulation.windows import ShootingWindows

#: the state that stands for the hidden input
HIDDEN = "hidden_input"
#: decades searched for q, about a change as large as the channel itself within its time
EXPONENTS = (-9.0, 4.0)


@dataclass(frozen=True)
class HiddenInput:
    """The estimated hidden input of a channel of a model.

    The channel is the port whose effort it is added to, the state whose rate, or the input or
    output. `values`, for whose unit see `sklearn_pgnn.physics.places.unit_at`, and their standard
    `errors` have shape (n_samples,), the model's `states`, smoothed with them, (n_samples,
    n_states).
    """

    channel: str
    values: np.ndarray
    errors: np.ndarray
    states: np.ndarray


def with_hidden_input(model: PhysicsModel, channel: str) -> PhysicsModel:
    """Add the hidden input as a constant state."""
    d = symbol(HIDDEN)
    changes = {"equations": model.equations, **add_at(model, channel, d)}
    changes["equations"] = {**changes["equations"], HIDDEN: sympy.Integer(0)}
    return model.replace(**{**changes, "energy": {}}, states={**model.states, HIDDEN: ""})


def find_hidden_input(
    model: PhysicsModel,
    windows: ShootingWindows,
    channel: str,
    x: np.ndarray,
    spread: np.ndarray,
    size: float,
    time: float,
    each_run: Callable[[], object] | None = None,
) -> HiddenInput:
    """Smooth the hidden input of a channel."""
    filtered = _Filter(with_hidden_input(model, channel), windows, x, spread, size)

    def badness(exponent):
        if each_run is not None:
            each_run()
        return -filtered.likelihood(size**2 / time * 10.0**exponent)

    best = min(np.arange(EXPONENTS[0], EXPONENTS[1] + 1, 2.0), key=badness)
    found = minimize_scalar(
        badness, bounds=(best - 2, best + 2), method="bounded", options={"xatol": 0.3}
    )
    states, errors = filtered.smooth(size**2 / time * 10.0**found.x)
    return HiddenInput(channel, states[:, -1], errors, states[:, :-1])


class _Filter:
    """The filter of a model with a hidden input on a set of records."""

    def __init__(self, model, windows, x, spread, size):
        self.compiled = compile_model(model, (), windows.method)
        self.p, self.u = parameter_values(model), windows.acting_inputs(model)
        self.windows, self.spans = windows, list(pairwise(windows.bounds))
        self.starts = [np.append(x[a], 0.0) for a, _ in self.spans]
        self.P0 = np.diag(np.append(spread**2, size**2))

    def _run(self, intensity, span, start):
        (a, b), nx, windows = span, start.size, self.windows
        states = np.empty((b - a, nx)), np.empty((b - a, nx, nx))
        predicted = np.empty((b - a, nx)), np.empty((b - a, nx, nx))
        into = (*states, *predicted, np.zeros((b - a, nx, nx)))
        noise = np.append(1e-8 * np.diag(self.P0)[:-1], intensity), windows.scale**2
        rows, usual, first = slice(a, b), usual_interval(windows.t[a:b]), (start, self.P0)
        likelihood = filter_samples(
            self.compiled, windows, rows, self.u, windows.y, usual, self.p, first, noise, into
        )
        return likelihood, into

    def likelihood(self, intensity) -> float:
        """Return the log-likelihood of all records; very small where one diverged."""
        runs = (self._run(intensity, *one)[0] for one in zip(self.spans, self.starts, strict=True))
        total = float(sum(runs))
        return total if total > -1e300 else -1e300  # also where it is NaN

    def smooth(self, intensity):
        """Return the smoothed states with the hidden input last, and its standard errors."""
        states, errors = [], []
        for span, start in zip(self.spans, self.starts, strict=True):
            likelihood, (X, P, *predicted) = self._run(intensity, span, start)
            if np.isfinite(likelihood) and all(np.isfinite(part).all() for part in (X, *predicted)):
                run_smoother(X, P, *predicted)
            else:
                X[:], P[:] = np.nan, np.nan
            states.append(X)
            errors.append(np.sqrt(np.maximum(P[:, -1, -1], 0.0)))
        return np.concatenate(states), np.concatenate(errors)
