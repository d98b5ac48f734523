"""The physical terms: laws they must obey, numbers by hand, and the weight they get."""

import copy
import pickle

import braked_cart
import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn import PGNNLRegressor, PhysicsModel, make_pgnn_pipeline, network, systems
from sklearn_pgnn.estimators.network.cores import FeedForward
from sklearn_pgnn.estimators.network.least_squares import (
    SimulationObjective,
    l_bfgs,
    levenberg_marquardt,
)
from sklearn_pgnn.estimators.network.physics_loss import (
    FORGETTING,
    Motion,
    PhysicsLoss,
    as_terms,
    balanced_lambda,
)
from sklearn_pgnn.estimators.network.records import TrainingRecord
from sklearn_pgnn.estimators.network.step_network import StepNetwork, step_with, weights_of
from sklearn_pgnn.estimators.network.structure import BASE_OF, gain_of
from sklearn_pgnn.simulation.network_run import NetworkStep, network_record, samples_of

CART = systems.cart_on_spring()
WITH_ENERGY = [CART, systems.golf_robot(), systems.servo_valve()]
LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})


def motion_of(model, dt, *, duration=2.0, x0=(0.3, 0.5), input_of=lambda t: 0.2 * np.sin(3 * t)):
    """Simulate a model finely; give states, inputs and time every dt, as tensors of one window."""
    n = round(duration / dt)
    t = np.arange(n + 1) * dt
    u = input_of(t)
    run = model.simulate(t, u, list(x0), substeps=max(1, round(dt / 2e-4)))
    assert run.success
    return tuple(torch.as_tensor(part)[None] for part in (run.x, u[:-1, None], t))


def bound(terms, model, window):
    x, u, t = window
    return PhysicsLoss(as_terms(terms, model), model, pairs(x, u, t))


def pairs(x, u, t):
    ends = [np.stack([part[0, :-1].numpy(), part[0, 1:].numpy()], axis=1) for part in (x, t)]
    return Motion(ends[0], u[0][:, None].numpy(), ends[1])


# -- laws ------------------------------------------------------------------------------------------


def smooth(model):
    """Return a motion without events: the order in dt holds between them only."""
    if "torque" in model.inputs:
        return {"x0": (0.0, 8.0), "duration": 0.2}
    if "voltage" in model.inputs:
        return {"x0": (0.1, 0.0), "duration": 0.004, "input_of": lambda t: np.sin(2e3 * t)}
    return {}


@pytest.mark.parametrize("model", WITH_ENERGY, ids=lambda model: model.name)
def test_energy_of_an_exact_simulation_is_balanced_to_second_order(model):
    options, errors = smooth(model), []
    wide = 8e-5 if "voltage" in model.inputs else 4e-2
    drive = options.get("input_of", lambda t: 0.2 * np.sin(3 * t))
    # the input is held over the same spans, whatever dt
    options["input_of"] = lambda t: drive(np.floor(t / wide + 1e-9) * wide)
    for dt in (wide, wide / 2, wide / 4):
        window = motion_of(model, dt, **options)
        loss = bound(network.EnergyBalance(), model, window)
        reference = loss._residuals[0].func.__self__.reference  # depends itself a little on dt
        errors.append(float(loss.residuals(*window)[0].abs().max()) * reference)
    ratios = np.array(errors[:-1]) / errors[1:]
    assert ratios == pytest.approx(4.0, rel=0.15)


def test_energy_of_a_wrong_motion_is_not_balanced():
    x, u, t = motion_of(CART, 1e-2)
    loss = bound(network.EnergyBalance(), CART, (x, u, t))
    right = float(loss(x, u, t))
    assert float(loss(1.1 * x, u, t)) > 100 * right
    assert float(loss(x.flip(1), u, t)) > 100 * right


