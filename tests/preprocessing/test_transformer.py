"""PhysicsModelTransformer: what it appends, what it must not read, and what it works with."""

import copy
import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn import PhysicsModel, PhysicsModelTransformer, datasets, systems
from sklearn_pgnn.exceptions import OptionError, RecordError, SimulationWarning

pytestmark = pytest.mark.core

CART = systems.cart_on_spring()
STATES = ["x", "v"]


def table(n_records=3, n=200, seed=0):
    """Return X with the first row's states known, measured states and outputs."""
    rng = np.random.default_rng(seed)
    frames, outputs = [], []
    for name in range(n_records):
        t = np.arange(n) * 0.02
        force = 4 * np.sin(rng.uniform(1, 8) * t + rng.uniform(0, 6))
        x0 = rng.normal(size=2) * 0.1
        run = CART.simulate(t, force, x0, substeps=4)
        frame = pd.DataFrame({"trajectory": name, "t": t, "force": force})
        frame[STATES] = run.x
        frames.append(frame)
        outputs.append(run.y[:, 0])
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


def poisoned(X, value=np.nan):
    """Return X without any measured state but those of each trajectory's first row."""
    X = X.copy()
    later = X.groupby("trajectory").cumcount() > 0
    X.loc[later, STATES] = value
    return X


X, Y = table()


@pytest.mark.parametrize("append", [np.True_, 1])
def test_any_true_holds_the_states_of_the_first_row(append):
    found = PhysicsModelTransformer(CART, append=append).fit_transform(X)
    pd.testing.assert_frame_equal(found, PhysicsModelTransformer(CART).fit_transform(X))


def test_appends_what_a_finer_simulation_gives():
    found = PhysicsModelTransformer(CART).set_output(transform="pandas").fit_transform(X)
    assert list(found) == ["t", "force", *STATES, "x_phy", "v_phy", "position_phy"]
    assert found["x_phy"].to_numpy() == pytest.approx(X["x"].to_numpy(), abs=1e-5)
    assert found["v_phy"].to_numpy() == pytest.approx(X["v"].to_numpy(), abs=1e-4)
    assert found["position_phy"].to_numpy() == pytest.approx(Y, abs=1e-5)
    assert np.array_equal(found["force"], X["force"])


def test_measured_states_after_the_first_row_change_nothing():
    transformer = PhysicsModelTransformer(CART).fit(X)
    for value in (np.nan, np.inf, 1e6):
        dirty = poisoned(X, value)
        assert np.array_equal(transformer.transform(dirty), transformer.transform(X))
        assert np.array_equal(
            PhysicsModelTransformer(CART).fit_transform(dirty), transformer.transform(X)
        )


def test_arrays_and_tables_give_the_same():
    values = X[X["trajectory"] == 1].drop(columns="trajectory")
    as_table = PhysicsModelTransformer(CART).fit_transform(values)
    as_array = PhysicsModelTransformer(CART).fit_transform(values.to_numpy())
    assert np.array_equal(as_table, as_array)
    moved = values.to_numpy()[:, [1, 2, 0, 3]]  # force, x, t, v
    transformer = PhysicsModelTransformer(CART, time_column=2).fit(moved)
    assert np.array_equal(transformer.transform(moved)[:, 4:], as_array[:, 4:])
    assert transformer.get_feature_names_out().tolist() == [
        "force", "x", "t", "v", "x_phy", "v_phy", "position_phy",
    ]  # fmt: skip


def test_a_table_stays_a_table_and_its_states_are_held():
    found = PhysicsModelTransformer(CART).fit_transform(X)
    assert list(found.columns) == [*X.columns[1:], "x_phy", "v_phy", "position_phy"]
    assert found.index.equals(X.index)
    for _, rows in X.groupby("trajectory"):
        for state in ("x", "v"):
            assert (found.loc[rows.index, state] == rows[state].iloc[0]).all()
    pd.testing.assert_frame_equal(found[["t", "force"]], X[["t", "force"]])


def test_a_first_state_that_is_not_known_stays_so():
    unknown = X.copy()
    unknown.loc[X["trajectory"] == 1, "v"] = np.nan
    found = PhysicsModelTransformer(CART).fit_transform(unknown)
    assert found.loc[X["trajectory"] == 1, "v"].isna().all()
    assert found.drop(columns="v").notna().all(axis=None)


