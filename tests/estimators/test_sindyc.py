"""SINDYcRegressor: known systems found again, and what it promises about records."""

import copy
import sys
import warnings
from itertools import product

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete
from sklearn.linear_model import Lasso
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.utils.estimator_checks import parametrize_with_checks

from sklearn_pgnn import (
    PhysicsModel,
    PhysicsModelRegressor,
    SINDYcRegressor,
    datasets,
    systems,
)
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.datasets.rig import make_tables
from sklearn_pgnn.estimators.sindyc_library import (
    model_terms,
    read_library,
    sparse_coefficients,
    stepwise_least_squares,
    term_function,
    term_texts,
)
from sklearn_pgnn.estimators.sindyc_records import measure_states, rate_rows, step_rows
from sklearn_pgnn.exceptions import RecordError, RecordWarning, SimulationWarning
from sklearn_pgnn.simulation.simulate import simulate_records
from sklearn_pgnn.trajectories import read_records

pysindy = pytest.importorskip("pysindy")

LAG = PhysicsModel(
    {"y": "V"}, {"y": "(K*u - y)/T"}, {"K": 3.0, "T": 0.5}, {"u": "V"}, {"measured": "y"}
)
PENDULUM = PhysicsModel(
    states={"phi": "rad", "omega": "rad/s"},
    inputs={"torque": "N m"},
    outputs={"angle": "phi"},
    parameters={"G": 12.0, "d": 0.4, "F": 0.8, "b": 5.0},
    equations={
        "phi": "omega",
        "omega": "-G*sin(phi) - d*omega - F*sign(omega) + b*torque",
    },
)
SPRING = PhysicsModel(
    states={"x": "m", "v": "m/s"},
    inputs={"force": "N"},
    outputs={"position": "x"},
    parameters={"k": 9.0, "d": 0.5, "c": 4.0},
    equations={"x": "v", "v": "force - k*x - d*v - c*x**3"},
)


def waves(t, n_records, amplitude, seed=0):
    """Return one input: three sines, with other frequencies in every record."""
    rng = np.random.default_rng(seed)
    f = rng.uniform(0.2, 1.5, (n_records, 3, 1))
    return amplitude * np.sin(2 * np.pi * (f * t + rng.uniform(size=f.shape))).sum(1)[..., None]


def records_of(model, n_records=3, duration=8.0, rate=200.0, amplitude=1.0, noise=0.0, seed=0):
    """Return X, y and the true states of a model, from the independent integrator."""
    t = np.arange(round(duration * rate)) / rate
    u = waves(t, n_records, amplitude, seed)
    x0 = np.random.default_rng(seed).normal(size=(n_records, len(model.states))) * 0.2
    x, y = integrate(model, t, u, x0)
    y = y + noise * np.random.default_rng(seed + 1).standard_normal(y.shape)
    return (*make_tables(model, t, u, x0, y), x)


def coefficients(fitted, state):
    """Return the nonzero coefficients of a state, by term."""
    row = fitted.coefficients_[list(fitted.model_.states).index(state)]
    return {term: value for term, value in zip(fitted.terms_, row, strict=True) if value}


def rms(error):
    return float(np.sqrt(np.mean(np.square(np.asarray(error)))))


SPRING_X, SPRING_Y, SPRING_STATES = records_of(SPRING, amplitude=2.0, noise=1e-3)


@pytest.fixture(scope="module")
def spring():
    return SINDYcRegressor(SPRING, degree=3).fit(SPRING_X, SPRING_Y)


# -- known systems ---------------------------------------------------------------------------------


def test_finds_a_lag_from_its_output():
    X, y, _ = records_of(LAG)
    found = coefficients(SINDYcRegressor(LAG).fit(X, y), "y")
    assert found == pytest.approx({"y": -2.0, "u": 6.0}, rel=1e-4)


def test_finds_a_pendulum_with_friction_in_the_terms_of_a_wrong_model():
    wrong = PENDULUM.with_parameters(G=7.0, d=1.5, F=0.1, b=2.0)
    X, y, _ = records_of(PENDULUM, n_records=4)
    fitted = SINDYcRegressor(wrong, library="model").fit(X, y)
    truth = {"omega": -0.4, "torque": 5.0, "sin(phi)": -12.0, "sign(omega)": -0.8}
    assert coefficients(fitted, "omega") == pytest.approx(truth, rel=2e-3)
    assert coefficients(fitted, "phi") == {"omega": 1.0}