@pytest.mark.parametrize("model", WITH_ENERGY[:2], ids=lambda model: model.name)
def test_exact_simulation_is_passive(model):
    window = motion_of(model, 1e-3, duration=3.0)
    loss = bound(network.Passivity(), model, window)
    # what the middle of a step stands for is not exact, least where the friction turns round
    assert float(loss.residuals(*window)[0].max()) < 1e-3
    x, u, t = window
    backward = x.flip(1) * torch.tensor([1.0, -1.0])  # friction that drives
    assert float(loss.residuals(backward, u.flip(1), t)[0].max()) > 0.01


def test_passivity_does_not_ask_how_energy_is_lost():
    window = motion_of(CART.with_parameters(d=9.0), 1e-3)
    assert float(bound(network.Passivity(), CART, window)(*window)) < 1e-9
    assert float(bound(network.EnergyBalance(), CART, window)(*window)) > 1e-3


@pytest.mark.parametrize("term", [network.EnergyBalance(), network.Passivity()])
def test_unit_of_energy_does_not_matter(term):
    x, u, t = motion_of(CART, 1e-2)
    milli = CART.replace(energy={part: 1000 * value for part, value in CART.energy.items()})
    backward = x.flip(1) * torch.tensor([1.0, -1.0])  # friction that drives
    one, other = (bound(term, model, (x, u, t))(backward, u, t) for model in (CART, milli))
    assert float(one) > 1e-4
    assert float(one) == pytest.approx(float(other), rel=1e-12)


def test_uneven_time_is_balanced_too():
    t = np.cumsum(np.random.default_rng(0).uniform(0.5e-3, 2e-3, 500))
    run = CART.simulate(t, np.ones(500), [0.1, 0.0], substeps=4)
    window = tuple(torch.as_tensor(part)[None] for part in (run.x, np.ones((499, 1)), t))
    assert float(bound(None, CART, window)(*window)) < 1e-8


# -- by hand ---------------------------------------------------------------------------------------

X3 = torch.tensor([[[0.0, 1.0], [1.0, 3.0], [4.0, -2.0]]], dtype=torch.float64)
U3 = torch.zeros((1, 2, 1), dtype=torch.float64)
T3 = torch.tensor([[0.0, 0.5, 1.5]], dtype=torch.float64)


def residuals(*terms, model=CART):
    return [h[0].tolist() for h in bound(list(terms), model, (X3, U3, T3)).residuals(X3, U3, T3)]


def test_bounds():
    # x = 1, 4 in (0, 2): 0, (4 - 2)/2; v = 3, -2 in (-1, 2): (3 - 2)/3, (-1 + 2)/3
    found = residuals(network.Bounds({"x": (0, 2), "v": (-1, 2)}))
    assert found == [[[0.0, pytest.approx(1 / 3)], [1.0, pytest.approx(1 / 3)]]]


def test_rate_bounds():
    # dv/dt = 2/0.5 = 4 and -5/1 = -5 in (-4, 2)
    found = residuals(network.RateBounds({"v": (-4, 2)}))
    assert found == [[[pytest.approx(2 / 6)], [pytest.approx(1 / 6)]]]


def test_energy_balance():
    only = CART.replace(energy={"stored": "m*v**2/2"})
    # stored 1, 9, 4 J; powers (9 - 1)/0.5 and (4 - 9)/1 over their root mean square
    change = np.array([16.0, -5.0])
    expected = change / np.sqrt(np.mean(change**2))
    assert np.ravel(residuals(network.EnergyBalance(), model=only)) == pytest.approx(expected)


def test_kinds_and_weights():
    equal = network.PhysicsTerm(lambda x, u, t: x[:, 1:, 1], weight=2.0)
    below = network.PhysicsTerm(lambda x, u, t: x[:, 1:, 1], kind="inequality", weight=3.0)
    loss = bound([equal, below], CART, (X3, U3, T3))
    assert [h.ravel().tolist() for h in loss.residuals(X3, U3, T3)] == [[3.0, -2.0], [3.0, 0.0]]
    assert float(loss(X3, U3, T3)) == pytest.approx(2 * (9 + 4) / 2 + 3 * (3 + 0) / 2)


