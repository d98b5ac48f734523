"""Peers as scikit-learn estimators over tables of trajectories, predicting in free run.

They take time, inputs and outputs only. What a lagged model needs before the first sample is taken
as if the machine had rested at the prior's first outputs.
"""

import io
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.neural_network import MLPRegressor

#: outputs so many times larger than any measured one have diverged
RUNAWAY = 10.0


class Peer(RegressorMixin, BaseEstimator):
    """A model of one trajectory after the other; each gives `_learn` and `_run`."""

    def fit(self, X, y):
        """Learn from the trajectories of a table."""
        y = np.asarray(y, dtype=float).reshape(len(X), -1)
        self.limit_ = RUNAWAY * np.nanmax(np.abs(y), axis=0)
        self.interval_ = float(X["t"].diff().median())
        self._learn([(self._inputs(rows), y[place]) for place, rows in _trajectories(X)])
        return self

    def predict(self, X):
        """Run along every trajectory from its first row; what runs away stays at its first row."""
        found = np.empty((len(X), len(self.limit_)))
        for place, rows in _trajectories(X):
            first = self._first(rows)
            with np.errstate(all="ignore"):
                run = self._run(self._inputs(rows), first)
            good = np.isfinite(run).all() and (np.abs(run) <= self.limit_).all()
            found[place] = run if good else first
        return found

    def _inputs(self, rows):
        return rows[list(self.prior.inputs)].to_numpy(dtype=float)

    def _first(self, rows):
        """Return the outputs of the first row, from its initial state."""
        start = [rows[name].iloc[0] if name in rows else np.nan for name in self.prior.states]
        known = np.where(np.isfinite(start), start, list(self.prior.initial_state.values()))
        two = self.prior.simulate([0.0, self.interval_], self._inputs(rows)[:2], known)
        return two.y[0]


class NetworkNarx(Peer):
    """Scikit-learn's network over the last outputs and inputs."""

    def __init__(self, prior, lags=3, neurons=16, alpha=1e-4, random_state=0):
        self.prior = prior
        self.lags = lags
        self.neurons = neurons
        self.alpha = alpha
        self.random_state = random_state

    def _learn(self, parts):
        rows, targets = zip(*(self._lagged(u, y) for u, y in parts), strict=True)
        z, target = np.concatenate(rows), np.concatenate(targets)
        self.mean_, self.scale_ = z.mean(axis=0), _positive(z.std(axis=0))
        self.step_mean_, self.step_scale_ = target.mean(axis=0), _positive(target.std(axis=0))
        net = MLPRegressor(
            hidden_layer_sizes=[int(self.neurons)] * 2, activation="tanh", solver="lbfgs",
            alpha=self.alpha, max_iter=500, random_state=self.random_state,
        )  # fmt: skip
        wanted = (target - self.step_mean_) / self.step_scale_
        net.fit((z - self.mean_) / self.scale_, wanted if wanted.shape[1] > 1 else wanted[:, 0])
        self.layers_ = list(zip(net.coefs_, net.intercepts_, strict=True))

    def _lagged(self, u, y):
        n = self.lags
        windows = [np.hstack([y[k - n : k].ravel(), u[k - n : k + 1].ravel()])
                   for k in range(n, len(y))]  # fmt: skip
        return np.array(windows), y[n:] - y[n - 1 : -1]

    def _run(self, u, first):
        n = self.lags
        u = _begun_at_rest(u, n)
        y = np.empty((len(u), len(first)))
        y[: n + 1] = first
        for k in range(n + 1, len(u)):
            z = np.hstack([y[k - n : k].ravel(), u[k - n : k + 1].ravel()])
            z = (z - self.mean_) / self.scale_
            for weights, bias in self.layers_[:-1]:
                z = np.tanh(z @ weights + bias)
            weights, bias = self.layers_[-1]
            y[k] = y[k - 1] + (z @ weights + bias) * self.step_scale_ + self.step_mean_
        return y[n:]