def test_finds_a_hardening_spring_among_all_cubics(spring):
    truth = {"x": -9.0, "v": -0.5, "force": 1.0, "x**3": -4.0}
    assert coefficients(spring, "v") == pytest.approx(truth, rel=0.05)
    clean = SPRING_STATES[:, :, :1].reshape(-1, 1)
    assert rms(spring.predict(SPRING_X) - clean) < 0.02 * rms(clean)


def test_finds_the_map_of_a_sampled_linear_system():
    a, b = np.array([[0.0, 1.0], [-20.0, -1.5]]), np.array([[0.0], [8.0]])
    T = 0.02
    A, B = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), T)[:2]
    rng = np.random.default_rng(3)
    frames, outputs = [], []
    for name in "ab":
        u = np.repeat(rng.normal(size=40), 10)
        x = [rng.normal(size=2)]
        for value in u[:-1]:
            x.append(A @ x[-1] + B[:, 0] * value)
        frames.append(pd.DataFrame({"trajectory": name, "t": T * np.arange(400), "u": u}))
        outputs.append(pd.DataFrame(x, columns=["p", "q"]))
    X, y = pd.concat(frames, ignore_index=True), pd.concat(outputs, ignore_index=True)
    X[["p", "q"]] = y.where(X["t"] == 0)
    fitted = SINDYcRegressor(discrete=True, degree=1, threshold=1e-3).fit(X, y)
    assert fitted.terms_ == ["1", "p", "q", "u"]
    found = fitted.coefficients_
    np.testing.assert_allclose(found[:, 1:], np.column_stack([A, B]), atol=5e-4)
    np.testing.assert_array_equal(found[:, 0], 0.0)
    np.testing.assert_allclose(fitted.predict(X), y, atol=0.01 * rms(y))


@pytest.mark.parametrize("library", ["polynomial", ["model", "sign(v)", "x*abs(v)"]])
def test_an_euler_step_of_a_sample_is_exactly_the_map(library):
    fitted = SINDYcRegressor(SPRING, library=library, discrete=True, threshold=0.0)
    model = fitted.fit(SPRING_X, SPRING_Y).model_
    names, T = ["x", "v", "force"], 1 / 200
    terms = read_library(fitted.terms_, names)
    points = np.random.default_rng(0).normal(size=(20, 3))
    # near rest, dry friction between the samples would make the machine stick
    points[10:, 1] *= 1e-6
    values = term_function(terms, names)(points)
    for (x, v, force), psi in zip(points, values, strict=True):
        run = model.simulate([0, T], [force, force], [x, v], method="euler")
        np.testing.assert_allclose(run.x[1], fitted.coefficients_ @ psi, rtol=1e-11, atol=1e-13)


def test_identifies_behind_a_known_delay():
    late = LAG.replace(
        parameters={"K": 3.0, "T": 0.5, "tau": {"value": 0.043, "unit": "s"}}, delays={"u": "tau"}
    )
    X, y, _ = records_of(late)
    fitted = SINDYcRegressor(late, library="model").fit(X, y)
    assert coefficients(fitted, "y") == pytest.approx({"y": -2.0, "u": 6.0}, rel=1e-3)
    assert fitted.model_.delays == {"u": "tau"}
    assert fitted.model_.parameters["tau"].fixed
    assert rms(fitted.predict(X) - y) < 1e-3 * rms(y)


def test_states_without_a_model_are_the_columns_of_y():
    X, _, x = records_of(SPRING, amplitude=2.0)
    X = X.rename(columns={"x": "x [m]", "v": "v [m/s]", "force": "force [N]"})
    y = pd.DataFrame(x.reshape(-1, 2), columns=["x [m]", "v [m/s]"])
    fitted = SINDYcRegressor(degree=3).fit(X, y)
    assert coefficients(fitted, "x_m") == pytest.approx({"v_m_s": 1.0}, rel=1e-3)
    truth = {"x_m": -9.0, "v_m_s": -0.5, "force_N": 1.0, "x_m**3": -4.0}
    assert coefficients(fitted, "v_m_s") == pytest.approx(truth, rel=5e-3)
    assert fitted.score(X, y) > 0.9999
    assert fitted.model_.columns["force_N"] == "force [N]"


def test_an_array_with_a_time_has_inputs_beside_it():
    X, _, x = records_of(LAG, n_records=2)
    array, states = X[["u", "t"]].to_numpy(), x.reshape(-1, 1)
    fitted = SINDYcRegressor(time_column=1).fit(array, states)
    assert coefficients(fitted, "x0") == pytest.approx({"x0": -2.0, "u0": 6.0}, rel=1e-4)
    # nobody says where a trajectory starts: at the mean of the starts
    assert fitted.predict(array)[0, 0] == pytest.approx(x[:, 0, 0].mean(), abs=1e-3)


