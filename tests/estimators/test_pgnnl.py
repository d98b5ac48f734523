"""PGNNLRegressor: what it learns, what it must not read, and its manners."""

import inspect
import pickle

import joblib
import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.utils.estimator_checks import parametrize_with_checks
from skorch.callbacks import Callback, Checkpoint, EarlyStopping

from sklearn_pgnn import (
    PGNNLRegressor,
    PhysicsModel,
    datasets,
    effects,
    make_pgnn_pipeline,
    network,
    systems,
)
from sklearn_pgnn.estimators.network.structure import choose_structure
from sklearn_pgnn.exceptions import (
    OptionError,
    RecordError,
    SimulationError,
    SimulationWarning,
    TrainingError,
)

CART = systems.cart_on_spring()
LAG = PhysicsModel({"y": "V"}, {"y": "(K*u - y)/T"}, {"K": 1.0, "T": 0.5}, {"u": "V"})
STATES = ["x", "v"]
QUICK = {"max_epochs": 4, "module__neurons": 3, "refine_max_iter": 12, "substeps": 1}


def records(truth, *, n_records=4, n=150, seed=0, size=4.0, noise=0.0):
    """Return records of a cart, its states known in every row."""
    rng = np.random.default_rng(seed)
    frames, outputs = [], []
    for i in range(n_records):
        t = np.arange(n) * 0.02
        force = size * (np.sin(rng.uniform(1, 7) * t) + np.sign(np.sin(rng.uniform(1, 3) * t)))
        run = truth.simulate(t, force, rng.normal(size=2) * 0.05, substeps=4)
        frame = pd.DataFrame({"trajectory": i, "t": t, "force": force})
        frame[STATES] = run.x[:, :2]
        frames.append(frame)
        outputs.append(run.y[:, 0] + noise * rng.normal(size=n))
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


HARDENING = CART + effects.CubicStiffness("v", stiffness=300.0)
X, Y = records(HARDENING)
NEW, NEW_Y = records(HARDENING, n_records=2, seed=9)


def quick(model=CART, **options):
    return PGNNLRegressor(model, **{**QUICK, **options})


def felt_records():
    table, position = records(CART)
    return table, position + 0.1 * table["force"].to_numpy()


def rms(error):
    return float(np.sqrt(np.mean(np.square(error))))


def simulated(model, X):
    """Simulate every trajectory from its first row."""
    return np.concatenate(
        [
            model.simulate(each["t"], each["force"], each[STATES].iloc[0], substeps=4).y[:, 0]
            for _, each in X.groupby("trajectory")
        ]
    )


# -- what it learns --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_hidden_spring_is_learnt(seed):
    given, y = records(HARDENING, seed=seed, noise=1e-3)
    other, truth = records(HARDENING, n_records=2, seed=100 + seed)
    options = {"module__neurons": 4, "max_epochs": 25, "refine_max_iter": 30, "substeps": 1}
    guided = PGNNLRegressor(CART, **options).fit(given, y)
    plain = PGNNLRegressor(states=STATES, **options).fit(given, y)
    error = rms(guided.predict(other) - truth)
    assert guided.structure_ == "correction"
    assert error < 0.5 * rms(simulated(CART, other) - truth)
    assert error < rms(plain.predict(other) - truth)


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["output", "increment", "correction"])
def test_exact_model_is_not_harmed(structure):
    given, y = records(CART, noise=1e-3)
    other, truth = records(CART, n_records=2, seed=9)
    net = PGNNLRegressor(
        CART, structure=structure, max_epochs=30, module__neurons=4, substeps=1
    ).fit(given, y)
    if structure == "correction":  # less than the noise
        assert rms(net.predict(other) - truth) < 1e-3
    else:  # which have to learn what the model knows
        assert net.score(other, truth) > 0.9


@pytest.mark.slow
def test_noiseless_exact_model_stays_exact():
    given, y = records(CART)
    other, truth = records(CART, n_records=2, seed=9)
    net = PGNNLRegressor(CART, max_epochs=10, module__neurons=4).fit(given, y)
    assert net.structure_ == "correction"
    assert rms(net.predict(other) - truth) < 1e-3 * rms(truth)


@pytest.mark.parametrize(("left", "structure"), [(0.4, "correction"), (0.6, "increment")])
def test_a_model_is_corrected_where_it_foretells_most_of_the_motion(left, structure):
    begun = np.zeros((200, 2))
    measured = np.random.default_rng(0).normal(size=begun.shape) * [1.0, 50.0]
    foretold = measured * (1.0 - np.sqrt(left))
    assert choose_structure(measured, foretold, begun) == structure


