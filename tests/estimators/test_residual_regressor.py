"""ResidualRegressor: what its regressor sees, what it learns, and what it must not read."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.ensemble import GradientBoostingRegressor, RandomForestRegressor
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LinearRegression
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from sklearn_pgnn import PhysicsModel, PhysicsModelTransformer, datasets, systems
from sklearn_pgnn.estimators.residual_regressor import ResidualRegressor
from sklearn_pgnn.exceptions import RecordError, SimulationWarning

CART = systems.cart_on_spring()
BOTH = CART.replace(outputs={"position": "x", "speed": "v"})
STATES = ["x", "v"]
OFFSET, BY_FORCE, BY_SPEED = 0.3, 0.05, -0.2


def error_of(X):
    """Return the hidden error: linear in the input and a simulated state."""
    return OFFSET + BY_FORCE * X["force"].to_numpy() + BY_SPEED * X["v"].to_numpy()


def table(n_records=3, n=300, seed=0):
    """Return X with the simulated states, and the model's outputs."""
    rng = np.random.default_rng(seed)
    frames, outputs = [], []
    for name in range(n_records):
        t = np.arange(n) * 0.01
        force = 4 * np.sin(rng.uniform(1, 8) * t + rng.uniform(0, 6))
        run = CART.simulate(t, force, rng.normal(size=2) * 0.1)
        frame = pd.DataFrame({"trajectory": name, "t": t, "force": force})
        frame[STATES] = run.x
        frames.append(frame)
        outputs.append(run.y[:, 0])
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


X, Y_PHY = table()
Y = Y_PHY + error_of(X)
NEW, NEW_PHY = table(2, seed=7)


def poisoned(X, value=np.nan):
    """Return X without any measured state but those of each trajectory's first row."""
    X = X.copy()
    X.loc[X.groupby("trajectory").cumcount() > 0, STATES] = value
    return X


# -- the method ------------------------------------------------------------------------------------


def test_error_that_is_linear_is_found_exactly():
    residual = ResidualRegressor(CART, LinearRegression(), substeps=1).fit(X, Y)
    assert residual.predict(NEW) == pytest.approx(NEW_PHY + error_of(NEW), abs=1e-9)
    names = list(residual.regressor_.feature_names_in_)
    assert names == ["force", "x_phy", "v_phy", "position_phy"]
    assert residual.regressor_.intercept_ == pytest.approx(OFFSET)
    found = dict(zip(names, residual.regressor_.coef_, strict=True))
    assert found["force"] == pytest.approx(BY_FORCE)
    assert found["v_phy"] == pytest.approx(BY_SPEED)


def test_default_is_least_squares_whatever_the_units():
    found = ResidualRegressor(CART).fit(X, Y).predict(NEW)
    assert found == pytest.approx(NEW_PHY + error_of(NEW), abs=1e-5)


def test_model_without_error_is_left_alone():
    assert ResidualRegressor(CART).fit(X, Y_PHY).predict(NEW) == pytest.approx(NEW_PHY, abs=1e-4)


@pytest.mark.slow
def test_golf_robot_is_predicted_better_than_by_its_model():
    prior = systems.golf_robot()
    records, y = datasets.make_golf_robot(sample_rate=200, duration=5)
    other, y_other = datasets.make_golf_robot(sample_rate=200, duration=5, reference=True)
    physics = PhysicsModelTransformer(prior, append=False, outputs=["phi_measured"])
    alone = physics.fit(records).transform(other)
    error = ResidualRegressor(prior).fit(records, y).predict(other) - y_other.to_numpy()
    assert np.mean(error**2) < np.mean((alone - y_other.to_numpy()) ** 2)


def test_outputs_that_are_missing_are_left_out():
    gappy = Y.copy()
    gappy[::2] = np.nan
    residual = ResidualRegressor(CART, LinearRegression(), substeps=1).fit(X, gappy)
    assert residual.predict(NEW) == pytest.approx(NEW_PHY + error_of(NEW), abs=1e-9)