def test_independent_rows_are_a_static_regression():
    rng = np.random.default_rng(0)
    X = pd.DataFrame(rng.normal(size=(200, 3)), columns=["a", "model", "width (cm)"])
    y = 2 + 3 * X["a"] * X["model"] - X["width (cm)"] ** 2
    fitted = SINDYcRegressor(threshold=0.02).fit(X, y)
    found = dict(zip(fitted.terms_, fitted.coefficients_[0], strict=True))
    found = {term: value for term, value in found.items() if value}
    assert found == pytest.approx({"1": 2.0, "a*model": 3.0, "width_cm**2": -1.0})
    assert fitted.equations_ == ["y0 = 2 + 3*a*model - width_cm**2"]
    assert fitted.model_ is None
    np.testing.assert_allclose(fitted.predict(X), y)


# -- what a threshold means ------------------------------------------------------------------------


def test_units_do_not_change_what_is_found(spring):
    milli = PhysicsModel(
        states={"x": "mm", "v": "mm/s"},
        inputs={"force": "kN"},
        outputs={"position": "x"},
        equations={"x": "v", "v": "0*x"},
    )
    X = SPRING_X.assign(x=1e3 * SPRING_X["x"], v=1e3 * SPRING_X["v"], force=SPRING_X["force"] / 1e3)
    found = coefficients(SINDYcRegressor(milli, degree=3).fit(X, 1e3 * SPRING_Y), "v")
    expected = coefficients(spring, "v")
    expected["force"] *= 1e6
    expected["x**3"] *= 1e-6
    assert found == pytest.approx(expected, rel=1e-6)


def test_a_term_below_its_share_is_dropped():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(5000, 2)) * [1e3, 1e-3]
    y = X[:, 0] / 1e3 + 0.05 * 1e3 * X[:, 1]  # shares of 1 and 0.05
    kept = {
        threshold: int(np.sum(SINDYcRegressor(threshold=threshold).fit(X, y).coefficients_ != 0))
        for threshold in (0.04, 0.06)
    }
    assert kept == {0.04: 2, 0.06: 1}


def test_rates_over_spans_are_less_noise_than_from_sample_to_sample(spring):
    near = SINDYcRegressor(SPRING, degree=3, span=0).fit(SPRING_X, SPRING_Y)
    truth = {"x": -9.0, "v": -0.5, "force": 1.0, "x**3": -4.0}

    def worst(fitted):
        found = coefficients(fitted, "v")
        return max(abs(found[term] / value - 1) for term, value in truth.items())

    assert worst(spring) < 0.5 * worst(near)


# -- records ---------------------------------------------------------------------------------------


def test_no_row_reaches_from_one_trajectory_to_another():
    t = np.linspace(0, 1, 51)
    levels = np.repeat([5.0, -5.0, 40.0], t.size)
    X = pd.DataFrame({"t": np.tile(t, 3), "u": 0.0})
    model = PhysicsModel({"y": "V"}, {"y": "0*y"}, {}, {"u": "V"})
    states = measure_states(model, read_records(model, X, levels))
    for rows, span in product((rate_rows, step_rows), (0.0, 0.1, 100.0)):
        terms, rates = rows(states, lambda x, u, t: x, span)
        np.testing.assert_allclose(rates, 0.0, atol=1e-9)
        assert set(np.round(terms.ravel(), 6)) == {5.0, -5.0, 40.0}
        assert len(terms) % 3 == 0


SPRINGS = {"x": "v", "v": "-30*x - 0.6*v + u - 4*x**3"}
LAGS = {"a": "2*(u - a)", "b": "a - b"}


def every_twentieth(rates, outputs, amplitude, **options):
    """Return a fit to records in which the second sensor is read at every twentieth sample."""
    model = PhysicsModel(dict.fromkeys(rates, ""), rates, {}, {"u": ""}, outputs=outputs)
    t = np.arange(2000) * 0.02
    u = amplitude * np.repeat(np.random.default_rng(0).normal(size=100), 20)
    y, X = model.simulate(t, u, substeps=8).y, pd.DataFrame({"t": t, "u": u})
    measured = y.copy()
    measured[np.arange(2000) % 20 != 0, 1] = np.nan
    return SINDYcRegressor(model, **options).fit(X, measured), X, y