@pytest.mark.slow
def test_structure_follows_the_model():
    def chosen(model, table, y):
        options = {"max_epochs": 1, "refine": None, "module__neurons": 2}
        return PGNNLRegressor(model, **options).fit(table, y).structure_

    golf = datasets.make_golf_robot(sample_rate=100, duration=4)
    valve = datasets.make_servo_valve(n_records=4)
    assert chosen(systems.golf_robot(), *golf) == "correction"
    assert chosen(systems.servo_valve(), *valve) == "increment"
    assert chosen(systems.servo_valve(limits=True), *valve) == "correction"


def test_random_weights_are_not_the_best_of_a_training():
    options = {"module__neurons": 4, "refine": None, "validation_fraction": 0.5, "random_state": 1}
    few = quick(CART, max_epochs=3, **options).fit(X, Y)
    none = quick(CART, max_epochs=0, **options).fit(X, Y)
    assert few.history[0, "valid_loss_best"]
    assert np.abs(few.predict(X) - none.predict(X)).max() > 0


def test_a_stepper_refuses_what_is_no_state_and_no_input():
    net = quick(CART, max_epochs=1).fit(X, Y)
    with pytest.raises(ValueError, match=r"x0: expected 2 numbers, one for each of x, v, got"):
        net.stepper(x0=[0.1])
    with pytest.raises(ValueError, match=r"u: expected 1 numbers, .* got shape \(2,\)"):
        net.stepper().step([0.1, 2.0])


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_stepper_refuses_what_is_not_finite(wrong):
    net = quick(CART, max_epochs=1).fit(X.assign(further=1.0), Y)
    with pytest.raises(ValueError, match=rf"x0: .* finite numbers, got {wrong} for 'v'\. Remedy"):
        net.stepper(x0=[0.1, wrong])
    stepper = net.stepper(x0=[0.1, 0.0])
    with pytest.raises(ValueError, match=rf"u: .* got {wrong} for 'force'\. Remedy: repeat the la"):
        stepper.step([wrong], [1.0])
    with pytest.raises(ValueError, match=rf"features: expected finite numbers, got \[{wrong}\]"):
        stepper.step([1.0], [wrong])
    assert stepper.t == 0
    assert stepper.step([1.0], [1.0]) == net.stepper(x0=[0.1, 0.0]).step([1.0], [1.0])


@pytest.mark.slow
def test_several_outputs():
    both = CART.replace(outputs={"position": "x", "speed": "v"})
    y = np.column_stack([Y, X["v"]])
    net = quick(both, max_epochs=10).fit(X, y)
    found = net.predict(NEW)
    assert found.shape == (len(NEW), 2)
    assert rms(found[:, 0] - NEW_Y) < 0.7 * rms(simulated(CART, NEW) - NEW_Y)
    assert rms(found[:, 1] - NEW["v"]) < 0.7 * rms(NEW["v"])
    gappy = y.copy()
    gappy[::2, 0] = np.nan
    gappy[1::3, 1] = np.nan
    assert np.isfinite(quick(both, horizon=3, rollout_epochs=2).fit(X, gappy).predict(NEW)).all()


def test_output_that_sees_the_input_at_once():
    """Rollouts compare outputs: the input is that of the same sample."""
    model = CART.replace(outputs={"felt": "x + 0.1*force"})
    seen = []

    class Watching(PGNNLRegressor):
        def get_loss(self, y_pred, y_true, X=None, training=False):
            if not self.module_.teacher_forcing:
                force = self.module_.samples["acting"][X["index"] + 1]
                seen.append((torch.as_tensor(force), y_true - X["x"][:, 1:, :1]))
            return super().get_loss(y_pred, y_true, X, training)

    net = Watching(model, horizon=5, rollout_epochs=1, max_epochs=1, refine=None, substeps=1)
    net.fit(*felt_records())
    force, felt = (torch.cat(part).numpy() for part in zip(*seen, strict=True))
    assert np.ptp(force) > 10
    assert felt == pytest.approx(0.1 * force, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("every", [3, 25])
def test_output_measured_now_and_then(every):
    seldom = np.full(len(Y), np.nan)
    seldom[1::every] = Y[1::every]
    net = quick(horizon=2, rollout_epochs=2, batch_size=20).fit(X, seldom)
    assert all(torch.isfinite(p).all() for p in net.module_.parameters())
    assert np.isfinite(net.history[:, "train_loss"]).all()
    error = rms(net.predict(NEW) - NEW_Y)
    assert error < (1 if every < 10 else 2) * rms(simulated(CART, NEW) - NEW_Y)


def test_short_trajectory_among_long_ones():
    table = pd.concat([X, X[:4].assign(trajectory="short")])
    horizons = set()

    class Watching(Callback):
        def on_epoch_end(self, net, **kwargs):
            horizons.add(net._phase.horizon)

    net = quick(horizon=10, rollout_epochs=2, refine=None, callbacks=[Watching()])
    net.fit(table, np.append(Y, Y[:4]))
    assert horizons == {1, 10}
    assert np.isfinite(net.predict(table)).all()
    assert net.predict(X[:1]) == pytest.approx(X["x"].iloc[0])


@pytest.mark.slow
def test_names_of_columns_make_no_difference():
    called = HARDENING.replace(columns={"position": "pos", "force": "F", "x": "place", "t": "s"})
    table = X.rename(columns=dict(called.columns))
    found = quick(called).fit(table, Y).predict(table)
    assert np.array_equal(found, quick(HARDENING).fit(X, Y).predict(X))


def test_uneven_time_and_first_order_hold():
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.01, 0.03, 300))
    force = 5 * np.sin(2 * t) + 3 * np.sin(5 * t)
    table = pd.DataFrame({"t": t, "force": force})
    y = HARDENING.simulate(t, force, hold="foh", substeps=4).y[:, 0]
    net = quick(hold="foh", max_epochs=20, refine_max_iter=20).fit(table, y)
    own = CART.simulate(t, force, hold="foh", substeps=4).y[:, 0]
    assert rms(net.predict(table) - y) < 0.5 * rms(own - y)