def test_trajectories_that_only_their_names_tell_apart():
    later = X.copy()
    later["t"] += 100.0 * (later["trajectory"] == later["trajectory"].iloc[-1])
    mixed = X.sort_values("t", kind="stable")
    transformer = PhysicsModelTransformer(CART).fit(X)
    with pytest.warns(UserWarning, match=r"does not separate the trajectories.*append='all'"):
        transformer.transform(mixed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # every trajectory has a clock of its own, which begins anew
        pd.testing.assert_frame_equal(transformer.transform(later), transformer.transform(X))
        PhysicsModelTransformer(CART, append="all").fit_transform(mixed)


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ({"append": False}, ["x_phy", "v_phy", "position_phy"]),
        ({"append": False, "outputs": ["v"]}, ["v_phy"]),
        ({"outputs": ["position"]}, [*X.columns[1:], "position_phy"]),
        ({"append": "all", "outputs": ["x"]}, [*X.columns, "x_phy"]),
    ],
)
def test_names_go_with_the_columns(options, names):
    transformer = PhysicsModelTransformer(CART, **options).fit(X)
    assert transformer.get_feature_names_out().tolist() == names
    assert transformer.transform(X).shape == (len(X), len(names))
    assert transformer.n_features_in_ == X.shape[1]
    assert transformer.feature_names_in_.tolist() == list(X.columns)


def test_rows_of_trajectories_may_be_interleaved():
    order = np.argsort(X["t"].to_numpy(), kind="stable")
    mixed = X.iloc[order]
    found = PhysicsModelTransformer(CART).set_output(transform="pandas").fit_transform(mixed)
    assert list(found.index) == list(mixed.index)
    assert found["x_phy"].to_numpy() == pytest.approx(X["x"].to_numpy()[order], abs=1e-5)


def test_model_may_call_columns_otherwise():
    renamed = CART.replace(columns={"force": "F_cmd", "x": "q", "t": "time"})
    other = X.rename(columns={"force": "F_cmd", "x": "q", "t": "time"})
    transformer = PhysicsModelTransformer(renamed).fit(other)
    assert list(transformer.get_feature_names_out()[:2]) == ["time", "F_cmd"]
    assert np.array_equal(
        transformer.transform(other), PhysicsModelTransformer(CART).fit_transform(X)
    )


def test_the_trajectory_is_no_feature_whatever_it_is_called():
    renamed = CART.replace(columns={"trajectory": "run"})
    other = X.assign(run=X["trajectory"].map("run {}".format)).drop(columns="trajectory")
    transformer = PhysicsModelTransformer(renamed).fit(other)
    assert "run" not in transformer.get_feature_names_out()
    expected = PhysicsModelTransformer(CART).fit_transform(X)
    pd.testing.assert_frame_equal(transformer.transform(other), expected)
    both = PhysicsModelTransformer(renamed).fit_transform(other.assign(trajectory="all"))
    pd.testing.assert_frame_equal(both, expected)
    with pytest.warns(UserWarning, match="'run' is left out, and the time alone does not separate"):
        transformer.transform(other.sort_values("t", kind="stable"))


def test_substeps_are_as_many_as_needed():
    stiff = CART.with_parameters(m=0.1, k=900.0, d=2.0)  # 95 rad/s at 0.02 s
    auto = PhysicsModelTransformer(stiff, append=False).fit(X)
    fine = PhysicsModelTransformer(stiff, append=False, substeps=40).fit(X)
    assert 1 < auto.substeps_ <= 32
    assert PhysicsModelTransformer(CART).fit(X).substeps_ == 1
    error = np.abs(auto.transform(X) - fine.transform(X)).max(axis=0)
    assert np.all(error < 2e-3 * np.ptp(fine.transform(X), axis=0))


def test_diverging_trajectory_warns_and_passes_no_nan():
    runaway = PhysicsModel(
        {"x": "m"}, {"x": "x**2 + u"}, {}, {"u": ""}, initial_state={"x": 0.1}, name="runaway"
    )
    t = np.arange(0, 2, 0.01)
    rows = np.concatenate([np.column_stack([t, 0 * t]), np.column_stack([t, 0 * t + 9.0])])
    transformer = PhysicsModelTransformer(runaway, append=False, substeps=4).fit(rows)
    with pytest.warns(SimulationWarning) as caught:
        found = transformer.transform(rows)
    assert len(caught) == 1
    text = str(caught[0].message)
    assert text.startswith("trajectory '1': the simulation of 'runaway' became non-finite")
    assert "Remedy" in text
    assert text.endswith("Its rows get the values of its first row.")
    assert np.isfinite(found).all()
    assert np.all(found[t.size :] == 0.1)
    assert found[: t.size, 0] == pytest.approx(1 / (10 - t))


def test_runaway_model_is_told_before_its_numbers_are_used():
    unstable = PhysicsModel({"y": "V"}, {"y": "(u + y)/T"}, {"T": 0.01}, {"u": "V"})
    rows = np.column_stack([np.arange(0, 6, 0.01), np.ones(600)])  # e**600 is a number yet
    expected = r"trajectory '0': 'y' diverges: it is .*e\+\d+ at t = .* s.*Remedy: check the para"
    with pytest.warns(SimulationWarning, match=expected):
        found = PhysicsModelTransformer(unstable, append=False, substeps=4).fit_transform(rows)
    assert not found.any()