@pytest.mark.parametrize(
    "outputs", [{"x": "x", "v": "v"}, {"p": "x", "q": "x"}], ids=["velocity", "second position"]
)
def test_a_slow_sensor_beside_a_fast_one_spoils_nothing(outputs):
    fitted, X, y = every_twentieth(SPRINGS, outputs, 16.0, degree=3)
    assert r2_score(y, fitted.predict(X)) > 0.999
    assert set(coefficients(fitted, "v")) == {"x", "v", "u", "x**3"}


def test_rates_behind_a_slow_sensor_are_taken_between_its_samples():
    fitted, X, y = every_twentieth(LAGS, {"a": "a", "b": "b"}, 2.0, threshold=0.05)
    assert coefficients(fitted, "b") == pytest.approx({"a": 1.0, "b": -1.0}, rel=0.02)
    assert r2_score(y, fitted.predict(X)) > 0.9999


def test_spans_end_at_allowed_samples_only():
    t = np.linspace(0, 1, 51)
    model = PhysicsModel({"y": "V"}, {"y": "0*y"}, {}, {"u": "V"})
    states = measure_states(model, read_records(model, np.column_stack([t, 0 * t]), t**2))
    ends = np.isin(np.arange(51), [3, 10, 12, 40])
    for rows, unit in ((rate_rows, 1.0), (step_rows, 50.0)):
        terms, rates = rows(states, lambda x, u, t: x, 0.1, ends)  # five samples
        begun, ended = t[[3, 10, 12]], t[[10, 40, 40]]
        assert rates[:, 0] * unit == pytest.approx(begun + ended, abs=1e-5)
        assert len(terms) == 3


@pytest.mark.parametrize("with_model", [True, False])
@pytest.mark.parametrize("discrete", [True, False])
def test_states_after_the_first_row_do_not_matter(with_model, discrete):
    X, y, x = records_of(SPRING, n_records=2, duration=3.0, rate=100.0)
    known, poisoned = X.copy(), X.copy()
    known[["x", "v"]] = x.reshape(-1, 2)
    assert poisoned[["x", "v"]].isna().sum().min() == len(X) - 2
    y = y if with_model else known[["x", "v"]]
    model = SPRING if with_model else None
    one = SINDYcRegressor(model, discrete=discrete).fit(known, y)
    other = SINDYcRegressor(model, discrete=discrete).fit(poisoned, y)
    np.testing.assert_array_equal(one.predict(known), other.predict(poisoned))
    np.testing.assert_array_equal(one.predict(poisoned), one.predict(known))


def test_gaps_uneven_clocks_and_missing_outputs_are_legal():
    X, y, _ = records_of(SPRING, amplitude=2.0)
    rng = np.random.default_rng(0)
    kept = (rng.uniform(size=len(X)) > 0.1) & ~X["t"].between(3, 3.5) | (X["t"] == 0)
    X, y = X[kept], y[kept].copy()
    # the input acts as the records say: constant pieces, longer ones than before
    run = [SPRING.simulate(g["t"], g["force"], g[["x", "v"]].iloc[0], substeps=8).y
           for _, g in X.groupby("trajectory")]  # fmt: skip
    y["position"] = np.concatenate(run)
    y.iloc[7::11] = np.nan
    fitted = SINDYcRegressor(SPRING, degree=3).fit(X, y)
    truth = {"x": -9.0, "v": -0.5, "force": 1.0, "x**3": -4.0}
    assert coefficients(fitted, "v") == pytest.approx(truth, rel=0.02)


@pytest.mark.slow
def test_records_of_other_sampling_rates_go_together():
    slow, fast = records_of(LAG, rate=100.0), records_of(LAG, rate=400.0, seed=1)
    slow[0]["trajectory"] += 10
    X, y = pd.concat([slow[0], fast[0]]), pd.concat([slow[1], fast[1]])
    found = coefficients(SINDYcRegressor(LAG).fit(X, y), "y")
    assert found == pytest.approx({"y": -2.0, "u": 6.0}, rel=1e-3)


# -- libraries and optimizers ----------------------------------------------------------------------


