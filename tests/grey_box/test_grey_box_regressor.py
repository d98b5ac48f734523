"""The recipe chooses its depth by the training records alone, and predicts in free run."""

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures
from sledge import SLEDGE as CART

from sklearn_pgnn import (
    EnsembleRegressor,
    GreyBoxRegressor,
    ModelDiagnosis,
    PhysicsModelRegressor,
    ResidualRegressor,
    effects,
)
from sklearn_pgnn.exceptions import (
    DiagnosisWarning,
    OptionError,
    RecordWarning,
    TrainingError,
)
from sklearn_pgnn.grey_box.folds import hidden_parts, operating_ranges
from sklearn_pgnn.grey_box.options import possible_depths
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user

DRY = ModelDiagnosis(CART, catalogue=(effects.CoulombFriction,))
TIMED = ("parameter_drift", "periodic_disturbance")
QUICK = {"diagnosis": DRY, "depths": ("prior", "fitted", "extended")}


def records(truth, n=4, start=0.0, seed=0):
    rng = np.random.default_rng(seed)
    frames, outputs = [], []
    for i in range(n):
        t = np.arange(0, 20, 0.05)
        F = 2 * np.sin((0.5 + 0.2 * i) * t) + np.sin(1.9 * t + i)
        v = truth.simulate(t, F, [start * (i - 1)], substeps=5).y[:, 0]
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "F": F}))
        outputs.append(v + 1e-3 * rng.normal(size=t.size))
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


@pytest.fixture(scope="module")
def with_friction():
    X, y = records(CART + effects.CoulombFriction("v", level=0.4))
    return GreyBoxRegressor(CART, **QUICK).fit(X, y), X, y


@pytest.mark.slow
def test_a_missing_effect_is_named_and_fitted(with_friction):
    grey_box, X, y = with_friction
    assert grey_box.depth_ == "extended"
    assert grey_box.parameters_["Fc_v"].value == pytest.approx(0.4, rel=0.02)
    assert np.std(grey_box.predict(X) - y) < 2e-3
    assert list(grey_box.errors_) == ["prior", "fitted", "extended"]


def test_a_right_model_stays_as_it_is():
    X, y = records(CART)
    assert GreyBoxRegressor(CART, **QUICK).fit(X, y).depth_ == "prior"


@pytest.mark.slow
def test_wrong_parameters_are_fitted():
    X, y = records(CART.with_parameters(m=2.6))
    grey_box = GreyBoxRegressor(CART, **QUICK).fit(X, y)
    assert grey_box.depth_ == "fitted"
    assert grey_box.model_.parameters["m"].value == pytest.approx(2.6, rel=0.01)


def test_numbers_that_nobody_has_measured_are_told():
    X, y = records(CART.with_parameters(m=2.6, d=0.8))
    with pytest.warns(UserWarning, match="re-tuned m and d to the limits.*Remedy.*spread=inf"):
        GreyBoxRegressor(CART, **QUICK).fit(X, y)
    wide = {name: each.with_spread(np.inf) for name, each in CART.parameters.items()}
    model = CART.replace(parameters=wide)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        GreyBoxRegressor(model, **QUICK).fit(X, y)


@pytest.mark.slow
def test_numbers_that_only_a_missing_effect_bends_are_not_told():
    X, y = records(CART + effects.CoulombFriction("v", level=1.0))  # without it both are bent
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        GreyBoxRegressor(CART, **QUICK).fit(X, y)


def test_what_no_physics_explains_is_left_to_the_network():
    X, y = records(CART)
    X, y = X.assign(v=0.0), y + 0.3 * X["F"].to_numpy() ** 2
    network = ResidualRegressor(CART, _squares())
    grey_box = GreyBoxRegressor(CART, depths=("prior", "network"), network=network, n_splits=2)
    grey_box.fit(X, y)
    assert grey_box.depth_ == "network"
    assert grey_box.errors_["network"] < 0.1 * grey_box.errors_["prior"]
    assert network.model is CART  # what was given is not changed