def test_rows_with_some_outputs_missing_are_left_out():
    both = np.column_stack([Y, X["v"] + 1.0])
    both[::3, 0], both[1::3, 1] = np.nan, np.nan
    residual = ResidualRegressor(BOTH, LinearRegression(), substeps=1).fit(X, both)
    expected = np.column_stack([NEW_PHY + error_of(NEW), NEW["v"] + 1.0])
    assert residual.predict(NEW) == pytest.approx(expected, abs=1e-9)
    both[2::3] = np.nan
    with pytest.raises(ValueError, match=r"no row has all outputs.*Remedy: regress one output"):
        ResidualRegressor(BOTH).fit(X, both)


def test_output_named_as_a_state_stands_in_its_place():
    biased = CART.replace(outputs={"x": "x + 1"})
    residual = ResidualRegressor(biased, LinearRegression(), substeps=1).fit(X, Y)
    assert list(residual.regressor_.feature_names_in_) == ["force", "x_phy", "v_phy"]
    assert residual.predict(NEW) == pytest.approx(NEW_PHY + error_of(NEW), abs=1e-9)


# -- what it reads ---------------------------------------------------------------------------------


def test_measured_states_after_the_first_row_change_nothing():
    residual = ResidualRegressor(CART).fit(X, Y)
    for value in (np.nan, np.inf, 1e6):
        assert np.array_equal(residual.predict(poisoned(NEW, value)), residual.predict(NEW))
        again = ResidualRegressor(CART).fit(poisoned(X, value), Y)
        assert np.array_equal(again.predict(NEW), residual.predict(NEW))


def test_initial_states_are_read():
    residual = ResidualRegressor(CART).fit(X, Y)
    moved = NEW.assign(x=NEW["x"] + 0.5)
    assert np.abs(residual.predict(moved) - residual.predict(NEW)).max() > 0.1


def test_neither_clock_nor_other_columns_are_features():
    room = np.arange(len(X)) % 7
    residual = ResidualRegressor(CART).fit(X.assign(room=room), Y + 0.2 * X["t"] + 0.1 * room)
    found = residual.predict(NEW.assign(room=0))
    assert residual.predict(NEW.assign(room=9, t=NEW["t"] + 64)) == pytest.approx(found, abs=1e-6)


def test_rows_of_trajectories_may_be_interleaved():
    order = np.argsort(X["t"].to_numpy(), kind="stable")
    mixed = ResidualRegressor(CART).fit(X.iloc[order], Y[order])
    whole = ResidualRegressor(CART).fit(X, Y)
    assert mixed.predict(X.iloc[order]) == pytest.approx(whole.predict(X)[order], abs=1e-9)


def test_arrays_and_tables_give_the_same():
    rows = (X["trajectory"] == 0).to_numpy()
    part = X[rows].drop(columns="trajectory")
    named = ResidualRegressor(CART).fit(part, Y[rows])
    arrays = ResidualRegressor(CART).fit(part.to_numpy(), Y[rows])
    assert np.array_equal(arrays.predict(part.to_numpy()), named.predict(part))
    last = part[["force", *STATES, "t"]].to_numpy()
    moved = ResidualRegressor(CART, time_column=3).fit(last, Y[rows])
    assert np.array_equal(moved.predict(last), named.predict(part))


def test_input_may_be_held_or_joined():
    coarse = X.iloc[::10]
    held, joined = (
        ResidualRegressor(CART, hold=hold).fit(coarse, Y[::10]) for hold in ("zoh", "foh")
    )
    assert np.abs(held.predict(coarse) - joined.predict(coarse)).max() > 1e-3


def test_substeps_are_as_many_as_needed():
    stiff = CART.with_parameters(m=0.1, k=900.0, d=2.0)
    assert ResidualRegressor(stiff).fit(X, Y).substeps_ > 1
    assert ResidualRegressor(stiff, substeps=3).fit(X, Y).substeps_ == 3