def test_function_is_an_equality():
    (term,) = as_terms(lambda x, u, t: x[:, 1:, 0], CART)
    assert term.kind == "equality"
    assert term.weight == 1.0


# -- errors ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (network.Bounds({"z": (0, 1)}), r"Bounds: expected bounds of states among x, v, got 'z'"),
        (network.RateBounds(), r"RateBounds: expected bounds of states among x, v, got none"),
        (network.Bounds({"x": (1, 1)}), r"Bounds: expected a lower and a higher bound of 'x'"),
        (network.PhysicsTerm(), r"PhysicsTerm: expected a function residual\(x, u, t\), got None"),
        (network.PhysicsTerm(len, kind="soft"), r"kind: expected one of equality, inequality"),
        ("energy", r"physics_loss: expected terms such as EnergyBalance\(\) or functions"),
        ([], r"physics_loss: expected at least one term, got none. Remedy"),
    ],
)
def test_terms_that_are_none(term, message):
    with pytest.raises(ValueError, match=message):
        bound(term, CART, (X3, U3, T3))


@pytest.mark.parametrize(
    "residual", [lambda x, u, t: x[..., 0], lambda x, u, t: x.sum(), lambda x, u, t: x[0, 1:, 0]]
)
def test_wrong_shape(residual):
    loss = bound(residual, CART, (X3, U3, T3))
    with pytest.raises(ValueError, match=r"physics_loss: PhysicsTerm gave shape.*\(1, 2\), a res"):
        loss(X3, U3, T3)


@pytest.mark.parametrize("term", [None, network.EnergyBalance(), network.Passivity()])
def test_model_without_energy(term):
    X, y = lag_records()
    with pytest.raises(ValueError, match=r"the energy of 'model' is not known.*Remedy: give the"):
        small(LAG, lambda_phy=0.1, physics_loss=term).fit(X, y)


# -- the objective of the last phase ---------------------------------------------------------------


def problem(terms, lambda_phy, *, structure="correction", n=40, stride=1):
    """Return an objective, a start, and the same loss through torch's rollout."""
    rng = np.random.default_rng(0)
    t = np.arange(n) * 0.02
    u = 3 * np.sin(4 * t)[:, None]
    record = network_record(CART, t, u, [0.1, 0.0])
    x = CART.with_parameters(k=50.0).simulate(t, u, [0.1, 0.0]).x
    y = x[:, :1] + 0.001 * rng.normal(size=(n, 1))
    some = rng.normal(size=(3, 8, 2))
    step = NetworkStep(
        CART, BASE_OF[structure], None, np.zeros(2), gain_of(CART, structure, *some, np.ones(8)),
        np.zeros(3), np.array([0.1, 0.5, 2.0]), np.array([[-1e3], [1e3]]) * np.ones(2),
    )  # fmt: skip
    torch.manual_seed(0)
    core = FeedForward(3, step.n_network_outputs, neurons=3).double()
    window = tuple(torch.as_tensor(part)[None] for part in (x, u[:-1], t))
    physics = bound(terms, CART, window)
    scale = np.array([0.02])
    objective = SimulationObjective(
        step_with(core, step), [TrainingRecord(record, x, y)], scale, physics, lambda_phy, stride
    )

    def loss():
        rollout = StepNetwork(core, step, samples_of(t, u))
        rollout.teacher_forcing = False
        found = rollout(*window[:1], *window[1:], torch.arange(n - 1)[None])
        error = ((found[0, :, :1] - torch.as_tensor(y[1:])) / 0.02) ** 2
        states = torch.cat([torch.as_tensor(record.x0)[None, None], found], dim=1)
        error = error[stride - 1 :: stride].mean()
        return (1 - lambda_phy) * error + lambda_phy * physics(states, *window[1:])

    return objective, core, loss


