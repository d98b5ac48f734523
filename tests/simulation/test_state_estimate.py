"""Laws of free runs from within a record."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.simulation.state_estimate import free_run, unsigned_states
from sklearn_pgnn.trajectories import read_records

SERVO = PhysicsModel({"x": "m"}, {"x": "K*u - x/T"}, {"K": 0.1, "T": 2.0}, {"u": "V"})


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_run_from_within_a_record_knows_what_a_delayed_input_did_before(hold):
    late = SERVO + effects.InputDelay("u", 0.13)
    t = np.arange(400) / 50
    u = np.repeat(np.random.default_rng(0).uniform(-3, 3, 20), 20)
    records = read_records(SERVO, np.c_[t, u], SERVO.simulate(t, u).y)
    windows = build_problem(SERVO, records, hold=hold).windows
    whole = free_run(late, windows, 0, 400, [0.2])
    for a in (3, 100, 210):
        rest = free_run(late, windows, a, 400, whole.x[a])
        np.testing.assert_allclose(rest.x, whole.x[a:], rtol=1e-12)


def test_states_are_estimated_behind_a_sensor_that_enlarges_and_shifts_them():
    cart = systems.cart_on_spring()
    seen = cart + effects.SensorGain("position", error=0.25) + effects.SensorBias("position", 0.1)
    t = np.arange(400) / 50
    run = seen.simulate(t, 10 * np.sin(2 * t), x0=[0.1, 0.2])
    noise = 1e-6 * np.random.default_rng(0).normal(size=run.y.shape)
    records = read_records(cart, np.c_[t, 10 * np.sin(2 * t)], run.y + noise)
    states = build_problem(cart, records).states
    inner = slice(5, -5)
    np.testing.assert_allclose(states.values(seen)[inner], run.x[inner], atol=1e-3)
    np.testing.assert_allclose(
        states.values(cart)[inner], run.x[inner] * 1.25 + [0.1, 0.0], atol=1e-3
    )


@pytest.mark.parametrize("curvature", [-0.8, 0.8])
@pytest.mark.parametrize("cut", [(), (effects.SensorSaturation("position", 0.9, -0.9),)])
def test_states_are_estimated_behind_a_sensor_with_a_bent_scale(curvature, cut):
    """Also where the reading is cut, but for the samples beyond."""
    cart = systems.cart_on_spring()
    seen = cart + effects.SensorGain("position", 0.25)
    seen += effects.SensorCurvature("position", curvature)
    for effect in cut:
        seen += effect
    t = np.arange(400) / 50
    run = seen.simulate(t, 10 * np.sin(2 * t), x0=[0.1, 0.2])
    assert np.abs(run.y).max() > 0.4  # the bend matters
    noise = 1e-6 * np.random.default_rng(0).normal(size=run.y.shape)
    records = read_records(cart, np.c_[t, 10 * np.sin(2 * t)], run.y + noise)
    states = build_problem(cart, records).states.values(seen)
    inside = np.abs(run.y[:, 0]) < 0.85
    inside[:5] = inside[-5:] = False
    np.testing.assert_allclose(states[inside], run.x[inside], atol=5e-3)


@pytest.mark.parametrize(
    "sensors", [("SensorRectification",), ("SensorRectification", "SensorGain"),
                ("SensorGain", "SensorRectification"), ("SensorRectification", "SensorBias")]
)  # fmt: skip
def test_the_sign_behind_a_magnitude_is_taken_from_a_simulation(sensors):
    """Also where a gain or an offset stands before or behind it."""
    cart = systems.cart_on_spring()
    numbers = {"SensorGain": (0.25,), "SensorBias": (0.1,)}
    seen = cart
    for name in sensors:
        seen = seen + getattr(effects, name)("position", *numbers.get(name, ()))
    assert unsigned_states(seen) == ("x", "v")
    t = np.arange(400) / 50
    run = seen.simulate(t, 10 * np.sin(2 * t), x0=[0.1, 0.2])
    noise = 1e-6 * np.random.default_rng(0).normal(size=run.y.shape)
    records = read_records(cart, np.c_[t, 10 * np.sin(2 * t)], run.y + noise)
    x = build_problem(cart, records).states.values(seen)[:, 0]
    clear = np.abs(run.x[:, 0]) > 0.05  # elsewhere the smoothing rounds the turn
    np.testing.assert_allclose(x[clear], run.x[clear, 0], atol=5e-3)


def test_a_sensor_with_other_signs_hides_none():
    cart = systems.cart_on_spring()
    assert unsigned_states(cart + effects.SensorGain("position", 0.2)) == ()
    assert unsigned_states(cart.replace(outputs={"position": "abs(x) + 0.1*x"})) == ()


def spread_of(model, X, y):
    return build_problem(model, read_records(model, X, y)).states.estimate(model).spread


def cart_in_motion():
    cart = systems.cart_on_spring()
    t = np.arange(2000) / 50
    force = 20 * np.sin(0.7 * t) + 10 * np.sin(1.9 * t)
    noise = 1e-3 * np.random.default_rng(0).normal(size=(t.size, 1))
    return cart, np.column_stack([t, force]), cart.simulate(t, force).y + noise


@pytest.mark.parametrize("short", [4, 19])
def test_a_short_record_leaves_the_spread_of_states_as_it_is(short):
    cart, X, y = cart_in_motion()
    both = np.vstack([X, X[:short]]), np.vstack([y, y[:short]])
    np.testing.assert_allclose(spread_of(cart, *both), spread_of(cart, X, y), rtol=0.05)


@pytest.mark.parametrize("every", [2, 10, 11])
def test_the_spread_of_states_is_that_of_the_measured_rows(every):
    cart, X, y = cart_in_motion()
    both = cart.replace(outputs={"position": "x", "speed": "v"})
    seen = np.column_stack([y, both.simulate(X[:, 0], X[:, 1]).y[:, 1:]])
    seen[np.arange(len(X)) % every > 0, 1] = np.nan
    np.testing.assert_allclose(
        spread_of(both, X, seen), spread_of(both, X[::every], seen[::every]), rtol=0.2
    )


def test_nothing_is_known_of_states_where_all_records_are_short():
    cart, X, y = cart_in_motion()
    seen = np.full_like(y, np.nan)
    seen[::150] = y[::150]
    assert np.isinf(spread_of(cart, np.vstack([X] * 5), np.vstack([seen] * 5))).all()


@pytest.mark.parametrize("without", ["position", "speed"])
def test_a_sensor_that_is_missing_in_one_record_leaves_the_state_to_another(without):
    cart, X, _ = cart_in_motion()
    both = cart.replace(outputs={"position": "x", "speed": "v"})
    run = both.simulate(X[:, 0], X[:, 1])
    y = np.vstack([run.y, run.y])
    y[: len(X), list(both.outputs).index(without)] = np.nan
    states = build_problem(both, read_records(both, np.vstack([X, X]), y)).states
    np.testing.assert_array_equal(states.is_shown, [without == "speed", True])
    if without == "speed":
        np.testing.assert_allclose(states.known["v"][20 : len(X) - 20], run.x[20:-20, 1], atol=0.02)