# -- other cores, no model -------------------------------------------------------------------------


class OneLayer(torch.nn.Module):
    """Another author's module."""

    def __init__(self, n_inputs, n_outputs, bias=True):
        super().__init__()
        self.linear = torch.nn.Linear(n_inputs, n_outputs, bias=bias)

    def forward(self, z):
        return self.linear(z)


def test_another_authors_module():
    net = PGNNLRegressor(CART, module=OneLayer, module__bias=False, max_epochs=3, substeps=1)
    net.fit(X, Y)
    assert rms(net.predict(NEW) - NEW_Y) < rms(simulated(CART, NEW) - NEW_Y)
    assert net.module_.core.linear.bias is None
    with pytest.raises(ValueError, match=r"refine='lm' needs the core FeedForward, got OneLayer"):
        clone(net).set_params(refine="lm").fit(X, Y)
    with pytest.raises(ValueError, match="stepper: expected a network with the core FeedForward"):
        net.stepper()


@pytest.mark.parametrize("refine", ["lm", "lbfgs"])
def test_a_core_that_cannot_be_refined_is_refused_before_any_work(refine, monkeypatch):
    monkeypatch.setattr(PGNNLRegressor, "_train_on_trajectories", None)
    with pytest.raises(ValueError, match=f"refine='{refine}' needs .*, got Recurrent. Remedy"):
        quick(module=network.Recurrent, refine=refine).fit(X, Y)
    rows = np.random.default_rng(0).normal(size=(20, 2))  # they have no last phase
    quick(None, module=network.Recurrent, refine=refine).fit(rows, rows[:, 0])


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["increment", "correction"])
def test_recurrent_core(structure):
    net = PGNNLRegressor(
        CART, structure=structure, module=network.Recurrent, module__neurons=4, max_epochs=5,
        horizon=10, rollout_epochs=3, substeps=1,
    ).fit(X, Y)  # fmt: skip
    assert np.isfinite(net.predict(NEW)).all()
    losses = net.history[:5, "train_loss"]
    assert losses[-1] < losses[0]
    assert np.array_equal(net.predict(NEW), net.predict(NEW))  # its hidden state is forgotten


@pytest.mark.parametrize("options", [{"neurons": 0}, {"layers": 1.5}, {"activation": "step"}])
def test_core_that_cannot_be(options):
    (name,) = options
    with pytest.raises(ValueError, match=f"module__{name}: expected"):
        quick(**{f"module__{name}": options[name]}).fit(X, Y)


@pytest.mark.slow
def test_plain_network_of_a_machine():
    given, y = records(CART)
    other, truth = records(CART, n_records=2, seed=9)
    options = {"max_epochs": 20, "module__neurons": 4, "refine_max_iter": 15}
    with_states = PGNNLRegressor(states=STATES, **options).fit(given, y)
    assert with_states.structure_ == "increment"
    assert with_states.score(other, truth) > 0.9
    columns = ["trajectory", "t", "force"]
    at_rest = PGNNLRegressor(**options).fit(given[columns], y)
    assert at_rest.predict(other[columns]).shape == truth.shape
    one = given["trajectory"] == 0
    array = given.loc[one, ["t", "force"]].to_numpy()
    of_array = PGNNLRegressor(time_column=0, **options).fit(array, y[one])
    of_table = PGNNLRegressor(**options).fit(given.loc[one, ["t", "force"]], y[one])
    assert np.array_equal(of_array.predict(array), of_table.predict(given.loc[one, ["t", "force"]]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"structure": "correction"}, r"structure='correction' needs a model, got none. Remedy"),
        ({"guide": "step"}, r"guide='step' needs a model, got none. Remedy"),
        ({"states": ["x", "v", "t"]}, r"states: expected 1 outputs, or 2 outputs and rates, got 3"),
        ({"states": ["x", "w"]}, r"states: X has no column 'w'.* Remedy: leave 'states' out"),
        ({"lambda_phy": 0.5}, r"physics_loss: expected a model, got none. Remedy: give model=, or"),
        (
            {"time_column": "clock"},
            r"time_column: X has no 'clock'; it has trajectory, t, force, x, v",
        ),
    ],
)
def test_plain_network_that_cannot_be(options, message):
    with pytest.raises(ValueError, match=message):
        PGNNLRegressor(**options).fit(X, Y)


