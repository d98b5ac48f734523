"""The last phase of the network's training: steps that count, its end, and divergence."""

import joblib
import numpy as np
import pandas as pd
import pytest
from far_cluster import FarCluster

pytest.importorskip("torch")

from sklearn_pgnn import PGNNLRegressor, PhysicsModel
from sklearn_pgnn.estimators.network.least_squares import (
    SimulationObjective,
    Sums,
    l_bfgs,
    levenberg_marquardt,
)
from sklearn_pgnn.exceptions import SimulationWarning

START = np.array([-1.2, 1.0])


class Valley:
    """Rosenbrock's function, a sum of squares whose valley bends; trials are counted."""

    def __init__(self, floor=0.0, wall=np.inf):
        self.floor, self.wall, self.trials = floor, wall, 0

    def cost(self, theta):
        """Return the cost, which is infinite from the wall on."""
        self.trials += 1
        a, b = theta
        cost = 100 * (b - a**2) ** 2 + (1 - a) ** 2 + self.floor
        return np.inf if a > self.wall else cost

    def __call__(self, theta):
        """Return the sums, which are not finite from a little before the wall on."""
        a, b = theta
        sums = Sums(self.floor, np.zeros(2), np.zeros((2, 2)))
        residual = np.array([10 * (b - a**2), 1 - a])
        jacobian = np.array([[-20 * a, 10.0], [-1.0, 0.0]])
        sums.add(residual, jacobian * (np.nan if a > self.wall - 0.1 else 1.0), 1.0)
        return sums


def told(minimise, objective, iterations):
    """Minimise; give the weights and the costs of all steps that were told of."""
    costs = []
    theta = minimise(objective, START, iterations, lambda theta, cost: costs.append(cost))
    return theta, costs


@pytest.mark.parametrize("iterations", [1, 5, 10])
def test_steps_tried_in_vain_do_not_count(iterations):
    valley = Valley()
    _, costs = told(levenberg_marquardt, valley, iterations)
    assert len(costs) == iterations
    assert valley.trials > iterations or iterations == 1
    assert np.all(np.diff(costs) < 0)


@pytest.mark.parametrize("minimise", [levenberg_marquardt, l_bfgs])
def test_it_ends_where_the_cost_no_longer_falls(minimise):
    theta, costs = told(minimise, Valley(floor=1.0), 10_000)
    assert theta == pytest.approx([1.0, 1.0], abs=0.02)
    assert costs[-1] < 1.0005
    assert len(costs) < 100


def test_it_ends_where_no_step_lowers_the_cost():
    class Uphill(Valley):
        def __call__(self, theta):
            sums = super().__call__(theta)
            sums.gradient *= -1
            return sums

    uphill = Uphill()
    theta, costs = told(levenberg_marquardt, uphill, 10_000)
    assert np.array_equal(theta, START)
    assert costs == []
    assert uphill.trials < 30


@pytest.mark.parametrize(("minimise", "least"), [(levenberg_marquardt, 0.4), (l_bfgs, 4.0)])
def test_a_step_into_a_divergence_is_taken_back(minimise, least):
    theta, costs = told(minimise, Valley(wall=0.5), 200)
    assert np.isfinite(theta).all()
    assert theta[0] <= 0.4
    assert costs[-1] < least < Valley().cost(START)


def test_a_start_that_diverges_is_left_alone():
    theta, costs = told(levenberg_marquardt, Valley(wall=-1.15), 10)
    assert np.array_equal(theta, START)
    assert costs == []


class Tasks(SimulationObjective):
    """What is done for every record, without a network."""

    def __init__(self, threads):
        self.threads, self.records, self.overlap = threads, [1.0, 2.0, 3.0], None

    def _cost_of(self, record, theta):
        return record * theta


@pytest.mark.parametrize("threads", [1, 2])
def test_no_evaluation_is_sent_to_a_cluster(threads):
    with joblib.parallel_config(backend=FarCluster()):
        assert Tasks(threads).error(2.0) == 12.0


@pytest.mark.parametrize("refine", ["lm", "lbfgs"])
def test_a_last_phase_that_cannot_begin_is_said(refine):
    unstable = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": -0.05}, {"u": "V"})
    t = np.concatenate([np.arange(n) * 0.05 for n in (400, 6, 6)])
    X = pd.DataFrame({"trajectory": np.repeat([0, 1, 2], [400, 6, 6]), "t": t, "u": 1.0})
    options = {"max_epochs": 1, "module__neurons": 2, "substeps": 1, "validation_fraction": 0}
    net = PGNNLRegressor(unstable, structure="correction", refine=refine, **options)
    expected = (
        "in 1 of 3 training trajectories .* the last training phase is skipped. Remedy: rollouts"
    )
    with pytest.warns(SimulationWarning, match=expected):
        net.fit(X, np.sin(t))
    assert len(net.history) == 1


@pytest.mark.slow
def test_by_default_a_hidden_cubic_spring_is_learnt_to_the_noise():
    model = PhysicsModel(
        states={"x": "m", "v": "m/s"},
        parameters={"d": 0.3, "k": 4.0},
        equations={"x": "v", "v": "force - d*v - k*x"},
        inputs={"force": "N"},
        outputs={"position": "x"},
    )
    truth = model.replace(equations={"x": "v", "v": "force - d*v - k*x - 3*x**3"})
    random, noise, t = np.random.default_rng(100), 0.002, 0.05 * np.arange(400)

    def record(i):
        force = np.repeat(random.uniform(-6, 6, 20), 20)
        x = truth.simulate(t, force, substeps=16).x
        first = np.where(t[:, None] == 0, x, np.nan)
        columns = {"trajectory": i, "t": t, "force": force, "x": first[:, 0], "v": first[:, 1]}
        return pd.DataFrame(columns), x[:, 0]

    tables, clean = zip(*map(record, range(10)), strict=True)
    X, y = pd.concat(tables[:6]), np.concatenate(clean[:6])
    net = PGNNLRegressor(model).fit(X, y + noise * random.standard_normal(y.size))
    left = net.predict(pd.concat(tables[6:])) - np.concatenate(clean[6:])
    assert np.sqrt(np.mean(left**2)) < 1.5 * noise


@pytest.mark.slow
def test_a_held_out_free_run_that_first_becomes_worse_ends_no_last_phase():
    model = PhysicsModel(
        states={"x": "m", "v": "m/s"},
        parameters={"m": 1.0, "d": 0.3, "k": 4.0},
        equations={"x": "v", "v": "(force - d*v - k*x)/m"},
        inputs={"force": "N"},
        outputs={"position": "x"},
    )
    truth = model.replace(equations={"x": "v", "v": "(force - d*v - k*x)/m - (3*x**3/m)"})
    random, noise, t = np.random.default_rng([14, False]), 0.002, 0.05 * np.arange(400)
    tables, outputs = [], []
    for i in range(6):
        force = np.repeat(random.uniform(-6, 6, 21), 20)[:400]
        y = truth.simulate(t, force, substeps=16).y
        first = np.where(t == 0, 0.0, np.nan)
        tables.append(
            pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": first, "v": first})
        )
        outputs.append(y + noise * random.standard_normal(y.shape))
    X, y = pd.concat(tables), np.concatenate(outputs)
    net = PGNNLRegressor(model, random_state=9).fit(X, y)
    held_out = np.array(net.history[:, "free_run"])
    rise = held_out[net.max_epochs :].max() / held_out[: net.max_epochs].min()
    assert rise > 1.5  # worse than where the last phase began
    assert np.sqrt(np.mean((net.predict(X) - y) ** 2)) < 3 * noise
