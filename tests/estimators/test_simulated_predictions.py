"""Free runs, states and predictions ahead of all that simulates; what fails is one warning."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression

from sklearn_pgnn import (
    GreyBoxRegressor,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
    SINDYcRegressor,
    make_pgnn_pipeline,
    network,
)
from sklearn_pgnn.estimators.network.step_network import piece_run
from sklearn_pgnn.estimators.simulated_predictions import one_simulation_warning
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.simulation.simulate import SMALL

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "force - 9*x - d*v"},
    {"d": 0.5},
    {"force": "N"},
    outputs={"position": "x"},
)
QUICK = {"module__neurons": 3, "max_epochs": 2, "refine": None, "substeps": 1}


def records(n, samples, dt, slowness):
    """Return records and states of the cart, the rows of its trajectories interleaved."""
    frames, outputs, states, t = [], [], [], dt * np.arange(samples)
    for i in range(n):
        force = 4 * np.sin((i + 1) * t**2 / slowness)
        run = CART.simulate(t, force, [0.1 * i, 0.0])
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.1 * i, "v": 0}))
        outputs.append(run.y[:, 0])
        states.append(run.x)
    order = np.random.default_rng(0).permutation(n * samples)
    order = order[np.lexsort((np.tile(t, n)[order],))]
    X = pd.concat(frames, ignore_index=True).iloc[order]
    return X, np.concatenate(outputs)[order], np.concatenate(states)[order]


X, Y, _ = records(2, 50, 0.06, 3)
FIRSTS = X.groupby("trajectory").cumcount().to_numpy()

# -- states ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        GreyBoxRegressor(CART, depths=("fitted",)),
        SINDYcRegressor(CART, degree=1),
        PGNNLRegressor(CART, module__neurons=3, max_epochs=3, refine=None),
        ResidualRegressor(CART),
    ],
    ids=lambda each: type(each).__name__,
)
def test_the_states_are_those_behind_the_outputs(estimator):
    X, y, states = records(3, 500, 0.02, 8)
    found = estimator.fit(X, y).predict_states(X)
    assert found.shape == states.shape
    assert np.allclose(found[:, 0], estimator.predict(X), atol=1e-6)
    assert np.sqrt(np.mean((found - states) ** 2)) < 0.05 * states.std()


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        ResidualRegressor(CART),
        SINDYcRegressor(CART, degree=1),
        PGNNLRegressor(CART, **QUICK),
    ],
    ids=lambda each: type(each).__name__,
)
def test_predictions_have_the_rows_of_the_table_and_the_shape_of_y(estimator):
    for y in (Y, pd.Series(Y, X.index), Y[:, None], pd.DataFrame({"position": Y}, X.index)):
        fitted = clone(estimator).fit(X, y)
        assert fitted.predict(X).shape == y.shape
    order = np.lexsort((X["t"], X["trajectory"]))  # one trajectory after the other
    assert np.array_equal(fitted.predict(X.iloc[order]), fitted.predict(X)[order])
    assert fitted.feature_names_in_.tolist() == list(X.columns)


@pytest.mark.parametrize("method", ["predict_states", "predict_ahead"])
@pytest.mark.parametrize(
    ("estimator", "why"),
    [
        (SINDYcRegressor(), "have no states"),
        (PGNNLRegressor(max_epochs=2), "have no states"),
        (ResidualRegressor(), "expected a regressor with a model"),
    ],
)
def test_independent_rows_have_none(estimator, why, method):
    A = np.random.default_rng(0).normal(size=(100, 3))
    fitted, y = estimator.fit(A, A[:, :1] ** 2), () if method == "predict_states" else (A[:, :1],)
    with pytest.raises(ValueError, match=f"{method}: .*{why}"):
        getattr(fitted, method)(A, *y)


def test_a_pipeline_gives_them_by_its_last_step():
    X, y, _ = records(2, 500, 0.02, 8)
    order = np.lexsort((X["t"], X["trajectory"]))
    X, y = X.iloc[order], y[order]
    pipeline = make_pgnn_pipeline(CART, module__neurons=3, max_epochs=1, refine=None).fit(X, y)
    before = pipeline[:-1].transform(X)
    assert pipeline[-1].predict_states(before).shape == (len(X), 2)
    assert np.isfinite(pipeline[-1].predict_ahead(before, y)).all()


# -- ahead -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        GreyBoxRegressor(CART, depths=("fitted",), n_splits=2),
        ResidualRegressor(CART),
        SINDYcRegressor(CART, degree=1),
        SINDYcRegressor(CART, degree=1, discrete=True),
        PGNNLRegressor(CART, **QUICK),
        PGNNLRegressor(CART, structure="increment", **QUICK),
    ],
    ids=lambda each: type(each).__name__,
)
def test_far_ahead_is_the_free_run_and_near_ahead_is_near(estimator):
    free = estimator.fit(X, Y).predict(X)
    assert np.allclose(estimator.predict_ahead(X, Y, steps=100), free, atol=1e-12)
    found = estimator.predict_ahead(X, Y, steps=10)
    assert np.allclose(found[FIRSTS < 10], free[FIRSTS < 10], atol=1e-12)
    moved = Y + 0.5  # another plant: what is measured matters
    errors = [
        np.sqrt(np.mean((each - moved)[FIRSTS > 20] ** 2))
        for each in (estimator.predict_ahead(X, moved), free)
    ]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        ResidualRegressor(CART),
        SINDYcRegressor(CART, degree=1),
        SINDYcRegressor(CART, degree=1, discrete=True),
        PGNNLRegressor(CART, **QUICK),
    ],
    ids=lambda each: type(each).__name__,
)
def test_short_trajectories_and_those_without_y_are_the_free_run(estimator):
    free = estimator.fit(X, Y).predict(X)
    for n in (1, 3):
        first = n >= FIRSTS + 1
        assert np.allclose(estimator.predict_ahead(X[first], Y[first], steps=20), free[first])
    blind = X["trajectory"].to_numpy() == 1
    found = estimator.predict_ahead(X, np.where(blind, np.nan, Y + 0.5), steps=2)
    assert np.allclose(found[blind], free[blind], atol=1e-6)
    assert np.abs(found - free)[~blind].max() > 0.1


def test_a_hidden_state_is_refused():
    net = PGNNLRegressor(CART, module=network.Recurrent, **QUICK).fit(X, Y)
    with pytest.raises(ValueError, match="without a hidden state, got Recurrent"):
        net.predict_ahead(X, Y)


def test_the_noise_is_that_of_the_training():
    later = Y + 0.5 * np.random.default_rng(0).normal(size=Y.shape) * (FIRSTS > 30)
    for estimator in (PhysicsModelRegressor(CART, search="local"), ResidualRegressor(CART)):
        estimator.fit(X, Y)
        a, b = (estimator.predict_ahead(X, y, steps=5) for y in (Y, later))
        assert np.array_equal(a[FIRSTS <= 35], b[FIRSTS <= 35])
    told = PhysicsModelRegressor(CART, search="local", noise_std=[0.2]).fit(X, Y)
    assert told.noise_ == pytest.approx([0.2])


def test_outputs_of_a_network_ahead_are_those_of_its_prediction():
    felt = CART.replace(outputs={"felt": "2*x + 0.1*force - t/10", "v": "v", "level": "d"})
    y = np.column_stack([2 * Y, np.zeros(len(Y)), np.full(len(Y), 0.5)])
    net = PGNNLRegressor(felt, **QUICK).fit(X, y)
    free = net.predict(X)
    assert net.predict_ahead(X, y, steps=50) == pytest.approx(free, rel=1e-12, abs=1e-15)
    runs = net._read_ready(X, y)
    along = piece_run(net.module_.core, net.step_)
    states, outputs = along(runs.ready[0], runs.kept[0], 0, 1, runs.ready[0].x0)
    rows = runs.records[0].rows[:2]
    assert outputs == pytest.approx(free[rows], rel=1e-12, abs=1e-15)
    assert states == pytest.approx(net.predict_states(X)[rows], rel=1e-12, abs=1e-15)


# -- long steps ------------------------------------------------------------------------------------

SWING = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "-k*x - d*v + u"},
    {"k": 2500.0, "d": 5.0},
    {"u": "N"},
)
FINE = np.arange(480) * 0.01
SWINGS = np.column_stack([FINE, np.repeat(np.random.default_rng(0).normal(size=24), 20)])
SWUNG = SWING.simulate(FINE, SWINGS[:, 1], substeps=20).y
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
    return ESTIMATORS[request.param].fit(SWINGS, SWUNG)


@pytest.mark.parametrize("rows", ROWS.values(), ids=ROWS)
def test_a_long_step_is_integrated_like_the_short_ones(fitted, rows):
    whole, spread = fitted.predict(SWINGS)[rows], np.ptp(SWUNG, axis=0)
    assert np.all(np.abs(fitted.predict(SWINGS[rows]) - whole).max(axis=0) < SMALL * spread)
    states = fitted.predict_states(SWINGS[rows]) - fitted.predict_states(SWINGS)[rows]
    assert np.all(np.abs(states).max(axis=0) < SMALL * spread)


@pytest.mark.parametrize("rows", ROWS.values(), ids=ROWS)
def test_a_long_step_is_predicted_ahead_like_the_short_ones(fitted, rows):
    ahead = fitted.predict_ahead(SWINGS[rows], SWUNG[rows], steps=2)
    allowed = 2 * np.abs(fitted.predict(SWINGS) - SWUNG).max(axis=0) + 1e-4 * np.ptp(SWUNG, axis=0)
    assert np.all(np.abs(ahead - SWUNG[rows]).max(axis=0) < allowed)


@pytest.mark.parametrize("name", ["residual", "sindyc"])
def test_a_gap_in_the_fit_makes_no_other_step_finer(name):
    gappy = clone(ESTIMATORS[name]).fit(SWINGS[ROWS["gap"]], SWUNG[ROWS["gap"]])
    assert gappy.substeps_ == ESTIMATORS[name].fit(SWINGS, SWUNG).substeps_


def test_intervals_hold_at_long_steps():
    fitted = ESTIMATORS["model"].fit(SWINGS, SWUNG)
    whole = fitted.predict_interval(SWINGS)
    for one, other in zip(fitted.predict_interval(SWINGS[ROWS["slower"]]), whole, strict=True):
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


# -- one warning -----------------------------------------------------------------------------------


def fail(times: int) -> None:
    for k in range(times):
        warnings.warn(f"simulation {k} failed.", SimulationWarning, stacklevel=1)


def test_the_warning_is_of_the_public_category_and_nested_ones_are_counted():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with one_simulation_warning():
            for _ in range(2):
                with one_simulation_warning():
                    fail(2)
    assert [each.category for each in caught] == [SimulationWarning]
    assert str(caught[0].message).endswith(" failed. 3 more simulations failed in the same call.")


def test_what_was_warned_of_before_an_error_is_told():
    @one_simulation_warning()
    def predict():
        fail(2)
        raise ValueError("a consequence")

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(ValueError, match="a consequence"):
            predict()
    assert [str(each.message) for each in caught] == [
        "simulation 0 failed. 1 more simulation failed in the same call."
    ]


def test_the_warning_names_the_line_of_the_caller():
    @one_simulation_warning()
    def predict():
        fail(1)

    with pytest.warns(SimulationWarning) as caught:
        predict()
    assert caught[0].filename == __file__