class PysindyModel(Peer):
    """pysindy over the outputs and, of a machine with inertia, their smoothed rates."""

    def __init__(self, prior, degree=2, threshold=0.01, width=11):
        self.prior = prior
        self.degree = degree
        self.threshold = threshold
        self.width = width

    def _learn(self, parts):
        import pysindy

        smooth = pysindy.SmoothedFiniteDifference(
            smoother_kws={"window_length": int(self.width), "polyorder": 3}
        )
        self.has_rates_ = len(self.prior.states) > parts[0][1].shape[1]
        states, inputs = [], []
        for u, y in parts:
            rates = [smooth(y, self.interval_)] if self.has_rates_ else []
            states.append(np.hstack([y, *rates]))
            inputs.append(u)
        both = np.hstack([np.concatenate(states), np.concatenate(inputs)])
        self.scale_ = _positive(both.std(axis=0))
        nx = states[0].shape[1]
        library = pysindy.PolynomialLibrary(degree=int(self.degree))
        model = pysindy.SINDy(pysindy.STLSQ(threshold=self.threshold), library, smooth)
        model.fit(
            [x / self.scale_[:nx] for x in states], t=self.interval_,
            u=[u / self.scale_[nx:] for u in inputs],
        )  # fmt: skip
        self.coefficients_, self.powers_ = model.coefficients(), library.powers_

    def _rate(self, x, u):
        nx = len(x)
        z = np.concatenate([x, u]) / self.scale_
        return self.coefficients_ @ np.prod(z**self.powers_, axis=1) * self.scale_[:nx]

    def _run(self, u, first):
        x = np.concatenate([first, np.zeros(len(first) if self.has_rates_ else 0)])
        h, found = self.interval_, [x]
        for now in u[:-1]:
            a = self._rate(x, now)
            b = self._rate(x + h / 2 * a, now)
            c = self._rate(x + h / 2 * b, now)
            x = x + h / 6 * (a + 2 * b + 2 * c + self._rate(x + h * c, now))
            found.append(x)
        return np.array(found)[:, : len(first)]


class FrolsNarx(Peer):
    """SysIdentPy's polynomial NARX, a model for every output, over the records end to end."""

    def __init__(self, prior, lags=2, degree=2, n_terms=8):
        self.prior = prior
        self.lags = lags
        self.degree = degree
        self.n_terms = n_terms

    def _learn(self, parts):
        from sysidentpy.basis_function import Polynomial
        from sysidentpy.model_structure_selection import FROLS
        from sysidentpy.parameter_estimation import LeastSquares

        u, y = (np.concatenate(each) for each in zip(*parts, strict=True))
        n, degree = int(self.lags), int(self.degree)
        self.models_ = []
        for column in y.T:
            lags = list(range(1, n + 1))
            model = FROLS(
                ylag=n, xlag=n if u.shape[1] == 1 else [lags] * u.shape[1],
                order_selection=False, n_terms=int(self.n_terms), estimator=LeastSquares(),
                basis_function=Polynomial(degree=degree),
            )  # fmt: skip
            self.models_.append(model.fit(X=u, y=column[:, None]))

    def _run(self, u, first):
        u = _begun_at_rest(u, self.lags)
        columns = []
        for model, start in zip(self.models_, first, strict=True):
            begun = np.full((model.max_lag, 1), start)
            columns.append(model.predict(X=u, y=begun)[self.lags :, 0])
        return np.column_stack(columns)


class Subnet(Peer):
    """deepSI's neural state-space model, whose encoder sees the first output at rest.

    Every trajectory begins with rows at rest, of which the encoder estimates the first state.
    """

    def __init__(
        self, prior, states=4, lags=5, horizon=50, learning_rate=3e-3, steps=1500, random_state=0
    ):
        self.prior = prior
        self.states = states
        self.lags = lags
        self.horizon = horizon
        self.learning_rate = learning_rate
        self.steps = steps
        self.random_state = random_state

    def _learn(self, parts):
        import torch
        from deepSI import SUBNET, Input_output_data, get_nu_ny_and_auto_norm
        from deepSI.fitting import fit_minimal_implementation

        torch.manual_seed(self.random_state)
        n = int(self.lags)
        data = [Input_output_data(*(_begun_at_rest(each, n) for each in part)) for part in parts]
        sizes = {"nx": int(self.states), "nb": n, "na": n, "feedthrough": False}
        self.model_ = SUBNET(*get_nu_ny_and_auto_norm(data), **sizes)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            fit_minimal_implementation(
                self.model_, data[:-1], data[-1], self.steps, T=int(self.horizon), batch_size=64,
                val_freq=100,
                optimizer=torch.optim.Adam(self.model_.parameters(), lr=self.learning_rate),
            )  # fmt: skip

    def _run(self, u, first):
        import torch

        n = int(self.lags)
        at_rest = np.repeat(first[None], n, axis=0)
        parts = np.repeat(u[:1], n, axis=0), at_rest, u
        with torch.no_grad():
            run = self.model_(*(torch.tensor(part[None], dtype=torch.float32) for part in parts))
        return run[0].numpy()


def _begun_at_rest(rows, n):
    """Return the rows of a trajectory behind its first one, repeated."""
    return np.vstack([np.repeat(rows[:1], n, axis=0), rows])


def _trajectories(X):
    """Return the places and the rows of every trajectory."""
    for _, rows in X.reset_index(drop=True).groupby("trajectory", sort=False):
        yield rows.index.to_numpy(), rows


def _positive(values):
    return np.where(values > 0, values, 1.0)
