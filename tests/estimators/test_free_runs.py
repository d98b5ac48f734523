"""Free runs of fitted estimators: long steps are divided, and what diverges is told once."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression

from sklearn_pgnn import (
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
    SINDYcRegressor,
)
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.simulation.simulate import SMALL

SWING = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "-k*x - d*v + u"},
    {"k": 2500.0, "d": 5.0},
    {"u": "N"},
)
T = np.arange(480) * 0.01
X = np.column_stack([T, np.repeat(np.random.default_rng(0).normal(size=24), 20)])
Y = SWING.simulate(T, X[:, 1], substeps=20).y
ROWS = {
    "slower": np.arange(480) % 10 == 0,
    "gap": (np.arange(480) <= 100) | (np.arange(480) >= 115),
}
ESTIMATORS = {
    "residual": ResidualRegressor(SWING, LinearRegression()),
    "model": PhysicsModelRegressor(SWING, search="local"),
    "sindyc": SINDYcRegressor(SWING, library="model", threshold=0.0),
}


@pytest.fixture(scope="module", params=ESTIMATORS)
def fitted(request):
    return ESTIMATORS[request.param].fit(X, Y)


@pytest.mark.parametrize("rows", ROWS.values(), ids=ROWS)
def test_a_long_step_is_integrated_like_the_short_ones(fitted, rows):
    whole, spread = fitted.predict(X)[rows], np.ptp(Y, axis=0)
    assert np.all(np.abs(fitted.predict(X[rows]) - whole).max(axis=0) < SMALL * spread)
    states = fitted.predict_states(X[rows]) - fitted.predict_states(X)[rows]
    assert np.all(np.abs(states).max(axis=0) < SMALL * spread)


@pytest.mark.parametrize("rows", ROWS.values(), ids=ROWS)
def test_a_long_step_is_predicted_ahead_like_the_short_ones(fitted, rows):
    ahead = fitted.predict_ahead(X[rows], Y[rows], steps=2)
    allowed = 2 * np.abs(fitted.predict(X) - Y).max(axis=0) + 1e-4 * np.ptp(Y, axis=0)
    assert np.all(np.abs(ahead - Y[rows]).max(axis=0) < allowed)


@pytest.mark.parametrize("name", ["residual", "sindyc"])
def test_a_gap_in_the_fit_makes_no_other_step_finer(name):
    gappy = clone(ESTIMATORS[name]).fit(X[ROWS["gap"]], Y[ROWS["gap"]])
    assert gappy.substeps_ == ESTIMATORS[name].fit(X, Y).substeps_


def test_intervals_hold_at_long_steps():
    fitted = ESTIMATORS["model"].fit(X, Y)
    whole = fitted.predict_interval(X)
    for one, other in zip(fitted.predict_interval(X[ROWS["slower"]]), whole, strict=True):
        assert one == pytest.approx(other[ROWS["slower"]], rel=1e-5, abs=1e-9)


# -- divergence ------------------------------------------------------------------------------------

UNSTABLE = PhysicsModel({"y": "V"}, {"y": "(u + y)/T"}, {"T": 0.1}, {"u": "V"}, name="unstable")
SHORT, LONG = np.arange(60) * 0.01, np.arange(700) * 0.01  # e**6, e**70
TABLE = np.column_stack([np.concatenate([SHORT, LONG, SHORT, LONG]), np.full(1520, 0.01)])
#: the machine has a controller, which the model lacks
GROWN = 0.01 * np.expm1(SHORT / 0.1)
MEASURED = np.concatenate([GROWN, np.sin(LONG), GROWN, np.sin(LONG)])
DIVERGES = (
    r"^trajectory '1': the simulation of 'unstable' diverges: 'y' is .* at t = [\d.]+ s, more than "
    r"1000 times the largest value in fit\. Remedy: .* first row\. So do those of 1 more: 3\.$"
)


def test_a_finite_divergence_does_not_spoil_the_regression_of_the_error():
    with pytest.warns(SimulationWarning, match=DIVERGES):
        fitted = ResidualRegressor(UNSTABLE).fit(TABLE, MEASURED)
    with pytest.warns(SimulationWarning, match=DIVERGES):
        found = fitted.predict(TABLE)
    assert np.abs(found).max() < 10
    assert found[:60] == pytest.approx(GROWN, abs=0.1)


def test_a_finite_divergence_of_a_fitted_model_is_told():
    rows = np.r_[:60, 760:820]
    fitted = PhysicsModelRegressor(UNSTABLE, search="local").fit(TABLE[rows], MEASURED[rows])
    with pytest.warns(SimulationWarning, match=DIVERGES):
        found = fitted.predict(TABLE)
    assert np.abs(found).max() < 10


ROOT = PhysicsModel({"y": "V"}, {"y": "(u - sqrt(y))/T"}, {"T": 1.0}, {"u": "V"})
CLOCK = np.arange(100) * 0.05


def root_records(sign=1.0, n=3):
    """Return records of a model that fails where an input below zero empties it."""
    frames, outputs = [], []
    for i in range(n):
        u = 1.0 + 0.5 * np.sin((i + 1) * CLOCK)
        table = {"trajectory": f"run {i}", "t": CLOCK, "u": sign * u, "y": 1.0}
        frames.append(pd.DataFrame(table))
        outputs.append(ROOT.simulate(CLOCK, u, [1.0], substeps=4).y[:, 0])
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


def only_simulation_warning(caught):
    (warned,) = [each for each in caught if issubclass(each.category, SimulationWarning)]
    return str(warned.message)


@pytest.mark.parametrize(
    "estimator",
    [
        ResidualRegressor(ROOT),
        PhysicsModelRegressor(ROOT, search="local"),
        SINDYcRegressor(ROOT, library="model"),
    ],
    ids=lambda each: type(each).__name__,
)
def test_all_that_fails_ahead_is_one_warning_and_leaves_no_nan(estimator):
    fitted, (empty, y) = estimator.fit(*root_records()), root_records(-1.0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = fitted.predict_ahead(empty, -y, steps=3)
    message = only_simulation_warning(caught)
    assert message.startswith("trajectory 'run 0': the simulation of ")
    assert "became non-finite at t = 0.6 s (sample 12" in message
    assert message.endswith(" more simulations failed in the same call.")
    assert np.isfinite(found).all()


@pytest.mark.parametrize("structure", ["auto", "increment"])
def test_all_that_fails_in_a_network_is_one_warning(structure):
    options = {"module__neurons": 3, "max_epochs": 2, "refine": None}
    net, (empty, y) = PGNNLRegressor(ROOT, structure=structure, **options), root_records(-1.0)
    net.fit(*root_records())
    for call in (net.predict, net.predict_states):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            call(empty)
        message = only_simulation_warning(caught)
        assert message.startswith("trajectory 'run 0': ")
        assert message.endswith("2 more simulations failed in the same call.")
    net = PGNNLRegressor(ROOT, structure="auto", guide=None, **options)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        net.fit(empty.drop(columns="y"), -y)
    assert "more simulations failed in the same call." in only_simulation_warning(caught)