TERMS = {
    "none": [network.EnergyBalance()],
    "equalities": [network.EnergyBalance(weight=0.5), lambda x, u, t: x[:, 1:, 0] - x[:, :-1, 0]],
    "inequalities": [network.Passivity(), network.Bounds({"x": (-0.05, 0.05), "v": (-0.1, 0.1)})],
    "both": [network.EnergyBalance(), network.RateBounds({"v": (-0.5, 0.5)}, weight=0.2)],
}


@pytest.mark.parametrize("structure", ["output", "increment", "correction"])
@pytest.mark.parametrize(("terms", "lambda_phy"), [("none", 0.0), ("both", 0.4)])
def test_objective_and_gradient_are_those_of_the_rollout(terms, lambda_phy, structure):
    objective, core, loss = problem(TERMS[terms], lambda_phy, structure=structure)
    value = loss()
    value.backward()
    gradient = np.concatenate([p.grad.numpy().ravel() for p in core.parameters()])
    sums = objective(weights_of(core))
    assert sums.cost == pytest.approx(float(value), rel=1e-10)
    assert sums.gradient == pytest.approx(gradient, rel=1e-7, abs=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("stride", [3, 7])
def test_stride_compares_every_so_many_samples(stride):
    objective, core, loss = problem(TERMS["none"], 0.0, stride=stride, n=600)
    assert objective(weights_of(core)).cost == pytest.approx(float(loss().detach()), rel=1e-10)


@pytest.mark.parametrize("terms", TERMS)
def test_gradient_of_the_objective(terms):
    objective, core, _ = problem(TERMS[terms], 0.0 if terms == "none" else 0.6)
    theta = weights_of(core)
    direction = np.random.default_rng(1).normal(size=theta.size)
    up, down = (objective(theta + sign * 1e-6 * direction).cost for sign in (1, -1))
    expected = (up - down) / 2e-6
    assert abs(expected) > 1e-6
    assert objective(theta).gradient @ direction == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("minimise", [levenberg_marquardt, l_bfgs])
@pytest.mark.parametrize("terms", TERMS)
def test_every_step_lowers_the_objective(terms, minimise):
    objective, core, _ = problem(TERMS[terms], 0.0 if terms == "none" else 0.3)
    theta, costs = weights_of(core), []
    start = objective(theta).cost
    found = minimise(objective, theta, 15, lambda w, cost: costs.append(cost))
    assert len(costs) >= 3
    assert np.all(np.diff([start, *costs]) < 0)
    assert objective(found).cost == pytest.approx(costs[-1])
    assert costs[-1] < 0.5 * start


@pytest.mark.parametrize("minimise", [levenberg_marquardt, l_bfgs])
def test_search_ends_when_it_is_told(minimise):
    objective, core, _ = problem(TERMS["none"], 0.0)
    told = []

    def enough(weights, cost):
        told.append(cost)
        return len(told) == 2

    minimise(objective, weights_of(core), 15, enough)
    assert len(told) == 2


def test_search_from_where_the_simulation_diverges_stays():
    objective, core, _ = problem(TERMS["none"], 0.0)
    theta = 1e9 * weights_of(core)
    assert objective(theta).cost == np.inf
    assert levenberg_marquardt(objective, theta, 5, lambda w, cost: None) is theta


# -- in training -----------------------------------------------------------------------------------


def small(model, **options):
    return PGNNLRegressor(
        model,
        **{"max_epochs": 5, "module__neurons": 3, "refine_max_iter": 5, "substeps": 1, **options},
    )


def cart_records(n_records=3, n=200, *, truth=CART):
    frames, outputs = [], []
    for i in range(n_records):
        t = np.arange(n) * 0.01
        force = 4 * np.sin((2 + 1.5 * i) * t + i)
        run = truth.simulate(t, force, [0.05 * i, 0.0])
        frames.append(
            pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.05 * i, "v": 0.0})
        )
        outputs.append(run.y[:, 0])
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