def test_terms_of_a_model_stand_without_their_factors():
    assert term_texts(model_terms(systems.golf_robot())) == [
        "phi",
        "omega",
        "torque",
        "sin(phi)",
        "sign(omega)*max(0, 0.24643182*omega**2 + 5.141421*cos(phi))",
    ]
    assert term_texts(model_terms(systems.two_tanks())) == [
        "x1", "x2", "pump", "sqrt(max(0, x1))", "sqrt(max(0, x2))",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("library", "names"),
    [
        (pysindy.PolynomialLibrary(degree=2), "polynomial"),
        (pysindy.FourierLibrary(), "fourier"),
        (pysindy.IdentityLibrary() + pysindy.FourierLibrary(), ["x", "u", "trigonometric"]),
        (
            pysindy.CustomLibrary([lambda a, b: a * np.exp(b)], [lambda a, b: f"{a} exp({b})"]),
            "x*exp(u)",
        ),
    ],
)
def test_a_library_of_pysindy_is_read_and_left_alone(library, names):
    before = copy.deepcopy(vars(library))
    assert read_library(library, ["x", "u"]) == read_library(names, ["x", "u"])
    assert vars(library).keys() == before.keys()
    assert not hasattr(library, "n_output_features_")


def test_an_optimizer_of_the_user_is_cloned_and_gives_physical_units():
    optimizer = pysindy.SR3(reg_weight_lam=1e-3)
    before = copy.deepcopy(vars(optimizer))
    X, y, _ = records_of(LAG)
    fitted = SINDYcRegressor(LAG, library="model", optimizer=optimizer).fit(X, y)
    assert fitted.optimizer is optimizer
    assert repr(vars(optimizer)) == repr(before)
    assert coefficients(fitted, "y") == pytest.approx({"y": -2.0, "u": 6.0}, rel=1e-3)


def test_the_same_as_pysindy_on_the_same_rows():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 2))
    X /= np.sqrt(np.mean(X**2, axis=0))
    y = X @ [[1.0, 0.2], [0.01, -1.0]] + 0.1 * rng.normal(size=(300, 2))
    y /= y.std(axis=0)
    theirs = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=0.1, alpha=0.3),
        feature_library=pysindy.IdentityLibrary(),
    ).fit(X, t=np.arange(300.0), x_dot=y)
    ours = SINDYcRegressor(library=["x0", "x1"], threshold=0.1, alpha=0.3 / 300).fit(X, y)
    np.testing.assert_allclose(ours.coefficients_, theirs.coefficients(), rtol=1e-10)
    assert (ours.coefficients_ == 0).sum() == 1


def test_a_triangle_of_the_rows_gives_the_same_coefficients():
    n_rows, degree = 4000, 3
    terms = term_function(
        read_library("polynomial", ["x", "v", "force"], degree), ["x", "v", "force"]
    )(np.random.default_rng(0).normal(size=(n_rows, 3)) * [0.1, 5.0, 30.0])
    targets = terms[:, 1:3] @ [[3.0, 0.0], [-0.2, 1.0]] + 0.1 * terms[:, [7, 9]]
    targets += 0.05 * np.random.default_rng(1).normal(size=targets.shape)
    optimizer = stepwise_least_squares(0.005, 1e-4, *terms.shape)
    whole = sparse_coefficients(terms, targets, optimizer)
    small = sparse_coefficients(terms, targets, optimizer, squares_only=True)
    assert 0 < np.count_nonzero(whole) < whole.size
    np.testing.assert_array_equal(small == 0, whole == 0)
    np.testing.assert_allclose(small, whole, rtol=1e-9, atol=1e-12 * np.abs(whole).max())


# -- the model that comes out ----------------------------------------------------------------------


def test_the_identified_model_keeps_what_the_prior_says(spring):
    model = spring.model_
    assert dict(model.states) == dict(SPRING.states)
    assert dict(model.inputs) == dict(SPRING.inputs)
    assert model.outputs == SPRING.outputs
    assert model.kinematic_pairs == {"v": "x"}
    assert model.parameters["c_v_x_3"].unit == "m/s/s per x**3"
    assert set(model.free_parameters) == {"c_v_x", "c_v_v", "c_v_force", "c_v_x_3"}
    assert spring.equations_[0] == "x' = v"


def test_the_identified_model_goes_in_again(spring):
    refined = PhysicsModelRegressor(spring.model_, search="local").fit(SPRING_X, SPRING_Y)
    truth = {"c_v_x": -9.0, "c_v_v": -0.5, "c_v_force": 1.0, "c_v_x_3": -4.0}
    for name, value in truth.items():
        assert refined.parameters_[name].low <= value <= refined.parameters_[name].high, name
    clean = SPRING_STATES[:, :, :1].reshape(-1, 1)
    assert rms(refined.predict(SPRING_X) - clean) < rms(spring.predict(SPRING_X) - clean)


