"""A fit does not depend on its integration steps, nor on where it starts."""

import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from sklearn_pgnn import Parameter, PhysicsModel, PhysicsModelRegressor
from sklearn_pgnn.exceptions import FitWarning

pytestmark = pytest.mark.core


def two_lags(slow, fast, at):
    """Return a slow and a fast lag in a row, of which the second is seen."""
    return PhysicsModel(
        {"x": "V", "z": "V"},
        {"x": "a*(u - x)", "z": "k*(x - z)"},
        [
            Parameter("a", 0.8 * slow, "1/s", bounds=(slow / 50, slow * 50)),
            Parameter("k", at, "1/s", bounds=(slow, 1e3 * fast)),
        ],
        {"u": "V"},
        outputs={"y": "z"},
    )


def records_of_lags(slow, fast, step, noise, rng, n_records=3, n=300):
    """Return records by the matrix exponential: steps of an input that is held."""
    A = np.array([[-slow, 0.0, slow], [fast, -fast, 0.0], [0.0, 0.0, 0.0]])
    M, X, y = expm(step * A), [], []
    for record in range(n_records):
        u = np.repeat(rng.uniform(-1, 1, n // 50), 50)
        x = np.zeros((n, 2))
        for k in range(n - 1):
            x[k + 1] = (M @ np.append(x[k], u[k]))[:2]
        X.append(np.column_stack([np.full(n, record), step * np.arange(n), u]))
        y.append(x[:, 1] + noise * rng.standard_normal(n))
    return np.concatenate(X), np.concatenate(y)


def told(regressor, X, y):
    """Return what a fit warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        regressor.fit(X, y)
    return [each for each in caught if issubclass(each.category, FitWarning)]


def frame(X):
    return pd.DataFrame(X, columns=["trajectory", "t", "u"])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_pole_far_beyond_the_sampling_is_open_above_from_every_start(seed):
    rng = np.random.default_rng(seed)
    slow, step = rng.uniform(1, 8), 10 ** rng.uniform(-3, -1)
    slow, fast = slow * 0.02 / step * 0.2, 10 ** rng.uniform(1.5, 2.5) / step
    X, y = records_of_lags(slow, fast, step, 0.01, rng)
    lows = []
    for start in (0.05 * fast, 0.3 * fast, 3 * fast, 30 * fast):
        regressor = PhysicsModelRegressor(two_lags(slow, fast, start))
        (warning,) = told(regressor, frame(X), y)
        assert str(warning.message).startswith("the records do not determine k: other values")
        found = regressor.parameters_
        assert found["k"].low < fast < found["k"].high == 1e3 * fast
        assert found["a"].low < slow < found["a"].high
        lows.append(found["k"].low)
    assert np.ptp(np.log(lows)) < 0.3


def test_a_pole_that_the_sampling_shows_is_determined_from_every_start():
    rng = np.random.default_rng(4)
    X, y = records_of_lags(4.0, 60.0, 0.005, 0.002, rng)
    values = []
    for start in (20.0, 300.0, 5000.0):
        regressor = PhysicsModelRegressor(two_lags(4.0, 60.0, start))
        assert not told(regressor, frame(X), y)
        k = regressor.parameters_["k"]
        assert k.low < 60.0 < k.high < 90.0
        values.append(k.value)
    assert np.ptp(values) < 0.1 * (k.high - k.low)


def test_told_steps_at_the_limit_of_stability_become_implicit():
    rng = np.random.default_rng(5)
    X, y = records_of_lags(4.0, 3000.0, 0.005, 0.01, rng)
    regressor = PhysicsModelRegressor(two_lags(4.0, 3000.0, 300.0), substeps=2)
    (warning,) = told(regressor, frame(X), y)
    assert "do not determine k" in str(warning.message)
    assert (regressor.method_, regressor.substeps_) == ("rosenbrock", 2)
    assert regressor.model_.simulation["method"] == "rosenbrock"
    run = regressor.model_.simulate(np.arange(50.0), np.ones(50))
    assert run.y[-1, 0] == pytest.approx(1.0, abs=0.01)


def subjects(k1, k2, volume, rng, n_subjects, noise=0.03):
    """Return few, unevenly spaced samples of a dose's way, by the exact solution."""
    rows = []
    for subject in range(n_subjects):
        t = np.concatenate([[0.0], np.sort(rng.uniform(0.3, 24.0, 7))])
        gap = np.append(True, np.diff(t) > 0.2)
        t, dose = t[gap], rng.uniform(40, 120)
        A = dose * np.exp(-k1 * t)
        B = dose * k1 / (k2 - k1) * (np.exp(-k1 * t) - np.exp(-k2 * t))
        y = B / volume + noise * rng.standard_normal(t.size)
        first = t == 0
        table = {"trajectory": subject, "t": t, "conc": y}
        table |= {"A": np.where(first, A, np.nan), "B": np.where(first, B, np.nan)}
        rows.append(pd.DataFrame(table))
    table = pd.concat(rows, ignore_index=True)
    return table.drop(columns="conc"), table["conc"].to_numpy()


def absorption(**start):
    return PhysicsModel(
        {"A": "mg", "B": "mg"},
        {"A": "-k1*A", "B": "k1*A - k2*B"},
        [Parameter(name, value, bounds=(1e-3, 200.0)) for name, value in start.items()],
        outputs={"conc": "B/V"},
    )


@pytest.mark.slow
def test_intervals_of_uneven_records_hold_the_truth():
    """Of 60 intervals of 95 % at least 52 hold: fewer are as improbable as 1 in 200."""
    truth, inside = {"k1": 1.1, "k2": 0.2, "V": 9.0}, []
    for seed in range(20):
        X, y = subjects(*truth.values(), np.random.default_rng(seed), 30)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            regressor = PhysicsModelRegressor(
                absorption(k1=0.5, k2=0.5, V=20.0), noise_std=0.03, search="local"
            ).fit(X, y)
        found = regressor.parameters_
        inside += [found[name].low <= value <= found[name].high for name, value in truth.items()]
    assert sum(inside) >= 52


def test_steps_are_fine_enough_for_every_parameter():
    """Half as long steps move no parameter by a tenth of its error."""
    truth = {"k1": 1.6, "k2": 0.3, "V": 10.0}
    X, y = subjects(*truth.values(), np.random.default_rng(1), 40)
    options = {"noise_std": 0.03, "search": "local"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        start = absorption(k1=0.5, k2=0.5, V=20.0)
        one = PhysicsModelRegressor(start, **options).fit(X, y)
        fine = PhysicsModelRegressor(start, substeps=8 * one.substeps_, **options).fit(X, y)
    for name, found in one.parameters_.items():
        error = (found.high - found.low) / 2 / 1.96
        assert found.value == pytest.approx(fine.parameters_[name].value, abs=0.15 * error)


def test_a_fit_that_makes_the_free_run_worse_says_so():
    """Short windows begin where a sensor with an offset says; in free run the damping must do."""
    rng = np.random.default_rng(0)
    t = np.arange(0, 40, 0.02)
    u = np.sign(np.sin(1.3 * t))
    machine = PhysicsModel({"v": "m/s"}, {"v": "u - 2*tanh(v)"}, {}, {"u": "N"})
    y = machine.simulate(t, u).y[:, 0] + 1.0 + 0.002 * rng.standard_normal(t.size)
    table = pd.DataFrame({"t": t, "u": u, "v": np.where(t == 0, 0.0, np.nan)})
    model = PhysicsModel({"v": "m/s"}, {"v": "u - d*v"}, {"d": 1.0}, {"u": "N"})
    whole = PhysicsModelRegressor(model, window_length="trajectory", search="local")
    assert not told(whole, table, y)
    regressor = PhysicsModelRegressor(whole.model_, window_length=0.5, search="local")
    (worse,) = told(regressor, table, y)
    assert str(worse.message).startswith("in free run the fitted model is further")
    assert "Remedy: minimise the error of the free run" in str(worse.message)
