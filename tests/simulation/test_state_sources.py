"""A state is taken from the output that determines it best, record by record."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

SPRING = {"x": "v", "v": "-30*x - 0.6*v + u"}
N = 1000
T = np.arange(N) * 0.02
U = 16 * np.repeat(np.random.default_rng(0).normal(size=N // 20), 20)
X = np.column_stack([T, U])
SENSORS = {"velocity": {"x": "x", "v": "v"}, "second position": {"p": "x", "q": "x"}}


def spring(outputs):
    return PhysicsModel({"x": "m", "v": "m/s"}, SPRING, {}, {"u": "N"}, outputs=outputs)


def measured(model, noise=1e-3, seed=1):
    run = model.simulate(T, U, substeps=8)
    return run.x, run.y + noise * np.random.default_rng(seed).normal(size=run.y.shape)


def states_of(model, y, extended=None):
    records = read_records(model, np.vstack([X] * (len(y) // N)), y)
    return build_problem(model, records).states.estimate(extended or model).x


def error(found, x):
    return np.sqrt(np.mean((found - x)[20:-20] ** 2, axis=0))


@pytest.mark.parametrize("outputs", SENSORS.values(), ids=SENSORS)
def test_a_sparse_second_sensor_leaves_states_as_they_are(outputs):
    model = spring(outputs)
    x, y = measured(model)
    y[np.arange(N) % 20 != 0, 1] = np.nan
    alone = spring(dict([next(iter(outputs.items()))]))
    np.testing.assert_array_equal(states_of(model, y), states_of(alone, y[:, :1]))
    assert (error(states_of(model, y), x) < 0.03 * np.std(x, axis=0)).all()


def test_the_less_noisy_sensor_counts():
    model = spring(SENSORS["second position"])
    x, y = measured(model, noise=np.array([1e-4, 3e-2]))
    assert error(states_of(model, y), x)[0] < 1e-3
    x, y = measured(model, noise=np.array([3e-2, 1e-4]))
    assert error(states_of(model, y), x)[0] < 1e-3


def test_a_speed_in_noise_is_the_slope_of_a_precise_position():
    model = spring(SENSORS["velocity"])
    x, y = measured(model, noise=np.array([1e-6, 1.0]))
    assert error(states_of(model, y), x)[1] < 0.02
    x, y = measured(model, noise=np.array([1e-6, 1e-3]))
    assert error(states_of(model, y), x)[1] < 0.005  # its slope has 0.012


@pytest.mark.parametrize("column", [0, 1])
def test_a_sensor_that_stops_counts_less_than_one_that_goes_on(column):
    model = spring(SENSORS["second position"])
    x, y = measured(model)
    y[N // 2 :, column] = np.nan
    assert error(states_of(model, y), x)[0] < 2e-3


def test_every_record_has_its_own_sensor_and_that_its_own_scale():
    model = spring(SENSORS["second position"])
    x, y = measured(model)
    y = np.vstack([y, y])
    rare = np.arange(N) % 20 != 0
    y[:N][rare, 1] = np.nan
    y[N:][rare, 0] = np.nan
    both = np.vstack([x, x])
    assert error(states_of(model, y), both)[0] < 2e-3
    gain = model + effects.SensorGain("q", error=0.25)
    y[:, 1] *= 1.25
    assert error(states_of(model, y, gain), both)[0] < 2e-3
    np.testing.assert_allclose(states_of(model, y)[N:, 0], 1.25 * states_of(model, y, gain)[N:, 0])