@pytest.mark.slow
def test_the_golf_robot_needs_the_terms_of_its_friction():
    prior, kind = systems.golf_robot(), {"duration": 5.0, "sample_rate": 200.0}
    X, y = datasets.make_golf_robot(4, **kind)
    X_new, y_new = datasets.make_golf_robot(reference=True, **kind)
    before = rms(simulate_records(prior, read_records(prior, X_new), substeps=4) - y_new)

    def share(library, **options):
        fitted = SINDYcRegressor(prior, library=library, **options).fit(X, y)
        return rms(fitted.predict(X_new) - y_new) / before

    with_friction = share(["model", "tanh(omega/0.02)"])
    assert with_friction < 0.25
    # states, input and trigonometric functions: the paper's library
    assert share(["polynomial", "fourier"], degree=1) > 2 * with_friction


# -- what diverges, what does not fit, what is kept -----------------------------------------------


def runaway():
    """Return a fit whose simulation diverges: an unstable lag, driven for long."""
    t = np.linspace(0, 1, 101)
    grow = PhysicsModel({"y": "V"}, {"y": "3*y + u"}, {}, {"u": "V"})
    X = pd.DataFrame({"t": t, "u": 1.0, "y": np.where(t == 0, 0.1, np.nan)})
    fitted = SINDYcRegressor(grow, library="model").fit(X, grow.simulate(t, X["u"], [0.1]).y)
    t = np.linspace(0, 100, 1001)
    return fitted, pd.DataFrame({"t": t, "u": 1.0, "y": np.where(t == 0, 0.3, np.nan)})


def test_a_simulation_that_runs_away_repeats_its_first_row_and_says_so():
    fitted, X = runaway()
    with pytest.warns(SimulationWarning, match=r"trajectory '0': .*identified' diverges: 'y' is"):
        found = fitted.predict(X)
    np.testing.assert_array_equal(found, 0.3)
    with pytest.warns(SimulationWarning, match="Remedy: raise threshold"):
        assert np.isfinite(fitted.score(X, np.sin(X["t"])))


def test_a_search_survives_candidates_that_run_away():
    X, y, _ = records_of(SPRING, duration=3.0, rate=100.0, amplitude=3.0, noise=0.05)
    search = GridSearchCV(
        SINDYcRegressor(SPRING),
        {"degree": [1, 5], "threshold": [0.0]},
        cv=GroupKFold(3),
        error_score="raise",
    )
    with pytest.warns(SimulationWarning, match=r"non-finite.* Or raise threshold"):
        search.fit(X, y, groups=X["trajectory"])
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    assert search.best_params_["degree"] == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"library": "poly"},
            r"library: unknown name 'poly'.* Remedy: use 'polynomial', 'fourier'",
        ),
        ({"library": "x.__class__"}, "library: .*is not allowed"),
        ({"library": 3}, "library: expected a name, an expression or a library of pysindy, got 3"),
        ({"library": []}, "library: expected at least one term"),
        ({"library": "log(v)"}, r"the term 'log\(v\)' has no finite value at \d+ samples"),
        (
            {"library": pysindy.CustomLibrary([lambda a: np.exp(a)])},
            r"the term 'f0\(x\)' of CustomLibrary is not named by what it computes. Remedy:",
        ),
        ({"degree": 0}, "degree: expected an integer >= 1, got 0"),
        ({"threshold": -1}, "threshold: expected a number >= 0, got -1"),
        ({"alpha": np.nan}, "alpha: expected a number >= 0, got nan"),
        ({"substeps": 0.5}, "substeps: expected an integer >= 1, got 0.5"),
        ({"span": "1 s"}, "span: expected a number >= 0, got '1 s'"),
        ({"hold": "linear"}, "hold: expected one of zoh, foh, got 'linear'"),
        ({"optimizer": Lasso(1e-3)}, "Lasso fits an intercept.* Remedy: fit_intercept=False"),
    ],
)
def test_what_cannot_be_done_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        SINDYcRegressor(SPRING, **options).fit(SPRING_X, SPRING_Y + 1.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"library": "model"}, r"'model' needs a model, got none. Remedy: give model="),
        ({"discrete": True}, r"discrete=True needs samples in time.*Remedy: give X a"),
    ],
)
def test_what_rows_alone_cannot_do_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        SINDYcRegressor(**options).fit(np.eye(3), np.ones(3))