def test_whole_solve_gives_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PhysicsModelTransformer(CART).fit_transform(X)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"outputs": []}, r"outputs: expected states or outputs among x, v, position, got \[\]\."),
        ({"outputs": ["q"]}, "outputs: expected states or outputs among x, v, position, got 'q'."),
        ({"append": "some"}, "append: expected True, False or 'all', got 'some'."),
        ({"method": "heun"}, "method: expected one of euler, rk4, rosenbrock, got 'heun'."),
    ],
)
def test_bad_options_are_named(options, text):
    with pytest.raises(ValueError, match=text):
        PhysicsModelTransformer(CART, **options).fit(X)


def test_bad_tables_are_refused():
    with pytest.raises(RecordError, match="input 'force' is missing"):
        PhysicsModelTransformer(CART).fit(X.drop(columns="force"))
    with pytest.raises(ValueError, match="feature names"):
        PhysicsModelTransformer(CART).fit(X).transform(X.rename(columns={"v": "w"}))


# -- with scikit-learn ----------------------------------------------------------------------------


def test_copies_give_the_same_numbers():
    transformer = PhysicsModelTransformer(CART, append=False).fit(X)
    expected = transformer.transform(X)
    for other in (pickle.loads(pickle.dumps(transformer)), copy.deepcopy(transformer)):
        assert np.array_equal(other.transform(X), expected)
    assert np.array_equal(clone(transformer).fit_transform(X), expected)
    assert transformer.get_params()["model"] is CART


def test_fit_and_transform_leave_x_alone():
    kept = X.copy()
    PhysicsModelTransformer(CART).fit_transform(X)
    pd.testing.assert_frame_equal(X, kept)


@pytest.mark.slow
@pytest.mark.parametrize(
    "regressor", [Ridge(1e-6), RandomForestRegressor(10, random_state=0)], ids=["ridge", "forest"]
)
def test_any_regressor_after_it(regressor):
    golf, y = datasets.make_golf_robot(n_records=3, duration=2)
    physics = PhysicsModelTransformer(systems.golf_robot())
    fitted = make_pipeline(physics, regressor).fit(golf, y.to_numpy().ravel())
    assert fitted.score(golf, y.to_numpy().ravel()) > 0.9
    dirty = golf.copy()
    dirty.loc[dirty["t"] > 0, ["phi", "omega"]] = np.nan
    assert np.array_equal(fitted.predict(dirty), fitted.predict(golf))


def test_physical_columns_pass_a_scaler_untouched():
    X_clean = X.assign(room=20.0 + np.arange(len(X)) % 7)
    scaler = ColumnTransformer(
        [("scale", StandardScaler(), ["room"])],
        remainder="passthrough",
        verbose_feature_names_out=False,
    ).set_output(transform="pandas")
    pipeline = make_pipeline(scaler, PhysicsModelTransformer(CART), Ridge())
    assert pipeline.fit(X_clean, Y).score(X_clean, Y) > 0.99
    names = pipeline[:-1].get_feature_names_out()
    assert list(names) == ["room", "t", "force", *STATES, "x_phy", "v_phy", "position_phy"]


def test_searches_and_scores():
    pipeline = make_pipeline(PhysicsModelTransformer(CART), Ridge())
    names = X["trajectory"].to_numpy()
    folds = list(GroupKFold(3).split(X, Y, names))
    assert cross_val_score(pipeline, X, Y, cv=folds).min() > 0.97
    grid = {
        "ridge__alpha": [1e-6, 1e3],
        "physicsmodeltransformer__outputs": [None, ["position"]],
    }
    search = GridSearchCV(pipeline, grid, cv=folds).fit(X, Y)
    assert search.best_params_["ridge__alpha"] == 1e-6


def test_names_that_x_has_already_are_refused():
    X, _ = table()
    twice = PhysicsModelTransformer(CART).fit_transform(X)
    message = r"X: expected no columns with the names .* got x_phy, v_phy, position_phy\. Remedy:"
    with pytest.raises(OptionError, match=message):
        PhysicsModelTransformer(CART).fit(twice)
    with pytest.raises(OptionError, match=r"got x_phy\. Remedy: rename them"):
        PhysicsModelTransformer(CART, outputs=["x"]).fit(X.assign(x_phy=0.0))
    alone = PhysicsModelTransformer(CART, append=False).fit(twice)
    assert list(alone.get_feature_names_out()) == ["x_phy", "v_phy", "position_phy"]
