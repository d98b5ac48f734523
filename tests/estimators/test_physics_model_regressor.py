"""PhysicsModelRegressor: certificates of its fits, and what it works with."""

import warnings

import joblib
import numpy as np
import pandas as pd
import pytest
from far_cluster import FarCluster
from sklearn.compose import TransformedTargetRegressor
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sledge import SLEDGE, drive
from threadpoolctl import threadpool_info, threadpool_limits

from sklearn_pgnn import Parameter, PhysicsModel, PhysicsModelRegressor, systems
from sklearn_pgnn.estimators.parameter_search import Search, find_parameters
from sklearn_pgnn.exceptions import FitWarning, RecordWarning, SimulationWarning
from sklearn_pgnn.simulation.normal_equations import project
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.trajectories import read_records

CART = systems.cart_on_spring()
TRUTH = {"m": 2.3, "k": 47.0, "d": 1.2}
NOISE = 1e-3


def cart_records(truth=TRUTH, n_records=3, duration=8.0, noise=NOISE, seed=0):
    """Return records of a cart whose parameters are not the prior's."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 0.02)
    frames, outputs = [], []
    for name in range(n_records):
        force = 4 * np.sin(3 * t + name) + 3 * np.sin((5 + 2 * name) * t)
        x0 = rng.normal(size=2) * 0.05
        run = CART.with_parameters(**truth).simulate(t, force, x0, substeps=4)
        frame = pd.DataFrame({"trajectory": name, "t": t, "force": force})
        frame[["x", "v"]] = np.vstack([x0, np.full((t.size - 1, 2), np.nan)])
        frames.append(frame)
        outputs.append(run.y[:, 0] + noise * rng.standard_normal(t.size))
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


X, Y = cart_records()


@pytest.fixture(scope="module")
def fitted():
    return PhysicsModelRegressor(CART).fit(X, Y)


# -- certificates ---------------------------------------------------------------------------------


def simulate_from(model, states, name):
    rows = X[X["trajectory"] == name]
    return model.simulate(rows["t"], rows["force"], states, substeps=4).y[:, 0]


@pytest.mark.parametrize(("low", "high", "end"), [(0.1, 0.3, 0.3), (0.9, 4.0, 0.9)])
def test_a_parameter_that_ends_at_a_bound_is_warned_of_with_the_remedy(low, high, end):
    t, v = drive()
    d = {"value": (low * high) ** 0.5, "bounds": (low, high)}
    model = SLEDGE.replace(parameters={"m": 2.0, "d": d})
    said = rf"d ended at a bound \({low:g} to {high:g}\).*Remedy: widen the bounds"
    with pytest.warns(FitWarning, match=said):
        fitted = PhysicsModelRegressor(model, search="local").fit(t, v)
    assert fitted.parameters_["d"].value == pytest.approx(end)


@pytest.mark.parametrize("bounds", [(0.1, 4.0), (0.0, 4.0)])
def test_a_parameter_within_its_bounds_or_at_zero_is_not_warned_of(bounds):
    t, v = drive(SLEDGE if bounds[0] else SLEDGE.with_parameters(d=0.0))
    model = SLEDGE.replace(parameters={"m": 2.0, "d": {"value": 0.5, "bounds": bounds}})
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        PhysicsModelRegressor(model, search="local").fit(t, v)
    assert not [each for each in told if "bound" in str(each.message)]


def test_whole_trajectories_are_fitted_in_free_run():
    r"""No other parameters and initial states leave less: the gradient of the error is zero."""
    unknown = X.assign(x=np.nan, v=np.nan)
    regressor = PhysicsModelRegressor(CART, window_length="trajectory", search="local").fit(
        unknown, Y
    )
    assert regressor.window_ == pytest.approx(8.0)
    states = regressor.initial_states_
    assert states.shape == (3, 2)
    for name, true in TRUTH.items():
        found = regressor.parameters_[name]
        assert found.low <= true <= found.high
        assert found.high - found.low < 0.02 * true

    def error(model, offset=0.0):
        runs = [simulate_from(model, row + offset, k) for k, row in enumerate(states)]
        return np.mean((np.concatenate(runs) - Y) ** 2)

    least = error(regressor.model_)
    assert least == pytest.approx(NOISE**2, rel=0.1)
    for name in TRUTH:
        for factor in (0.999, 1.001):
            value = factor * regressor.parameters_[name].value
            assert error(regressor.model_.with_parameters(**{name: value})) > least
    for offset in ([1e-4, 0], [-1e-4, 0], [0, 1e-3], [0, -1e-3]):
        assert error(regressor.model_, np.array(offset)) > least


def test_a_told_start_of_a_whole_trajectory_is_held():
    """An initial state that is wrong by ten times the noise stays, and costs what it costs."""
    first = ~X["trajectory"].duplicated()
    wrong = X.assign(x=X["x"] + 10 * NOISE * first)
    regressor = PhysicsModelRegressor(CART, window_length="trajectory", search="local").fit(
        wrong, Y
    )
    np.testing.assert_allclose(regressor.initial_states_, wrong.loc[first, ["x", "v"]], atol=1e-9)
    partly = wrong.assign(x=wrong["x"].where(wrong["trajectory"] > 0))
    regressor.fit(partly, Y)
    assert np.ptp(regressor.initial_states_[:, 0] - X.loc[first, "x"]) < 3 * NOISE


def test_initial_states_are_those_that_the_records_tell(fitted):
    told = X.loc[~X["trajectory"].duplicated(), ["x", "v"]].to_numpy()
    np.testing.assert_allclose(fitted.initial_states_, told, atol=0.02)


def test_a_hidden_stretch_is_simulated_through():
    """Outputs that are NaN do not count; the free run goes on over them."""
    hidden = (X["t"] > 3) & (X["t"] < 5)
    regressor = PhysicsModelRegressor(CART, window_length="trajectory", search="local")
    regressor.fit(X, np.where(hidden, np.nan, Y))
    assert np.sqrt(np.mean((regressor.predict(X) - Y)[hidden] ** 2)) < 1.2 * NOISE


def test_recovers_the_parameters_within_narrow_intervals(fitted):
    for name, true in TRUTH.items():
        found = fitted.parameters_[name]
        reach = found.high - found.value
        assert abs(found.value - true) < 2 * reach, name
        assert 0 < reach < 0.05 * true, name
        assert found.unit == CART.parameters[name].unit
        assert fitted.model_.parameters[name].value == found.value


def test_intervals_hold_the_truth_as_often_as_they_say():
    hits = []
    for seed in range(6):
        table, y = cart_records(n_records=1, duration=12.0, seed=seed)
        found = PhysicsModelRegressor(CART, substeps=2).fit(table, y).parameters_
        hits += [found[name].low <= true <= found[name].high for name, true in TRUTH.items()]
    assert np.mean(hits) >= 0.8


def test_free_run_is_the_true_machine(fitted):
    clean = cart_records(noise=0.0)[1]
    assert np.sqrt(np.mean((fitted.predict(X) - clean) ** 2)) < NOISE
    assert fitted.score(X, Y) > 0.999


def test_gradient_vanishes_at_the_optimum():
    windowed = window_records(CART, read_records(CART, X, Y))
    found = find_parameters(Search(CART, ("m", "k", "d"), "local"), windowed)
    offset = found.fit.x0 - found.expected
    normal = project(found.fit.evaluation.gram, 3, found.spread**-2.0, offset)
    gradient, hessian = normal.gradient.sum(axis=0), normal.hessian.sum(axis=0)
    # what one more Newton step could still gain, against squares of about one a sample
    assert gradient @ np.linalg.solve(hessian, gradient) < 1e-6 * found.fit.squares


def test_no_other_values_fit_better(fitted):
    def left(**values):
        near = CART.with_parameters(**values)
        windowed = window_records(near, read_records(CART, X, Y), substeps=fitted.substeps_)
        return find_parameters(Search(near, (), "local"), windowed).fit.objective

    best = {name: each.value for name, each in fitted.parameters_.items()}
    least = left(**best)
    for name, value in best.items():
        assert left(**{**best, name: 1.02 * value}) > least
        assert left(**{**best, name: 0.98 * value}) > least


def test_local_fit_survives_a_start_three_times_off():
    far = CART.with_parameters(m=6.0, k=15.0, d=4.0)
    found = PhysicsModelRegressor(far, search="local").fit(X, Y).parameters_
    assert found["k"].value == pytest.approx(TRUTH["k"], rel=0.02)


#: a resonator shaken at a frequency that is a parameter: the error has a minimum at every beat
SHAKEN = PhysicsModel(
    states={"x": "m", "v": "m/s"},
    equations={"x": "v", "v": "w**2*(A*sin(q*t) - x) - 0.2*w*v"},
    outputs={"position": "x"},
    parameters=[
        Parameter("w", 3.0, unit="rad/s", bounds=(0.5, 30.0)),
        Parameter("A", 1.0, unit="m", bounds=(0.1, 5.0)),
        Parameter("q", 2.0, unit="rad/s", bounds=(0.3, 20.0)),
    ],
)


@pytest.fixture(scope="module")
def shaken():
    t = np.arange(0, 20, 0.04)
    run = SHAKEN.with_parameters(w=9.0, q=6.0).simulate(t, None, [0.5, 0.0], substeps=4)
    return t[:, None], run.y + 1e-3 * np.random.default_rng(0).standard_normal(run.y.shape)


@pytest.mark.slow
def test_global_search_finds_what_a_local_fit_misses(shaken):
    local = PhysicsModelRegressor(SHAKEN, search="local", window_length=4.0).fit(*shaken)
    found = PhysicsModelRegressor(SHAKEN, search="auto", window_length=4.0).fit(*shaken)
    assert abs(local.model_.parameters["q"].value - 6.0) > 1.0
    for name, true in {"w": 9.0, "A": 1.0, "q": 6.0}.items():
        assert found.model_.parameters[name].value == pytest.approx(true, rel=2e-3), name
    assert found.score(*shaken) > local.score(*shaken)
    again = PhysicsModelRegressor(SHAKEN, search="auto", window_length=4.0).fit(*shaken)
    assert again.parameters_ == found.parameters_


@pytest.mark.parametrize("state", [0, np.random.RandomState(0), None])
def test_any_random_state_draws_the_global_search(state):
    few = X["trajectory"] == 0
    local, found = (
        PhysicsModelRegressor(CART, free=["k"], search=search, random_state=state)
        for search in ("local", "global")
    )
    best = local.fit(X[few], Y[few]).parameters_["k"].value
    assert found.fit(X[few], Y[few]).parameters_["k"].value == pytest.approx(best, rel=1e-6)


def test_only_what_is_free_moves(fitted):
    some = PhysicsModelRegressor(CART, free=["k"]).fit(X, Y)
    assert list(some.parameters_) == ["k"]
    assert some.model_.parameters["m"] == CART.parameters["m"]
    known = CART.with_parameters(m=Parameter("m", 2.3, "kg", (0.1, 50.0), fixed=True))
    rest = PhysicsModelRegressor(known).fit(X, Y)
    assert list(rest.parameters_) == ["k", "d"]
    none = PhysicsModelRegressor(CART, free=()).fit(X, Y)
    assert none.parameters_ == {}
    assert none.model_ == CART.replace(simulation=none.model_.simulation)


def test_states_that_nothing_shows_are_simulated():
    tanks = systems.two_tanks()
    t = np.arange(0, 600, 1.0)
    pump = 3 + 1.5 * np.sign(np.sin(0.03 * t)) + 0.5 * np.sin(0.11 * t)
    level = tanks.with_parameters(k4=0.044).simulate(t, pump).y
    level = level + 0.01 * np.random.default_rng(0).standard_normal(level.shape)
    found = PhysicsModelRegressor(tanks, free=["k4"]).fit(np.column_stack([t, pump]), level)
    assert found.parameters_["k4"].value == pytest.approx(0.044, rel=0.03)


def test_what_the_records_cannot_fix_is_named():
    motor = PhysicsModel(
        {"w": "rad/s"}, {"w": "(K*u - F*w)/J"},
        [Parameter(n, v) for n, v in {"K": 0.5, "F": 0.1, "J": 0.2}.items()], {"u": "V"},
    )  # fmt: skip
    t = np.arange(0, 30, 0.02)
    u = np.sign(np.sin(0.7 * t)) + np.sin(2.3 * t)
    w = motor.with_parameters(K=0.55).simulate(t, u).y
    w = w + 1e-3 * np.random.default_rng(0).standard_normal(w.shape)
    with pytest.warns(FitWarning, match="the records do not determine K, F, J: other values"):
        regressor = PhysicsModelRegressor(motor).fit(np.column_stack([t, u]), w)
    assert all(np.isinf(each.high - each.low) for each in regressor.parameters_.values())
    values = {name: each.value for name, each in regressor.parameters_.items()}
    assert values["K"] / values["J"] == pytest.approx(0.55 / 0.2, rel=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PhysicsModelRegressor(motor, free=["K", "F"]).fit(np.column_stack([t, u]), w)


def test_gaps_in_the_outputs_are_skipped():
    holes = Y.copy()
    holes[50:60] = np.nan
    holes[300] = np.nan
    found = PhysicsModelRegressor(CART).fit(X, holes).parameters_
    assert found["k"].value == pytest.approx(TRUTH["k"], rel=0.02)


def test_diverging_prediction_warns():
    runaway = PhysicsModel({"x": "m"}, {"x": "k*x**2"}, {"k": 0.1}, initial_state={"x": 1.0})
    t = np.arange(0, 5, 0.05)
    regressor = PhysicsModelRegressor(runaway).fit(t[:, None], 1 / (1 - 0.1 * t))
    with pytest.warns(SimulationWarning, match="Remedy"):
        regressor.predict(np.arange(0, 20, 0.05)[:, None])


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"free": ["q"]}, "free: expected parameters among m, k, d, got 'q'."),
        ({"search": "swarm"}, "search: expected one of local, global, auto, got 'swarm'."),
    ],
)
def test_bad_options_are_named(options, text):
    with pytest.raises(ValueError, match=text):
        PhysicsModelRegressor(CART, **options).fit(X, Y)


# -- with scikit-learn ----------------------------------------------------------------------------


def test_fit_leaves_everything_alone():
    table, y, regressor = X.copy(), Y.copy(), PhysicsModelRegressor(CART)
    before, text = regressor.get_params(), CART.to_dict()
    regressor.fit(table, y)
    pd.testing.assert_frame_equal(table, X)
    assert np.array_equal(y, Y)
    assert CART.to_dict() == text
    assert all(regressor.get_params()[key] is value for key, value in before.items())


def test_threads_change_no_number(fitted):
    assert PhysicsModelRegressor(CART, n_jobs=2).fit(X, Y).parameters_ == fitted.parameters_


def test_a_fit_on_a_cluster_uses_one_thread_and_linear_algebra_one_too(monkeypatch, fitted):
    seen = []

    def watched(*args, **options):
        libraries = threadpool_info()
        seen.append((options["threads"], {library["num_threads"] for library in libraries}))
        return window_records(*args, **options)

    monkeypatch.setattr("sklearn_pgnn.estimators.physics_model_regressor.window_records", watched)
    with joblib.parallel_config(backend=FarCluster()), threadpool_limits(2):
        assert PhysicsModelRegressor(CART).fit(X, Y).parameters_ == fitted.parameters_
    assert seen == [(1, {1})]


@pytest.mark.parametrize("window_length", [None, "trajectory"])
def test_verbose_prints_the_stages(window_length, capsys):
    PhysicsModelRegressor(CART, window_length=window_length).fit(X, Y)
    assert capsys.readouterr().out == ""
    PhysicsModelRegressor(CART, window_length=window_length, verbose=1).fit(X, Y)
    lines = capsys.readouterr().out.splitlines()
    assert all(line.startswith("[PhysicsModelRegressor] ") for line in lines)
    assert "3 trajectories, 1200 samples" in lines[0]
    assert "free: m, k, d" in lines[0]
    stages = ["fit from the model's values"] + ["fit to whole trajectories"] * (
        window_length is not None
    )
    for line, stage in zip(lines[1:], stages, strict=True):
        assert stage in line
        assert 0.8 < float(line.split("error ")[1].split()[0]) < 1.2  # the noise is left


def test_verbose_prints_the_generations_of_a_search(capsys):
    few = X["trajectory"] == 0
    regressor = PhysicsModelRegressor(CART, free=["k"], search="global", verbose=1)
    regressor.fit(X[few], Y[few])
    lines = capsys.readouterr().out.splitlines()
    assert "generation 1 of at most" in lines[2]
    assert "fit from the best values between the bounds: error " in lines[-1]


def test_searches_and_scores():
    folds = list(GroupKFold(3).split(X, Y, X["trajectory"]))
    regressor = PhysicsModelRegressor(CART, search="local", substeps=1)
    assert cross_val_score(regressor, X, Y, cv=folds).min() > 0.99
    search = GridSearchCV(regressor, {"free": [["d"], ["m", "k", "d"]]}, cv=folds).fit(X, Y)
    assert search.best_params_["free"] == ["m", "k", "d"]


def test_millimetres_by_a_transformed_target():
    scaled = TransformedTargetRegressor(
        PhysicsModelRegressor(CART, search="local"),
        func=lambda y: y / 1000,
        inverse_func=lambda y: y * 1000,
    )
    scaled.fit(X, 1000 * Y)
    assert scaled.score(X, 1000 * Y) > 0.999


# -- within the spread -----------------------------------------------------------------------------


def test_parameters_stay_within_their_spread():
    with pytest.warns(UserWarning, match="k, d ended at a limit of the spread or bounds"):
        held = PhysicsModelRegressor(CART, within_spread=True, search="local").fit(X, Y)
    for name, prior in CART.parameters.items():
        assert abs(held.model_.parameters[name].value - prior.value) <= prior.reach * (1 + 1e-12)


def test_an_infinite_spread_is_none(fitted):
    loose = [parameter.with_spread(np.inf) for parameter in CART.parameters.values()]
    model = CART.replace(parameters=loose)
    found = PhysicsModelRegressor(model, within_spread=True).fit(X, Y)
    for name, each in found.parameters_.items():
        assert each.value == pytest.approx(fitted.parameters_[name].value, rel=1e-9)


def test_what_its_spread_does_not_let_move_is_refused_or_left():
    still = [*CART.parameters.values(), Parameter("bias", 0.0)]
    rates = {"x": "v", "v": "(force + bias - d*v - k*x)/m"}
    model = CART.replace(parameters=still, equations=rates)
    options = {"within_spread": True, "search": "local"}
    with pytest.raises(ValueError, match="spread=inf for it in the model"):
        PhysicsModelRegressor(model, free=["bias"], **options).fit(X, Y)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert "bias" not in PhysicsModelRegressor(model, **options).fit(X, Y).parameters_


# -- initial states that no table gives -----------------------------------------------------------


def records_from(start, n_records=1, noise=0.01):
    """Return records without states, of a lightly damped cart that begins anywhere."""
    rng, t = np.random.default_rng(0), np.arange(0, 4, 0.02)
    frames, outputs = [], []
    for name in range(n_records):
        force = np.sin(2 * t + name)
        x0 = start if start is not None else rng.normal(size=2) * [1.0, 3.0]
        frames.append(pd.DataFrame({"trajectory": name, "t": t, "force": force}))
        y = CART.with_parameters(**TRUTH).simulate(t, force, x0, substeps=4).y[:, 0]
        outputs.append(y + noise * rng.standard_normal(t.size))
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


def test_an_initial_state_that_was_fitted_is_used_by_predictions():
    table, y = records_from([0.5, 0.0])
    regressor = PhysicsModelRegressor(CART, window_length="trajectory").fit(table, y)
    assert regressor.score(table, y) > 0.99
    assert regressor.model_.initial_state["x"] == pytest.approx(0.5, abs=0.05)


def test_an_initial_state_that_the_table_gives_leaves_that_of_the_model():
    table, y = records_from([0.5, 0.0])
    regressor = PhysicsModelRegressor(CART).fit(table.assign(x=0.5, v=0.0), y)
    assert dict(regressor.model_.initial_state) == dict(CART.initial_state)


def test_a_machine_at_rest_starts_exactly_there():
    table, y = records_from([0.0, 0.0], n_records=4)
    regressor = PhysicsModelRegressor(CART).fit(table, y)
    assert dict(regressor.model_.initial_state) == {"x": 0.0, "v": 0.0}


def test_an_interval_accounts_for_initial_states_that_nobody_knows():
    table, y = records_from(None, n_records=6)
    with pytest.warns(RecordWarning, match="no initial state"):
        regressor = PhysicsModelRegressor(CART).fit(table, y)
    low, high = regressor.predict_interval(table)
    assert np.mean((low <= y) & (y <= high)) == pytest.approx(0.9, abs=0.02)