def test_nothing_left_is_said():
    X, y, _ = records_of(LAG, n_records=1)
    nothing = SINDYcRegressor(LAG, threshold=50.0)
    with pytest.warns(UserWarning, match=r"no term of the library is left for 'y'. Remedy: lower"):
        fitted = nothing.fit(X, y)
    assert fitted.equations_ == ["y' = 0"]
    np.testing.assert_allclose(fitted.predict(X), X["y"][0])


def test_a_map_refuses_another_clock():
    X, y, _ = records_of(LAG, n_records=2)
    fitted = SINDYcRegressor(LAG, discrete=True).fit(X, y)
    with pytest.raises(
        RecordError, match=r"steps by 0\.005 s.*from row 0 is 0\.01 s. Remedy: resam"
    ):
        fitted.predict(X.iloc[::2])
    uneven = X.assign(t=X["t"] + 0.001 * np.random.default_rng(0).uniform(size=len(X)))
    with pytest.raises(RecordError, match=r"needs samples at equal intervals.*discrete=False"):
        SINDYcRegressor(LAG, discrete=True).fit(uneven, y)


def test_states_that_y_does_not_name_are_refused():
    X, y, _ = records_of(SPRING, n_records=1)
    with pytest.raises(
        RecordError, match=r"column 'x' has gaps, as only states may.*Remedy: give y"
    ):
        SINDYcRegressor().fit(X, y)


def test_pysindy_missing_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "pysindy", None)
    with pytest.raises(ImportError, match=r'Remedy: pip install "sklearn-pgnn\[sindy\]"'):
        SINDYcRegressor().fit(np.eye(3), np.ones(3))


def test_verbose_prints_the_stages(capsys):
    SINDYcRegressor(SPRING, degree=3).fit(SPRING_X, SPRING_Y)
    assert capsys.readouterr().out == ""
    fitted = SINDYcRegressor(SPRING, degree=3, verbose=1).fit(SPRING_X, SPRING_Y)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert all(line.startswith("[SINDYcRegressor] ") for line in lines)
    left = np.count_nonzero(fitted.coefficients_[1])
    assert lines[1].endswith(f" rows, 20 terms, targets: v; {left} terms are left")


@pytest.mark.parametrize("kind", ["map", "rows"])
def test_survives_skops_with_a_list_of_trusted_types(kind):
    skops = pytest.importorskip("skops.io")
    X = SPRING_X if kind != "rows" else SPRING_X[["t", "force"]].to_numpy()
    model = SPRING if kind == "map" else None
    fitted = SINDYcRegressor(model, discrete=kind == "map").fit(X, SPRING_Y)
    data = skops.dumps(fitted)
    trusted = [
        "sklearn_pgnn.estimators.sindyc.SINDYcRegressor",
        "sklearn_pgnn.physics.model.PhysicsModel",
    ]
    assert set(skops.get_untrusted_types(data=data)) <= set(trusted)
    loaded = skops.loads(data, trusted=trusted)
    np.testing.assert_array_equal(loaded.predict(X), fitted.predict(X))


def test_a_fit_keeps_no_object_of_pysindy(spring):
    kept = [value for name, value in vars(spring).items() if name not in spring.get_params()]
    assert kept
    assert not any(type(value).__module__.startswith("pysindy") for value in kept)


@parametrize_with_checks([SINDYcRegressor()])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


@pytest.mark.parametrize("without", ["position", "speed"])
def test_a_sensor_that_one_record_lacks_spoils_no_fit(without):
    rates = {"x": "v", "v": "force - 9*x - 0.5*v - 4*x**3"}
    outputs = {"position": "x", "speed": "v"}
    cart = PhysicsModel({"x": "m", "v": "m/s"}, rates, {}, {"force": "N"}, outputs)
    t, rng, frames, measured = np.arange(300) / 40, np.random.default_rng(0), [], []
    for i in range(4):
        force = 4 * np.sin((1.0 + 0.6 * i) * t + i)
        run = cart.simulate(t, force, [0.3, 0.0], substeps=4)
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "force": force}))
        noise = 2e-3 * rng.normal(size=run.y.shape)
        measured.append(pd.DataFrame(run.y + noise, columns=list(outputs)))
    X, y = pd.concat(frames, ignore_index=True), pd.concat(measured, ignore_index=True)
    X[["x", "v"]] = np.where(X[["t"]] == 0, [0.3, 0.0], np.nan)
    y.loc[X["trajectory"] == 0, without] = np.nan
    prior = cart.replace(equations={"x": "v", "v": "force"})
    fitted = SINDYcRegressor(prior, degree=3).fit(X, y)
    assert fitted.score(X[X["trajectory"] > 0], y[X["trajectory"] > 0]) > 0.99