class Diverging(ResidualRegressor):
    """A network whose training becomes non-finite after so many fits."""

    def __init__(self, model=None, regressor=None, fits=None):
        super().__init__(model, regressor)
        self.fits = fits

    def fit(self, X, y):
        if not self.fits.left:
            raise TrainingError("the training stopped in epoch 3: nan.")
        self.fits.left -= 1
        return super().fit(X, y)


class Fits:
    """How many trainings go well; clones count in the same place."""

    def __init__(self, left):
        self.left = left

    def __sklearn_clone__(self):
        return self


@pytest.mark.parametrize("left", [1, 2], ids=["in a fold", "at last"])
def test_a_training_that_diverges_is_said_and_left_out(left):
    X, y = records(CART)
    X, y = X.assign(v=0.0), y + 0.3 * X["F"].to_numpy() ** 2
    network = Diverging(CART, _squares(), Fits(left))
    grey_box = GreyBoxRegressor(CART, depths=("prior", "network"), network=network, n_splits=2)
    with pytest.warns(UserWarning, match="'network': the training stopped in epoch 3"):
        grey_box.fit(X, y)
    assert grey_box.depth_ == "prior"
    assert grey_box.errors_["network"] == np.inf
    low, high = grey_box.predict_interval(X)
    assert np.all(np.isfinite(low) & (low < high))


def _squares():
    return make_pipeline(PolynomialFeatures(2), LinearRegression())


@pytest.mark.slow
def test_fit_changes_nothing_it_was_given(with_friction):
    _, X, y = with_friction
    before, outputs = X.copy(), y.copy()
    grey_box = clone(GreyBoxRegressor(CART, **QUICK)).fit(X, y)
    pd.testing.assert_frame_equal(X, before)
    assert np.array_equal(y, outputs)
    assert not hasattr(DRY, "verdict_")
    assert grey_box.get_params()["diagnosis__catalogue"] == (effects.CoulombFriction,)


@pytest.mark.slow
def test_nine_of_ten_measurements_lie_in_the_interval(with_friction):
    grey_box, *_ = with_friction
    X, y = records(CART + effects.CoulombFriction("v", level=0.4), seed=1)
    low, high = grey_box.predict_interval(X)
    assert 0.86 < np.mean((low <= y) & (y <= high)) < 0.94
    narrow, _ = grey_box.predict_interval(X, coverage=0.5)
    assert np.all(narrow > low)


class BrokenOff(ModelDiagnosis):
    def fit(self, X, y):
        super().fit(X, y)
        warn_user("broken", DiagnosisWarning)


@pytest.mark.slow
def test_a_diagnosis_that_breaks_off_is_said(with_friction):
    _, X, y = with_friction
    broken = BrokenOff(CART, catalogue=(effects.CoulombFriction,))
    with pytest.warns(UserWarning, match="broken"):
        grey_box = GreyBoxRegressor(CART, diagnosis=broken, depths=("extended",)).fit(X, y)
    assert grey_box.parameters_["Fc_v"].value == pytest.approx(0.4, rel=0.02)


def test_a_pickle_predicts_the_same(with_friction):
    grey_box, X, _ = with_friction
    assert np.array_equal(pickle.loads(pickle.dumps(grey_box)).predict(X), grey_box.predict(X))


def test_trajectories_start_where_their_first_samples_say():
    X, y = records(CART, start=1.0)
    grey_box = GreyBoxRegressor(CART, depths=("fitted",), initial_window=10).fit(X, y)
    assert grey_box.initial_states_[:, 0] == pytest.approx([-1, 0, 1, 2], abs=0.01)
    hidden = np.where(X.groupby("trajectory").cumcount() < 10, y, np.nan)
    assert np.std(grey_box.predict_from(X, hidden) - y) < 3e-3
    assert np.std(grey_box.predict(X) - y) > 0.1
    low, high = grey_box.predict_interval(X, y=hidden)
    assert np.allclose((low + high) / 2, grey_box.predict_from(X, hidden))
    assert 0.84 < np.mean((low <= y) & (y <= high)) < 0.96
    low, high = grey_box.predict_interval(X)
    assert np.allclose((low + high) / 2, grey_box.predict(X))