def lag_records():
    t = np.arange(200) * 0.05
    X = np.column_stack([t, np.sin(t)])
    return X, LAG.simulate(t, X[:, 1]).y[:, 0]


X, Y = cart_records()
HEAVY_X, HEAVY_Y = cart_records(truth=CART.with_parameters(d=6.0))


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["increment", "correction"])
def test_loss_is_the_same_number_with_and_without_a_scaler(structure):
    options = {
        "max_epochs": 3, "module__neurons": 3, "lambda_phy": 0.3, "structure": structure,
        "horizon": 5, "rollout_epochs": 2, "refine_max_iter": 3, "substeps": 1,
    }  # fmt: skip
    alone = PGNNLRegressor(CART, **options).fit(X, Y)
    piped = make_pgnn_pipeline(CART, **options).fit(X, Y)
    costs = np.array(alone.history[:, "train_loss"])
    assert np.array(piped[-1].history[:, "train_loss"]) == pytest.approx(costs, rel=1e-5)
    exact = CART.simulate(X["t"][:200], X["force"][:200], [0.0, 0.0]).x
    found = [
        net.physics_residual(table[:200], states=1.1 * exact)
        for net, table in ((alone, X), (piped[-1], piped[:-1].transform(X)))
    ]
    assert np.nanmax(np.abs(found[0])) > 1e-3
    assert found[1] == pytest.approx(found[0], rel=1e-9, nan_ok=True)


def test_scaler_over_everything_is_refused():
    pipeline = make_pipeline(
        StandardScaler().set_output(transform="pandas"), small(CART, lambda_phy=0.2)
    )
    with pytest.raises(ValueError, match=r"time is standardised.*Remedy.*make_pgnn_pipeline"):
        pipeline.fit(X.drop(columns="trajectory"), Y)
    inputs = ColumnTransformer(
        [("scale", StandardScaler(), ["force"])],
        remainder="passthrough",
        verbose_feature_names_out=False,
    ).set_output(transform="pandas")
    with pytest.raises(ValueError, match=r"input 'force' is standardised"):
        make_pipeline(inputs, small(CART, lambda_phy=0.2)).fit(X, Y)
    with pytest.raises(ValueError, match=r"output 'position' is standardised"):
        small(CART, lambda_phy=0.2).fit(X, (Y - Y.mean()) / Y.std())


@pytest.mark.slow
def test_no_weight_is_the_loss_of_the_errors():
    one = small(CART, structure="increment").fit(HEAVY_X, HEAVY_Y)
    other = small(CART.replace(energy={}), structure="increment").fit(HEAVY_X, HEAVY_Y)
    assert one.history[:, "train_loss"] == other.history[:, "train_loss"]
    assert np.array_equal(one.predict(X), other.predict(X))


def losses_seen(lambda_phy, terms=None):
    """Return the losses of the first batch and their parts."""
    seen = []

    class Watching(PGNNLRegressor):
        def get_loss(self, y_pred, y_true, X=None, training=False):
            loss = super().get_loss(y_pred, y_true, X, training)
            physics = self._physics(torch.cat([X["x"][:, :1], y_pred], dim=1), X["u"], X["t"])
            error = self._error_loss(y_pred, y_true, X)
            seen.append([float(part.detach()) for part in (loss, error, physics)])
            return loss

    net = Watching(
        CART, lambda_phy=lambda_phy, structure="increment", max_epochs=1, refine=None,
        physics_loss=terms, module__neurons=3, substeps=1,
    )  # fmt: skip
    net.fit(HEAVY_X, HEAVY_Y)
    return np.array(seen)