def test_diverging_trajectory_warns_and_stays_finite():
    runaway = PhysicsModel(
        {"x": "m"}, {"x": "x**2 + u"}, {}, {"u": ""}, initial_state={"x": 0.1}, name="runaway"
    )
    t = np.arange(0, 2, 0.01)
    calm, wild = np.column_stack([t, 0 * t]), np.column_stack([t, 0 * t + 9.0])
    residual = ResidualRegressor(runaway, substeps=4).fit(calm, 1 / (10 - t) + 2.0)
    with pytest.warns(SimulationWarning, match=r"trajectory '0'.*'runaway'.*Remedy") as caught:
        found = residual.predict(wild)
    assert len(caught) == 1
    assert np.isfinite(found).all()
    assert residual.predict(calm) == pytest.approx(1 / (10 - t) + 2.0)


# -- any regressor ---------------------------------------------------------------------------------


def test_regressor_is_cloned_and_draws_by_its_own_seed():
    forest = RandomForestRegressor(5, random_state=3)
    first = ResidualRegressor(CART, forest).fit(X, Y)
    assert not hasattr(forest, "estimators_")
    assert np.array_equal(first.predict(NEW), clone(first).fit(X, Y).predict(NEW))
    other = clone(first).set_params(regressor__random_state=4).fit(X, Y)
    assert not np.array_equal(first.predict(NEW), other.predict(NEW))


@pytest.mark.parametrize("behind", ["passthrough", StandardScaler()])
def test_a_regressor_of_one_output_is_fitted_per_output(behind):
    both = np.column_stack([Y, X["v"]])
    boosting = make_pipeline(behind, GradientBoostingRegressor(n_estimators=5, random_state=0))
    fitted = ResidualRegressor(BOTH, boosting).fit(X, both)
    wrapped = ResidualRegressor(BOTH, MultiOutputRegressor(boosting)).fit(X, both)
    assert np.array_equal(fitted.predict(NEW), wrapped.predict(NEW))
    assert fitted.predict(NEW).shape == (len(NEW), 2)
    assert len(fitted.regressor_.estimators_) == 2
    forest = RandomForestRegressor(2, random_state=0)
    assert isinstance(ResidualRegressor(BOTH, forest).fit(X, both).regressor_, type(forest))


def test_extended_form_learns_what_the_error_alone_cannot_tell():
    # y = (1 + gain) y_phy + b t: the clock is a feature of the extended form only
    y = 1.5 * Y_PHY + 0.2 * X["t"]
    extended = make_pipeline(PhysicsModelTransformer(CART, substeps=1), LinearRegression())
    assert extended.fit(X, y).predict(NEW) == pytest.approx(
        1.5 * NEW_PHY + 0.2 * NEW["t"], abs=1e-9
    )
    assert ResidualRegressor(CART).fit(X, y).score(X, y) < extended.score(X, y) - 0.01


# -- errors ----------------------------------------------------------------------------------------


def test_what_cannot_be_read_is_refused():
    with pytest.raises(RecordError, match="input 'force' is missing"):
        ResidualRegressor(CART).fit(X.drop(columns="force"), Y)
    with pytest.raises(RecordError, match=r"y: expected shape \(900, 1\)"):
        ResidualRegressor(CART).fit(X, np.column_stack([Y, Y]))
    with pytest.raises(ValueError, match="requires y to be passed"):
        ResidualRegressor(CART).fit(X, None)
    with pytest.raises(NotFittedError):
        ResidualRegressor(CART).predict(X)
    with pytest.raises(ValueError, match="feature names"):
        ResidualRegressor(CART).fit(X, Y).predict(X.rename(columns={"v": "w"}))


# -- without a model, and with scikit-learn --------------------------------------------------------


def test_without_a_model_rows_are_regressed_but_not_on_their_time():
    plain = X[["trajectory", "t", "force"]]
    y = 2.0 * X["force"] + 1.0
    alone = ResidualRegressor().fit(plain, y)
    assert list(alone.regressor_.feature_names_in_) == ["force"]
    assert alone.predict(plain) == pytest.approx(y)
    arrays = ResidualRegressor(time_column=0).fit(plain[["t", "force"]].to_numpy(), y)
    assert arrays.regressor_.n_features_in_ == 1
    assert arrays.n_features_in_ == 2


@parametrize_with_checks([ResidualRegressor()])
def test_scikit_learn_checks(estimator, check):
    check(estimator)