def test_plain_network_of_outputs_alone():
    given, both = X[["trajectory", "t", "force"]], np.column_stack([Y, X["v"]])
    for y in (Y, both):
        plain = PGNNLRegressor(max_epochs=20, refine_max_iter=20, module__neurons=4)
        assert plain.fit(given, y).score(given, y) > 0.5
        assert len(plain.model_.states) == 2 * np.atleast_2d(y.T).shape[0]


@pytest.mark.slow
def test_plain_network_of_tables_with_names():
    y = np.column_stack([Y, X["v"]])
    table = pd.DataFrame(y, columns=["angle", "speed"])
    net, named = (
        PGNNLRegressor(states=STATES, **QUICK).fit(X, measured) for measured in (y, table)
    )
    assert np.array_equal(net.predict(NEW), named.predict(NEW))


@pytest.mark.slow
def test_repr_is_short_and_says_what_was_chosen():
    text = repr(PGNNLRegressor(LAG, lambda_phy=0.1, module__neurons=3, callbacks="disable"))
    assert text.startswith("PGNNLRegressor(")
    parts = ["model=<PhysicsModel 'model': y>", "lambda_phy=0.1", "module__neurons=3"]
    assert all(part in text for part in [*parts, "callbacks='disable'"])
    assert len(text) < 130
    assert repr(PGNNLRegressor()) == "PGNNLRegressor()"
    assert repr(quick().fit(X, Y)) == repr(quick())


@pytest.mark.slow
def test_independent_rows():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(300, 3)) * [1, 100, 1e-3] + [5, -1e3, 0]
    b = np.sin(A[:, 0]) + A[:, 1] / 50 + 1e3 * A[:, 2]
    net = PGNNLRegressor(max_epochs=100).fit(A, b)
    assert net.score(A, b) > 0.99
    order = rng.permutation(300)
    assert net.predict(A[order]) == pytest.approx(net.predict(A)[order])
    gru = PGNNLRegressor(max_epochs=20, module=network.Recurrent).fit(A, b)
    assert gru.score(A, b) > 0.5
    with pytest.raises(ValueError, match="lambda_phy: expected 0 where rows have no time"):
        PGNNLRegressor(lambda_phy=0.1).fit(A, b)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"structure": "residual"}, r"structure: expected 'auto' or one of output, increment"),
        ({"guide": "both"}, r"guide: expected 'auto', 'simulation', 'step'.* or None, got 'both'"),
        ({"refine": "adam"}, r"refine: expected one of .*got 'adam'"),
        ({"horizon": 0}, r"horizon: expected an integer >= 1, got 0"),
        ({"horizon": 2.5}, r"horizon: expected an integer >= 1, got 2.5"),
        ({"horizon": "long"}, r"horizon: expected an integer >= 1, got 'long'"),
        ({"refine_max_iter": 2.5}, r"refine_max_iter: expected an integer >= 0, got 2.5"),
        ({"rollout_epochs": -1}, r"rollout_epochs: expected an integer >= 0, got -1"),
        ({"n_iter_no_change": None}, r"n_iter_no_change: expected an integer >= 1, got None"),
        (
            {"validation_fraction": 1.0},
            r"validation_fraction: expected a share from 0 to below 1, got 1.0",
        ),
        (
            {"validation_fraction": "some"},
            r"validation_fraction: expected a share from 0 to below 1, got 'some'",
        ),
        ({"max_epochs": -3}, r"max_epochs: expected an integer >= 0, got -3"),
        ({"max_epochs": 2.5}, r"max_epochs: expected an integer >= 0, got 2.5"),
        ({"batch_size": 0}, r"batch_size: expected an integer >= 1 or -1 for all, got 0"),
        ({"batch_size": -2}, r"batch_size: expected an integer >= 1 or -1 for all, got -2"),
        ({"lr": 0}, r"lr: expected a number above 0, got 0"),
        ({"lr": "fast"}, r"lr: expected a number above 0, got 'fast'"),
        ({"module": "x"}, r"module: expected a class such as FeedForward, got 'x'"),
        ({"optimizer": "adam"}, r"optimizer: expected a class such as torch.optim.Adam, got 'ad"),
        ({"hold": "linear"}, r"hold: expected one of zoh, foh"),
        ({"substeps": 0}, r"substeps: expected an integer >= 1, got 0"),
    ],
)
def test_parameters_that_are_none(options, message):
    with pytest.raises(ValueError, match=message):
        quick(**options).fit(X, Y)