# -- gaps of single columns ------------------------------------------------------------------------

CLOCK = np.arange(0, 10, 0.02)


def machine(frequency, seed):
    """Return records of x' = v, v' = 2 u - v/2 - 9 x - 4 x^3, integrated by scipy."""
    rng, tables, states = np.random.default_rng(seed), [], []
    for name in range(3):
        phase = rng.uniform(0, 6, 2)

        def u(t, f=frequency * (1 + name / 3), phase=phase):
            return 4 * np.sin(f * t + phase[0]) + 2 * np.sin(2.7 * f * t + phase[1])

        def rate(t, x, u=u):
            return [x[1], 2 * u(t) - x[1] / 2 - 9 * x[0] - 4 * x[0] ** 3]

        run = solve_ivp(rate, (0, CLOCK[-1]), [0, 0], t_eval=CLOCK, rtol=1e-9, atol=1e-9)
        tables.append(pd.DataFrame({"trajectory": name, "t": CLOCK, "u": u(CLOCK)}))
        states.append(run.y.T)
    y = np.concatenate(states) + 1e-3 * rng.normal(size=(3 * CLOCK.size, 2))
    return pd.concat(tables, ignore_index=True), pd.DataFrame(y, columns=["x", "v"])


def equation(X, y, **options):
    fitted = SINDYcRegressor(hold="foh", **options).fit(X, y)
    rates = dict(zip(fitted.terms_, fitted.coefficients_[0], strict=True))
    return {term: value for term, value in rates.items() if value}


@settings(max_examples=8)
@given(
    column=st.sampled_from(["x", "v"]),
    gaps=st.lists(st.integers(20, 1400), min_size=1, max_size=3),
    samples=st.integers(20, 150),
    frequency=st.floats(0.6, 1.5),
)
def test_a_gap_in_one_column_bends_no_equation(column, gaps, samples, frequency):
    X, y = machine(frequency, seed=0)
    for begin in gaps:
        y.loc[begin : begin + samples, column] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecordWarning)
        assert equation(X, y) == pytest.approx({"v": 1.0}, abs=3e-3)


@pytest.mark.parametrize("column", ["x", "v"])
def test_a_gap_bends_no_map(column):
    X, y = machine(1.0, seed=5)
    expected = equation(X, y, discrete=True, degree=1)
    y.loc[X["t"].between(3, 5) & (X["trajectory"] > 0), column] = np.nan
    found = equation(X, y, discrete=True, degree=1)
    assert found == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("way", ["single samples", "every fifth", "in turns"])
def test_what_is_no_gap_is_used(way):
    X, y = machine(1.0, seed=1)
    place = np.arange(len(y))
    if way == "single samples":
        y.loc[np.random.default_rng(0).integers(0, len(y), 60), "v"] = np.nan
    elif way == "every fifth":
        y.loc[place % 5 != 0, "v"] = np.nan
    else:
        y.loc[place % 2 == 0, "v"] = y.loc[place % 2 == 1, "x"] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordWarning)
        assert equation(X, y) == pytest.approx({"v": 1.0}, abs=5e-3)


def test_a_column_that_no_term_contains_costs_no_samples():
    X, y = machine(1.0, seed=2)
    y["heat"] = np.where(np.arange(len(y)) % 500 < 300, 20.0 + X["t"], np.nan)
    library = ["x", "v", "u", "x**3"]
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordWarning)
        assert equation(X, y, library=library) == pytest.approx({"v": 1.0}, abs=3e-3)


def test_where_much_is_lost_there_is_a_warning():
    X, y = machine(1.0, seed=3)
    y.loc[X["t"].between(2, 6), "v"] = np.nan
    with pytest.warns(
        RecordWarning, match=r"y: 4. % of the time lies in gaps of v, and no rate.*Rem"
    ):
        assert equation(X, y) == pytest.approx({"v": 1.0}, abs=5e-3)


def test_nothing_between_gaps_is_refused():
    X, y = machine(1.0, seed=4)
    y.loc[np.arange(len(y)) % 30 > 3, "v"] = np.nan
    with (
        pytest.warns(RecordWarning),
        pytest.raises(RecordError, match=r"none between the gaps of v\. "),
    ):
        SINDYcRegressor(span=0.2).fit(X, y)