@pytest.mark.parametrize("lambda_phy", [0.0, 0.25, 0.9])
def test_loss_is_the_convex_combination(lambda_phy):
    loss, error, physics = losses_seen(lambda_phy, network.EnergyBalance()).T
    assert physics.min() > 0
    assert loss == pytest.approx((1 - lambda_phy) * error + lambda_phy * physics, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_more_weight_makes_it_more_consistent(seed):
    """The plant loses energy that the balance does not know: the two losses are at odds."""

    def inconsistency(lambda_phy):
        net = small(
            CART, lambda_phy=lambda_phy, structure="correction", max_epochs=20,
            validation_fraction=0, refine_max_iter=20, random_state=seed,
        ).fit(HEAVY_X, HEAVY_Y)  # fmt: skip
        return np.sqrt(np.nanmean(net.physics_residual(HEAVY_X) ** 2))

    found = [inconsistency(weight) for weight in (0.0, 0.7, 0.999)]
    assert found[0] > found[1] > found[2]
    assert found[2] < 0.5 * found[0]


def test_adaptive_weight_follows_the_published_rule():
    weights = [torch.tensor([2.0, -1.0], requires_grad=True), torch.tensor(3.0, requires_grad=True)]
    error = (weights[0] ** 2).sum() + weights[1]  # gradient 4, -2, 1
    physics = 0.5 * weights[0].sum() * weights[1] ** 2  # gradient 4.5, 4.5, 3
    data_weight = 4.5 / ((4 + 2 + 1) / 3)
    first = balanced_lambda(error, physics, weights, None)
    assert first == pytest.approx(1 / (1 + data_weight))
    second = balanced_lambda(error, physics, weights, 0.9)
    assert second == pytest.approx((1 - FORGETTING) * 0.9 + FORGETTING * first)


def test_adaptive_weight_stays_where_physics_does_not_pull():
    weight = torch.tensor([2.0], requires_grad=True)
    error, satisfied = (weight**2).sum(), torch.relu(weight - 5.0).sum()
    assert balanced_lambda(error, satisfied, [weight], None) == 0.0
    assert balanced_lambda(error, satisfied, [weight], 0.3) == 0.3


@pytest.mark.parametrize("terms", [None, network.Bounds({"x": (-1e3, 1e3)})])
def test_adaptive_weight_stays_below_one(terms):
    weights = []

    class Watching(PGNNLRegressor):
        def get_loss(self, *args, **kwargs):
            loss = super().get_loss(*args, **kwargs)
            weights.append(self.lambda_phy_)
            return loss

    net = Watching(
        CART, lambda_phy="adaptive", structure="increment", physics_loss=terms, max_epochs=3,
        module__neurons=3, substeps=1, refine_max_iter=3,
    ).fit(X, Y)  # fmt: skip
    assert len(weights) > 30
    assert 0 <= min(weights) <= max(weights) < 1
    assert net.lambda_phy_ == weights[-1]
    assert len(set(weights)) == (1 if terms else len(weights))


@pytest.mark.parametrize("weight", [-0.1, 1, 1.5, np.nan, "much", None, True])
def test_weight_that_is_none(weight):
    message = rf"lambda_phy: expected a number from 0 to below 1, or 'adaptive', got {weight!r}"
    with pytest.raises(ValueError, match=message):
        small(CART, lambda_phy=weight).fit(X, Y)


# -- physics_residual ------------------------------------------------------------------------------


def test_physics_residual_needs_no_measurement_and_judges_any_prediction():
    net = small(CART, physics_loss=[network.EnergyBalance(), network.Bounds({"x": (-0.1, 0.1)})])
    net.fit(X, Y)
    own = net.physics_residual(X)
    assert own.shape == (len(X), 2)
    first = X.groupby("trajectory").cumcount() == 0
    assert np.isnan(own[first]).all()
    assert np.isfinite(own[~first]).all()
    exact = np.concatenate(
        [
            CART.simulate(each["t"], each["force"], each[["x", "v"]].iloc[0]).x
            for _, each in X.groupby("trajectory")
        ]
    )
    judged = net.physics_residual(X, states=exact)
    assert np.nanmax(np.abs(judged[:, 0])) < 1e-2
    excess = np.maximum(np.abs(exact[:, 0]) - 0.1, 0) / 0.2
    assert judged[~first, 1] == pytest.approx(excess[~first], abs=1e-12)
    assert np.nanmean(net.physics_residual(X, states=exact * [1, 1.2])[:, 0] ** 2) > 1e-3


def test_rows_of_physics_residual_are_the_rows_of_the_table():
    net = small(CART).fit(X, Y)
    mixed = pd.concat([X[i::3] for i in range(3)]).sort_values("t", kind="stable")
    expected = pd.Series(net.physics_residual(X)[:, 0], index=X.index)
    found = pd.Series(net.physics_residual(mixed)[:, 0], index=mixed.index)
    pd.testing.assert_series_equal(found.sort_index(), expected)


@pytest.mark.slow
def test_physics_residual_says_what_is_missing():
    lag = small(LAG).fit(*lag_records())
    with pytest.raises(ValueError, match=r"expected a model with 'energy'.*Remedy"):
        lag.physics_residual(lag_records()[0])
    plain = PGNNLRegressor(max_epochs=2).fit(X[["trajectory", "t", "force"]], Y)
    with pytest.raises(ValueError, match=r"expected a model, got none"):
        plain.physics_residual(X[["trajectory", "t", "force"]])
    net = small(CART).fit(X, Y)
    with pytest.raises(ValueError, match=r"states: expected shape \(600, 2\), got \(600,\)"):
        net.physics_residual(X, states=Y)


# -- the paper's losses, in units and joules -------------------------------------------------------


def one_cart_record():
    t = 0.02 * np.arange(80)
    force = np.sin(3 * t)
    return np.column_stack([t, force]), CART.simulate(t, force, substeps=4).y


def stored(x):
    values = {name: p.value for name, p in CART.parameters.items()}
    return values["m"] * x[..., 1] ** 2 / 2 + values["k"] * x[..., 0] ** 2 / 2


def lack(x, u, t):
    """Return the energy that steps lack [J], by hand."""
    dt, v = np.diff(t), (x[1:, 1] + x[:-1, 1]) / 2
    return np.diff(stored(x)) + dt * (CART.parameters["d"].value * v**2 - u * v)


def test_a_residual_is_the_energy_that_a_step_lacks():
    x = np.random.default_rng(0).normal(size=(6, 2))
    t, u = np.cumsum([0, 0.1, 0.2, 0.1, 0.3, 0.1]), np.arange(5.0)
    motion = Motion(np.stack([x[:-1], x[1:]], 1), u[:, None, None], np.stack([t[:-1], t[1:]], 1))
    loss = PhysicsLoss([network.EnergyBalance()], CART, motion, scaled=False)
    window = [torch.as_tensor(part)[None] for part in (x, u[:, None], t)]
    assert loss.residuals(*window)[0][0, :, 0].numpy() == pytest.approx(lack(x, u, t))


@pytest.mark.parametrize("lambda_phy", [0.0, 0.25])
def test_the_loss_of_single_steps_is_the_papers(lambda_phy):
    seen = []

    class Watching(PGNNLRegressor):
        def get_loss(self, y_pred, y_true, X=None, training=False):
            loss = super().get_loss(y_pred, y_true, X, training)
            error = float(((y_pred.detach() - y_true) ** 2).sum(-1).mean())
            x, u, t = (X[name].numpy() for name in ("x", "u", "t"))
            steps = [
                lack(np.stack([x[k, 0], y_pred[k, 0].detach().numpy()]), u[k, :, 0], t[k])
                for k in range(len(x))
            ]
            seen.append(
                (float(loss), (1 - lambda_phy) * error + lambda_phy * np.mean(np.square(steps)))
            )
            return loss

    Watching(
        CART, structure="increment", lambda_phy=lambda_phy, scaled=False, max_epochs=1,
        refine=None, substeps=1,
    ).fit(*one_cart_record())  # fmt: skip
    got, expected = np.transpose(seen)
    assert got == pytest.approx(expected, rel=1e-9)


def test_scaled_is_yes_or_no():
    with pytest.raises(ValueError, match="scaled: expected True or False, got 'J'"):
        PGNNLRegressor(CART, scaled="J").fit(*one_cart_record())


# -- a balance with a dissipation of its own, whose parameters are trained -------------------------

BRAKED, LONG = braked_cart.CART, braked_cart.QUICK
OWN = network.EnergyBalance(dissipated="d*v**2 + c*abs(v)**3", parameters={"c": 0.1})
BRAKED_X, BRAKED_Y = braked_cart.records()


@pytest.fixture(scope="module")
def balanced():
    return PGNNLRegressor(BRAKED, lambda_phy=0.1, physics_loss=OWN, **LONG).fit(BRAKED_X, BRAKED_Y)


@pytest.mark.slow
def test_the_parameter_of_a_balance_is_found(balanced):
    assert balanced.dissipation_["c"] == pytest.approx(0.5, rel=0.1)
    assert balanced.model_.parameters["c"].value == balanced.dissipation_["c"]
    assert balanced.parameters_ == {}
    assert "c" not in BRAKED.parameters


@pytest.mark.slow
def test_the_residual_is_that_of_the_trained_balance(balanced):
    own, priors = (
        np.nanmean(each.physics_residual(BRAKED_X) ** 2)
        for each in (
            balanced,
            PGNNLRegressor(BRAKED, lambda_phy=0.0, **LONG).fit(BRAKED_X, BRAKED_Y),
        )
    )
    assert own < 0.2 * priors


@pytest.mark.slow
def test_a_trained_balance_survives_copies(balanced):
    for again in (copy.deepcopy(balanced), pickle.loads(pickle.dumps(balanced))):
        assert np.array_equal(again.predict(BRAKED_X), balanced.predict(BRAKED_X))
        assert np.array_equal(
            again.physics_residual(BRAKED_X), balanced.physics_residual(BRAKED_X), equal_nan=True
        )


def test_the_parameter_does_not_become_negative():
    drives = network.EnergyBalance(
        dissipated="d*v**2 + 9*v**2 + c*abs(v)**3", parameters={"c": 0.1}
    )
    options = {**LONG, "refine_max_iter": 5, "max_epochs": 2}
    balanced = PGNNLRegressor(BRAKED, lambda_phy=0.5, physics_loss=drives, **options).fit(
        BRAKED_X, BRAKED_Y
    )
    assert 0 <= balanced.dissipation_["c"] < 0.1


def test_without_a_weight_no_balance_is_trained():
    options = {**LONG, "refine": None, "max_epochs": 1}
    one = PGNNLRegressor(BRAKED, physics_loss=OWN, **options).fit(BRAKED_X, BRAKED_Y)
    assert one.dissipation_ == {}
    assert np.array_equal(
        one.predict(BRAKED_X),
        PGNNLRegressor(BRAKED, **options).fit(BRAKED_X, BRAKED_Y).predict(BRAKED_X),
    )


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (
            network.EnergyBalance(parameters={"c": 1.0}),
            "expected 'dissipated' with c in it, got none",
        ),
        (network.EnergyBalance(dissipated="d*v**2", parameters={"d": 1.0}), r"free=\['d'\] trains"),
        (network.EnergyBalance(dissipated="d*v**2 + e"), "'e'"),
        (network.EnergyBalance(dissipated="c*v", parameters={"c": -1.0}), "within its bounds"),
    ],
)
def test_balances_that_cannot_be(term, message):
    with pytest.raises(ValueError, match=message):
        PGNNLRegressor(BRAKED, lambda_phy=0.1, physics_loss=term, **LONG).fit(BRAKED_X, BRAKED_Y)