def test_a_start_that_nobody_told_is_the_average_of_those_found():
    X, y = records(CART, start=1.0)  # from -1 to 2
    with pytest.warns(RecordWarning, match="no initial state is given for 'v'"):
        grey_box = GreyBoxRegressor(CART, depths=("fitted",)).fit(X, y)
    assert grey_box.model_.initial_state["v"] == pytest.approx(0.5, abs=0.01)
    alone = PhysicsModelRegressor(CART, window_length="trajectory", search="local").fit(X, y)
    assert grey_box.model_.initial_state == alone.model_.initial_state
    assert grey_box.predict(X)[::400] == pytest.approx([0.5] * 4, abs=0.01)


def test_a_start_that_is_the_same_everywhere_needs_no_warning():
    X, _ = records(CART)
    runs = [CART.simulate(one.t, one.F, [0.7], substeps=5).y for _, one in X.groupby("trajectory")]
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordWarning)
        grey_box = GreyBoxRegressor(CART, depths=("fitted",)).fit(X, np.concatenate(runs))
    assert grey_box.model_.initial_state["v"] == pytest.approx(0.7, abs=1e-3)


@pytest.mark.parametrize("window", [400, 10000])
def test_a_window_leaves_samples_to_judge_by(window, monkeypatch):
    X, y = records(CART)
    monkeypatch.setattr(GreyBoxRegressor, "_candidates", None)  # it is refused before any work
    expected = (
        rf"^initial_window: expected fewer samples than a trajectory has, .*got {window}; the "
        r"longest has 400\. Remedy: a smaller initial_window, such as 40, longer records, or "
    )
    with pytest.raises(OptionError, match=expected):
        GreyBoxRegressor(CART, depths=("prior",), initial_window=window).fit(X, y)


def test_a_window_longer_than_some_trajectories():
    X, y = records(CART)
    kept = (X["trajectory"] > 1) | (X["t"] < 2)
    options = {"depths": ("prior",), "initial_window": 60}
    assert 0 < GreyBoxRegressor(CART, **options).fit(X[kept], y[kept]).errors_["prior"] < np.inf


def test_without_a_window_nothing_tells_the_start(with_friction):
    grey_box, X, y = with_friction
    with pytest.raises(OptionError, match="initial_window"):
        grey_box.predict_from(X, y)
    with pytest.raises(OptionError, match="initial_window"):
        grey_box.predict_interval(X, y=y)


def some(lengths):
    """Return measured trajectories of so many samples."""
    times = [np.arange(n, dtype=float) for n in lengths]
    return tuple(
        Record(t, np.sin(t)[:, None], np.cos(t)[:, None], np.zeros(1), "some", t.astype(int))
        for t in times
    )


def test_one_record_can_be_cut_into_blocks_of_time():
    masks = hidden_parts(some([40]), 3, by="time")
    assert [mask.sum() for mask in masks] == [10, 10, 10]
    assert not any(mask[:10].any() for mask in masks)


def test_every_trajectory_is_hidden_once():
    masks = hidden_parts(some([4, 5, 6, 7]), 3)
    assert np.sum(masks, axis=0).tolist() == [1] * 22
    with pytest.raises(ValueError, match="by='time'"):
        hidden_parts(some([4]), 3, by="trajectory")


def test_fewer_trajectories_than_folds_hide_blocks_of_time_and_ranges_of_operation():
    both = some([40, 40])
    blocks, ranges = (hidden_parts(both, 3, by=by) for by in ("time", "range"))
    assert np.array_equal(hidden_parts(both, 3), [*blocks, *ranges])
    assert np.array_equal(ranges, operating_ranges(both, 3))
    assert sum(hidden_parts(both, 2)).tolist() == [1] * 80  # whole trajectories


class Sighted(ResidualRegressor):
    """A network that can be told what it sees; told so, it learns the wrong thing."""

    def __init__(self, model=None, regressor=None, sees=None):
        super().__init__(model, regressor)
        self.sees = sees

    def fit(self, X, y):
        return super().fit(X, y if self.sees is None else np.zeros_like(y))