def test_weights_of_samples_are_refused():
    message = r"sample_weight: expected none, for PGNNLRegressor weighs .* Remedy: leave it out"
    with pytest.raises(OptionError, match=message):
        quick().fit(X, Y, sample_weight=np.ones(len(X)))


@pytest.mark.parametrize("structure", ["auto", "correction"])
def test_free_parameters_refuse_the_simulation_as_a_guide(structure, monkeypatch):
    monkeypatch.setattr(PGNNLRegressor, "_prepare_training", None)  # before any work
    message = r"guide='simulation' does not go with free=\['k'\]: .*Remedy: guide='terms'"
    with pytest.raises(OptionError, match=message):
        quick(free=["k"], guide="simulation", structure=structure).fit(X, Y)


# -- leakage ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "net",
    [
        quick(structure="increment", horizon=3, rollout_epochs=1),
        quick(structure="correction", guide="step", lambda_phy=0.1),
        quick(structure="output"),
        quick(None, states=STATES),
        make_pgnn_pipeline(CART, structure="increment", **QUICK),
    ],
    ids=["increment", "correction", "output", "plain", "pipeline"],
)
def test_states_after_the_first_row_are_not_read(net):
    later = X.groupby("trajectory").cumcount() > 0
    poisoned = X.copy()
    poisoned.loc[later, STATES] = np.nan
    poisoned.loc[later & (X.index % 2 == 0), STATES] = 1e6
    expected = clone(net).fit(X, Y)
    assert np.array_equal(expected.predict(poisoned), expected.predict(X))
    assert np.array_equal(clone(net).fit(poisoned, Y).predict(X), expected.predict(X))
    moved = X.copy()
    moved.loc[~later, "x"] += 0.1  # the first row is
    assert not np.allclose(expected.predict(moved), expected.predict(X))


@pytest.mark.slow
def test_prediction_is_causal():
    net = quick(structure="correction").fit(X, Y)
    cut = X[X["trajectory"] == 0]
    assert np.array_equal(net.predict(cut[:100]), net.predict(cut)[:100])


# -- one step at a time ----------------------------------------------------------------------------


def test_a_stepper_says_where_its_guide_fails_and_stays_there():
    tank = PhysicsModel({"h": "m"}, {"h": "(q - sqrt(h))/A"}, {"A": 1.0}, {"q": "m^3/s"})
    t = np.arange(80) * 0.05
    q = 1.0 + 0.5 * np.sin(t)
    table = pd.DataFrame({"t": t, "q": q, "h": 1.0})
    options = {"module__neurons": 2, "max_epochs": 1, "refine": None, "guide": "simulation"}
    net = PGNNLRegressor(tank, **options).fit(table, tank.simulate(t, q, [1.0]).y)
    stepper = net.stepper(x0=[1.0])
    stepper.step(1.0)
    before = stepper.t, stepper.x.copy()
    message = (
        r"step: the simulation of 'model', which guides the network, became non-finite between "
        r"t = 0\.05 s and t = 0\.1 s \(before: h = 1\)\. Remedy: .*Nothing was advanced\."
    )
    for _ in range(2):
        with pytest.raises(SimulationError, match=message):
            stepper.step(-100.0)
    assert (stepper.t, stepper.x) == before
    assert np.isfinite(stepper.step(1.0)).all()


@pytest.mark.slow
@pytest.mark.parametrize("guide", [None, "simulation", "step"])
@pytest.mark.parametrize("piped", [False, True], ids=["alone", "in a pipeline"])
def test_stepper_is_the_prediction(guide, piped):
    options = {**QUICK, "structure": "increment", "guide": guide}
    net = make_pgnn_pipeline(CART, **options) if piped else PGNNLRegressor(CART, **options)
    net.fit(X, Y)
    one = X[X["trajectory"] == 1]
    stepper = (net[-1] if piped else net).stepper(x0=one[STATES].iloc[0])
    found = [stepper.step(u)[0] for u in one["force"][:-1]]
    assert found == pytest.approx(net.predict(one)[1:], rel=1e-9, abs=1e-9)
    assert stepper.t == pytest.approx(one["t"].iloc[-1])


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["increment", "correction"])
@pytest.mark.parametrize("delay", [0.013, 0.02, 0.11])
def test_stepper_remembers_late_inputs(structure, delay):
    late = CART + effects.InputDelay("force", delay=delay)
    net = quick(late, structure=structure).fit(X, Y)
    one = X[X["trajectory"] == 1]
    stepper = net.stepper(x0=one[STATES].iloc[0])
    found = [stepper.step(u)[0] for u in one["force"][:-1]]
    assert found == pytest.approx(net.predict(one)[1:], rel=1e-9, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [None, 0.05])
