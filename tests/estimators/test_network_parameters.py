"""A model's parameters that are trained with the network: what they come to, and the manners."""

import copy

import joblib
import numpy as np
import pandas as pd
import pytest

pytest.importorskip("torch")

from sklearn.base import clone

from sklearn_pgnn import PGNNLRegressor, PhysicsModel
from sklearn_pgnn.estimators.network.step_network import weights_of
from sklearn_pgnn.estimators.network.trajectory_net import TrajectoryNet

MASS = PhysicsModel(
    states={"x": "m", "v": "m/s"},
    parameters={"m": 1.0, "d": 0.3, "k": 4.0},
    equations={"x": "v", "v": "(force - d*v - k*x)/m"},
    inputs={"force": "N"},
    outputs={"position": "x"},
    energy={"stored": "m*v**2/2 + k*x**2/2", "dissipated": "d*v**2", "supplied": "force*v"},
)
HARD = MASS.replace(equations={"x": "v", "v": "(force - d*v - k*x - 3*x**3)/m"})
QUICK = {"max_epochs": 4, "module__neurons": 3, "refine_max_iter": 8, "substeps": 1}


def records(n_records=4, n=240, seed=0):
    random = np.random.default_rng(seed)
    t, tables, outputs = 0.05 * np.arange(n), [], []
    for i in range(n_records):
        force = np.repeat(random.uniform(-6, 6, n // 20), 20)
        run = HARD.simulate(t, force, substeps=8)
        tables.append(pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.0, "v": 0.0}))
        outputs.append(run.y[:, 0] + 0.002 * random.standard_normal(n))
    return pd.concat(tables, ignore_index=True), np.concatenate(outputs)


X, Y = records()


def prior(spread=0.5, **factors):
    changed = [
        p.with_value(p.value * factors.get(name, 1.0)).with_spread(spread)
        for name, p in MASS.parameters.items()
    ]
    return MASS.replace(parameters=changed)


OFF = prior(m=0.8, d=1.2, k=0.8)


@pytest.fixture(scope="module")
def quick():
    return PGNNLRegressor(OFF, free="all", **QUICK).fit(X, Y)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:k ended at a limit")
def test_what_the_network_cannot_say_the_parameters_do():
    net = PGNNLRegressor(OFF, free="all", corrects=["v"], sees=["x"], module__neurons=5).fit(X, Y)
    for name in ("m", "d"):
        found, truth = net.parameters_[name], MASS.parameters[name].value
        assert found.value == pytest.approx(truth, rel=0.03)
        assert found.low <= found.value <= found.high
        assert net.model_.parameters[name].value == found.value
    stiffness = net.parameters_["k"]  # any force of x may as well be the network's
    assert stiffness.high - stiffness.low > 0.4 * stiffness.value


@pytest.mark.slow
def test_derivatives_by_parameters_and_weights_are_those_of_differences(monkeypatch):
    looked = []

    def look(self):
        objective = self._objective(self._data.records)
        theta = np.append(weights_of(self.module_.core), 0.3 * self._changes())
        objective.weigh_overlap(theta)
        gradient = objective(theta).gradient
        for place in (0, 7, -1, -2, -3):
            step = np.zeros(theta.size)
            step[place] = 1e-6
            slope = (objective.cost(theta + step) - objective.cost(theta - step)) / 2e-6
            looked.append((gradient[place], slope))

    monkeypatch.setattr(TrajectoryNet, "_train_simulation", look)
    for guide in ("terms", "step"):
        PGNNLRegressor(OFF, free="all", guide=guide, lambda_phy=0.1, **QUICK).fit(X, Y)
    found, slopes = np.array(looked).T
    assert found == pytest.approx(slopes, rel=1e-5, abs=1e-8)


def test_by_default_the_model_is_taken_as_it_is():
    net = PGNNLRegressor(OFF, **QUICK).fit(X, Y)
    assert net.parameters_ == {}
    assert net.model_ is net.model


@pytest.mark.slow
def test_parameters_stay_inside_their_spread_and_the_model_given_stays_as_it_is():
    model = prior(0.01, m=0.8, d=1.2, k=0.8)
    with pytest.warns(UserWarning, match="ended at a limit of the spread or bounds"):
        net = PGNNLRegressor(model, free=["m", "k"], **QUICK).fit(X, Y)
    for name in ("m", "k"):
        value, given = net.model_.parameters[name].value, model.parameters[name].value
        assert abs(value - given) <= 0.01 * given * (1 + 1e-9)
    assert net.model_.parameters["d"] == model.parameters["d"]
    assert net.model is model


@pytest.mark.slow
def test_it_survives_copies_and_goes_on_from_where_it_was(quick, tmp_path):
    joblib.dump(quick, tmp_path / "net")
    for twin in (joblib.load(tmp_path / "net"), copy.deepcopy(quick)):
        assert np.array_equal(twin.predict(X), quick.predict(X))
    assert clone(quick).get_params()["free"] == "all"
    on = copy.deepcopy(quick).partial_fit(X, Y)
    assert on.free_run_error_ <= quick.free_run_error_ * (1 + 1e-9)


def test_the_stepper_steps_as_the_free_run(quick):
    first = X.trajectory == 0
    stepper = quick.stepper(x0=[0.0, 0.0])
    found = [stepper.step([u])[0] for u in X.force[first][:-1]]
    assert np.allclose(found, quick.predict(X[first])[1:], atol=1e-12)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"free": "m"}, "free: expected 'all'"),
        ({"free": ["mass"]}, "among m, d, k"),
        ({"free": ["m"], "structure": "increment"}, "does not depend on the model's parameters"),
        ({"overlap": -1}, "overlap: expected a number"),
        ({"corrects": ["x"]}, "corrects: expected a list of names among v"),
        ({"corrects": ["v"], "structure": "increment"}, "needs structure='correction'"),
        ({"sees": "x"}, "sees: expected a list of names among x, v, force"),
        ({"sees": ["x"], "guide": "step"}, "cannot be combined with guide='step'"),
    ],
)
def test_what_cannot_be_is_refused(options, what):
    with pytest.raises(ValueError, match=what):
        PGNNLRegressor(OFF, **options, **QUICK).fit(X, Y)


def test_parameters_without_a_model_are_refused():
    with pytest.raises(ValueError, match="needs a model"):
        PGNNLRegressor(free="all", states=["x", "v"], **QUICK).fit(X, Y)