def test_a_network_of_the_states_is_a_depth_of_its_own():
    X, y = records(CART)
    X, y = X.assign(v=0.0), y + 0.3 * X["F"].to_numpy() ** 2
    grey_box = GreyBoxRegressor(
        CART, depths=("prior", "state_network", "network"), network=Sighted(CART, _squares())
    )
    assert list(grey_box.fit(X, y).errors_) == ["prior", "state_network", "network"]
    assert grey_box.depth_ == "network"
    grey_box.set_params(depths=("prior", "state_network"), least_gain=0.0).fit(X, y - y)
    assert grey_box.depth_ == "state_network"
    assert grey_box.estimator_.sees == ["v"]


def test_the_parameters_of_an_ensemble_are_those_of_what_it_contains():
    X, y = records(CART)
    X, y = X.assign(v=0.0), y + 0.3 * X["F"].to_numpy() ** 2
    forest = RandomForestRegressor(10, min_samples_leaf=20)
    network = EnsembleRegressor(Sighted(CART, forest), n_estimators=2)
    grey_box = GreyBoxRegressor(
        CART, depths=("prior", "state_network", "network"), network=network, n_splits=2
    )
    assert list(grey_box.fit(X, y).errors_) == ["prior", "state_network", "network"]
    assert grey_box.depth_ == "network"
    assert [each.model == grey_box.model_ for each in grey_box.estimator_.estimators_] == [True] * 2
    assert network.estimator.model is CART  # what was given is not changed


@pytest.mark.parametrize("network", [ResidualRegressor(CART), Sighted(CART, sees=["v"])])
def test_only_a_network_that_can_see_less_has_that_depth(network):
    X, y = records(CART, n=2)
    grey_box = GreyBoxRegressor(CART, depths=("prior", "state_network"), network=network)
    with pytest.raises(OptionError, match="'sees' is None"):
        grey_box.fit(X, y)
    assert "state_network" not in possible_depths(network)


@pytest.mark.parametrize(
    "wrong",
    [
        {"depths": ("deep",)},
        {"depths": "fitted"},
        {"depths": ("network",)},
        {"depths": ("state_network", "network")},
        {"by": "row"},
        {"n_splits": 1},
        {"initial_window": -1},
        {"least_gain": "much"},
        {"network": Ridge()},
    ],
)
def test_wrong_parameters_are_refused(wrong, with_friction):
    _, X, y = with_friction
    with pytest.raises(OptionError, match=next(iter(wrong))):
        GreyBoxRegressor(CART, **wrong).fit(X, y)


def test_where_the_diagnosis_names_nothing_the_prior_is_fitted():
    X, y = records(CART)
    grey_box = GreyBoxRegressor(CART, **QUICK | {"depths": ("extended",)})
    with pytest.warns(UserWarning, match=r"nothing for extended; the depth 'fitted' is taken"):
        assert grey_box.fit(X, y).depth_ == "fitted"


def test_a_fit_forgets_the_diagnosis_of_an_earlier_one():
    X, y = records(CART)
    grey_box = GreyBoxRegressor(CART, **QUICK).fit(X, y)
    assert hasattr(grey_box, "diagnosis_")
    assert not hasattr(grey_box.set_params(depths=("prior",)).fit(X, y), "diagnosis_")


@pytest.mark.slow
@pytest.mark.parametrize(("n", "named"), [(1, ()), (4, ("parameter_drift",))])
def test_a_function_of_time_is_a_law_where_other_records_are_judged(n, named):
    X, y = records(CART + effects.ParameterDrift("d", rate=0.05), n)
    grey_box = GreyBoxRegressor(CART, depths=("prior", "fitted", "extended")).fit(X, y)
    found = tuple(cause.effect for cause in grey_box.diagnosis_.causes_)
    assert tuple(each for each in found if each in TIMED) == named


def test_a_model_that_predicts_nothing_is_warned_of():
    X, y = records(CART)
    unstable = CART.replace(equations={"v": "(F + 2*v)/m"}, parameters={"m": 2.0})
    with pytest.warns(UserWarning, match=r"no depth predicts the hidden parts.*'prior'"):
        GreyBoxRegressor(unstable, depths=("prior",)).fit(X, y)