def test_stepper_gives_outputs_that_depend_on_the_input_itself(delay):
    felt = CART.replace(outputs={"felt": "x + 0.1*force"})
    felt = felt if delay is None else felt + effects.InputDelay("force", delay=delay)
    net = quick(felt, structure="correction").fit(*felt_records())
    one = X[X["trajectory"] == 1]
    stepper, found = net.stepper(x0=one[STATES].iloc[0]), []
    for u in one["force"]:
        found.append(stepper.output(u)[0])
        assert stepper.output(u)[0] == found[-1]
        stepper.step(u)
    assert found == pytest.approx(net.predict(one), rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_stepper_with_further_columns():
    table = X.assign(heat=np.sin(np.arange(len(X)) / 50))
    net = quick().fit(table, Y)
    one = table[table["trajectory"] == 2]
    stepper = net.stepper(x0=one[STATES].iloc[0])
    pairs = zip(one["force"][:-1], one["heat"][1:], strict=True)
    found = [stepper.step(u, features=[heat])[0] for u, heat in pairs]
    assert found == pytest.approx(net.predict(one)[1:], rel=1e-9, abs=1e-9)


# -- further columns -------------------------------------------------------------------------------


@pytest.mark.slow
def test_further_column_is_learnt():
    """The spring is stiffer when it is cold: only a further column tells."""
    frames, outputs = [], []
    for i, cold in enumerate([0.0, 1.0, 0.5, 0.2, 0.8, 0.6]):
        part, y = records(CART.with_parameters(k=40.0 + 20 * cold), n_records=1, seed=i)
        frames.append(part.assign(trajectory=i, cold=cold))
        outputs.append(y)
    table, y = pd.concat(frames, ignore_index=True), np.concatenate(outputs)
    train = table["trajectory"] < 5
    options = {"max_epochs": 15, "module__neurons": 4, "substeps": 1}
    seeing = PGNNLRegressor(CART, **options).fit(table[train], y[train])
    blind = PGNNLRegressor(CART, **options).fit(table[train].drop(columns="cold"), y[train])
    error = rms(seeing.predict(table[~train]) - y[~train])
    assert error < 0.5 * rms(blind.predict(table[~train].drop(columns="cold")) - y[~train])


@pytest.mark.slow
def test_further_column_that_is_no_number():
    with pytest.raises(RecordError, match=r"column 'shift' is not numeric. Remedy: encode it"):
        quick().fit(X.assign(shift="late"), Y)
    dates = pd.Timestamp("2026-01-31") + pd.to_timedelta(X["t"], unit="s")
    with pytest.raises(RecordError, match=r"column 'date' is not numeric. Remedy: encode it"):
        quick().fit(X.assign(date=dates), Y)
    gappy = X.assign(heat=1.0)
    gappy.loc[7, "heat"] = np.nan
    with pytest.raises(RecordError, match=r"column 'heat' is nan in row 7; expected a finite numb"):
        quick().fit(gappy, Y)
    net = quick().fit(X.assign(heat=1.0), Y)
    with pytest.raises(RecordError, match=r"column 'heat' is nan in row 7"):
        net.predict(gappy)


# -- skorch ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_history_tells_of_every_phase():
    net = quick(horizon=5, rollout_epochs=3, max_epochs=4).fit(X, Y)
    history = net.history
    assert len(history) >= 9  # some steps of the last phase
    for key in ("epoch", "train_loss", "free_run", "free_run_best", "dur"):
        assert len(history[:, key]) == len(history)
    assert history[:, "epoch"] == list(range(1, len(history) + 1))
    assert min(history[:, "free_run"]) >= net.free_run_error_
    assert np.all(np.diff(history[7:, "train_loss"]) < 0)


def test_best_free_run_is_kept():
    net = quick(max_epochs=30, refine=None, lr=0.3).fit(X, Y)  # so fast that it staggers
    assert net.free_run_error_ == pytest.approx(min(net.history[:, "free_run"]))
    assert net.history[-1, "free_run"] > net.free_run_error_


def test_patience_ends_a_phase():
    rollouts = {"horizon": 5, "rollout_epochs": 200, "lr": 1.0}
    net = quick(max_epochs=1, n_iter_no_change=3, refine=None, **rollouts).fit(X, Y)
    assert len(net.history) < 201
    assert not any(net.history[-3:, "free_run_best"])


class Stop(Callback):
    """Do something at an epoch's end."""

    def __init__(self, at, what=KeyboardInterrupt):
        self.at, self.what = at, what

    def on_epoch_end(self, net, **kwargs):
        if len(net.history) == self.at:
            raise self.what


@pytest.mark.parametrize("at", [3, 6, 9], ids=["steps", "rollouts", "simulation"])
def test_interrupted_training_keeps_the_best(at):
    net = quick(horizon=3, rollout_epochs=3, max_epochs=4, callbacks=[Stop(at)]).fit(X, Y)
    assert len(net.history) == at
    assert net.free_run_error_ == pytest.approx(min(net.history[:, "free_run"]))
    assert np.isfinite(net.predict(NEW)).all()


@pytest.mark.filterwarnings("ignore")
def test_a_model_that_is_no_number_at_a_state_is_named_as_the_cause():
    rooted = CART.replace(equations={"x": "v", "v": "(force - k*sqrt(x) - d*v)/m"})
    message = r"the error of a single step is nan, though .* Remedy: a model whose equations"
    with pytest.raises(TrainingError, match=message):
        quick(rooted, structure="correction", guide=None).fit(X, Y)


def test_other_errors_are_not_swallowed():
    with pytest.raises(ZeroDivisionError):
        quick(callbacks=[Stop(2, ZeroDivisionError)]).fit(X, Y)


def test_callbacks_of_skorch(tmp_path):
    saved = Checkpoint(dirname=tmp_path, monitor="free_run_best")
    stop = EarlyStopping(monitor="free_run", patience=2, threshold=0.5)
    net = quick(max_epochs=50, callbacks=[saved, ("stop", stop)], refine=None).fit(X, Y)
    assert 3 <= len(net.history) < 50
    expected = net.predict(NEW)
    other = clone(net).set_params(callbacks=None, max_epochs=1, lr=1e-6).fit(X, Y)
    assert not np.allclose(other.predict(NEW), expected)
    other.load_params(checkpoint=saved)
    assert np.array_equal(other.predict(NEW), expected)


@pytest.mark.slow
def test_checkpoint_sees_the_last_phase(tmp_path):
    saved = Checkpoint(dirname=tmp_path, monitor="free_run_best")
    net = quick(callbacks=[saved], max_epochs=2, module__neurons=5, refine_max_iter=20)
    net.fit(X, Y)
    assert np.argmin(net.history[:, "free_run"]) >= 2  # the best is of the last phase
    expected = net.predict(NEW)
    net.load_params(checkpoint=saved)
    assert np.array_equal(net.predict(NEW), expected)


@pytest.mark.slow
def test_verbose_prints_epochs(capsys):
    quick(verbose=1).fit(X, Y)
    printed = capsys.readouterr().out
    assert "free_run" in printed
    assert len(printed.splitlines()) >= 6
    quick().fit(X, Y)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("way", ["partial_fit", "warm_start"])
def test_training_goes_on(way):
    net = quick(
        max_epochs=3, refine=None, validation_fraction=0, warm_start=way == "warm_start"
    ).fit(X, Y)
    first, rate = net.history[2, "train_loss"], net.optimizer_.param_groups[0]["lr"]
    assert rate == net.lr
    step = net.step_
    for _ in range(4):
        (net.fit if way == "warm_start" else net.partial_fit)(X, Y)
    assert net.step_ is step
    losses = net.history[:, "train_loss"]
    assert len(losses) == 15
    assert losses[-1] < 0.8 * first


@pytest.mark.slow
def test_partial_fit_begins_where_there_is_nothing():
    assert np.array_equal(quick().partial_fit(X, Y).predict(X), quick().fit(X, Y).predict(X))


@pytest.mark.slow
def test_training_on_never_makes_it_worse():
    net = quick().fit(X, Y)
    first = net.free_run_error_
    net.set_params(lr=3.0, refine=None)
    net.partial_fit(X, Y)
    assert net.free_run_error_ <= first


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"criterion": torch.nn.L1Loss},
        {"optimizer": torch.optim.SGD, "optimizer__momentum": 0.5, "lr": 0.05},
        {"device": "cpu", "batch_size": 64},
        {"batch_size": -1, "iterator_train__shuffle": False},
        {"horizon": 5, "rollout_epochs": 2, "batch_size": -1},
        {"module": network.FeedForward, "module__layers": 1, "module__activation": "silu"},
        {"validation_fraction": 0},
        {"refine": "lbfgs"},
        {"n_records": 1},
    ],
    ids=lambda options: " ".join(options),
)
def test_options(options):
    given, y = records(HARDENING, n_records=options.pop("n_records", 3))
    net = quick(**{"max_epochs": 10, **options}).fit(given, y)
    assert rms(net.predict(NEW) - NEW_Y) < rms(simulated(CART, NEW) - NEW_Y)
    assert np.isnan(net.free_run_error_) == (options.get("validation_fraction") == 0)


@pytest.mark.slow
def test_set_params_reaches_the_core():
    net = quick().set_params(module__neurons=5, module__layers=1).fit(X, Y)
    assert net.module_.core.sizes[1:-1] == (5,)
    net.set_params(module__neurons=2).fit(X, Y)
    assert net.module_.core.sizes[1:-1] == (2,)
    with pytest.raises(ValueError, match="neuron"):
        quick(module_neurons=3).fit(X, Y)


@pytest.mark.parametrize("changed", [{"module__neurons": 5}, {"module": OneLayer}])
def test_a_core_that_was_changed_is_not_fitted(changed):
    net = quick(max_epochs=1, refine=None).fit(X, Y).set_params(**changed)
    with pytest.raises(NotFittedError):
        net.predict(X)
    with pytest.raises(NotFittedError):
        pickle.loads(pickle.dumps(net)).predict(X)


def test_other_parameters_wait_for_the_next_fit():
    net = quick(max_epochs=1, refine=None).fit(X, Y)
    before = net.predict(X)
    assert np.array_equal(net.set_params(lr=0.1, structure="output").predict(X), before)
    assert net.set_params(module__neurons=5).fit(X, Y).module_.core.sizes[1] == 5


@pytest.mark.slow
def test_parameters_are_those_of_the_constructor():
    before = set(quick().get_params(deep=False))
    net = quick().fit(X, Y)
    assert set(net.get_params(deep=False)) == before
    named = set(inspect.signature(PGNNLRegressor).parameters) - {"kwargs"}
    assert named <= before
    assert not [name for name in before if name.startswith("_")]


# -- scikit-learn ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_seed_decides_and_nothing_else_changes():
    torch.manual_seed(3)
    expected = torch.random.get_rng_state()
    given, y = X.copy(), Y.copy()
    net = quick(horizon=3, rollout_epochs=1)
    params = net.get_params()
    first = net.fit(given, y).predict(X)
    assert torch.equal(torch.random.get_rng_state(), expected)
    pd.testing.assert_frame_equal(given, X)
    assert np.array_equal(y, Y)
    assert {k: v for k, v in net.get_params().items() if "callbacks" not in k} == {
        k: v for k, v in params.items() if "callbacks" not in k
    }
    torch.manual_seed(4)
    assert np.array_equal(clone(net).fit(X, Y).predict(X), first)
    assert not np.array_equal(quick(random_state=1).fit(X, Y).predict(X), first)


def test_not_fitted():
    net = quick()
    for method in (net.predict, net.physics_residual):
        with pytest.raises(NotFittedError):
            method(X)
    with pytest.raises(NotFittedError):
        net.stepper()
    with pytest.raises(ValueError, match=r"learns its size from the data\. Remedy: call fit first"):
        net.initialize()
    assert not hasattr(net, "predict_proba")


@pytest.mark.slow
def test_columns_must_be_the_same():
    net = quick().fit(X.assign(heat=1.0), Y)
    with pytest.raises(ValueError, match="heat"):
        net.predict(X)


def test_divergence_is_told():
    net = quick(structure="increment", max_epochs=1, refine=None).fit(X, Y)
    with torch.no_grad():
        for weight in net.module_.core.parameters():
            weight.fill_(50.0)
    net.step_.reach[:] *= 0.001
    with pytest.warns(
        SimulationWarning, match=r"trajectory '0'.*exceeded 1000 times the range.*Remedy"
    ):
        found = net.predict(X)
    assert np.isfinite(found).all()


CANNOT_HOLD = {
    "check_no_attributes_set_in_init": "skorch's constructor sets history_, initialized_ and "
    "virtual_params_",
}


@pytest.mark.filterwarnings("ignore::UserWarning")
@parametrize_with_checks(
    [PGNNLRegressor(max_epochs=10)], expected_failed_checks=lambda estimator: CANNOT_HOLD
)
def test_scikit_learn_checks(estimator, check):
    check(estimator)


def test_threads_train_the_same_network():
    def train(_=None):
        return PGNNLRegressor(CART, random_state=0, **QUICK).fit(X, Y)

    alone, before = train(), torch.get_rng_state()
    together = joblib.Parallel(n_jobs=4, prefer="threads")(
        joblib.delayed(train)(k) for k in range(6)
    )
    for net in together:
        assert net.history[:, "train_loss"] == alone.history[:, "train_loss"]
        assert np.array_equal(net.predict(NEW), alone.predict(NEW))
    assert torch.equal(torch.get_rng_state(), before)
