"""What inputs drive is known from the start of the record on, and what is forgotten is not free."""

import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.simulation.led_states import initial_states, led_states, start_values
from sklearn_pgnn.simulation.window_fit import ParameterPrior, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate

pytestmark = pytest.mark.core

CART = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 1.0, "d": 0.3}, {"F": "N"})
LAG = CART + effects.ActuatorLag("F", 0.4)
SIZES = np.array([0, 120, 300])
LENGTH = 30


def records(model, starts=(0.0, 0.0)):
    """Simulate two records, the actuator off its command at their starts; cut them to windows."""
    rng = np.random.default_rng(0)
    t = np.concatenate([0.05 * np.arange(n) for n in np.diff(SIZES)])
    u = np.cumsum(rng.normal(size=(t.size, 1)), axis=0)
    runs = [
        model.simulate(t[a:b], u[a:b], [0.0, u[a, 0] + off])
        for (a, b), off in zip(pairwise(SIZES), starts, strict=True)
    ]
    first = np.arange(0, t.size, LENGTH)
    windows = ShootingWindows(
        t,
        u,
        np.concatenate([run.y for run in runs]),
        SIZES,
        first,
        np.full(first.size, LENGTH),
        np.array([0.01]),
        states=tuple(CART.states),
    )
    return windows, np.concatenate([run.x for run in runs])


@pytest.mark.parametrize(
    "model",
    [
        LAG,
        CART + effects.InputRateLimit("F", 2.0, 0.1),
        CART + effects.InputBacklash("F", 12.0, 0.1),
    ],
    ids=["lag", "rate limit", "play"],
)
def test_windows_begin_where_the_start_of_the_record_leads(model):
    windows, x = records(model, starts=(4.0, -9.0))
    found = evaluate(model, windows, start_values(model, windows, x), ())
    np.testing.assert_allclose(found.x0, x[windows.starts], rtol=1e-9)
    np.testing.assert_allclose(found.squares, 0.0, atol=1e-12)
    np.testing.assert_array_equal(
        initial_states(model, windows, start_values(model, windows, x)), found.x0
    )


@pytest.mark.parametrize(
    "effect",
    [
        effects.InputGain("F", 0.3),
        effects.InputRateLimit("F", 8.0, 0.1),
        effects.InputBacklash("F", 1.2, 0.1),
        effects.InputDelay("F", 0.12),
    ],
    ids=lambda effect: effect.id,
)
def test_products_are_slopes_of_the_squares(effect):
    model = CART + effect
    model = model if set(model.states) > set(CART.states) else model + effects.ActuatorLag("F", 0.4)
    windows, x = records(model)
    x0, wrt = start_values(model, windows, x) + 0.0, tuple(model.parameters)
    x0[:, 0] += 0.2  # off the minimum

    def squares(model, x0):
        return evaluate(model, windows, x0, ()).squares

    gram = evaluate(model, windows, x0, wrt).gram
    for i, name in enumerate(wrt):
        value = model.parameters[name].value
        step = 1e-6 * max(value, 0.1)
        ends = [squares(model.with_parameters(**{name: value + s}), x0) for s in (step, -step)]
        slope = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(-2 * gram[:, i, -1], slope, rtol=1e-3, atol=1e-3 * gram.max())


def test_a_start_that_is_forgotten_is_no_freedom():
    windows, x = records(LAG)
    gram = evaluate(LAG, windows, start_values(LAG, windows, x), ()).gram
    free = gram[:, 1, 1]
    forgotten = np.exp(-2 * (windows.t[windows.starts]) / 0.4)
    np.testing.assert_allclose(free / free[0], forgotten, rtol=0.02)


def test_a_fit_finds_the_actuator_and_where_a_record_began():
    windows, x = records(LAG, starts=(3.0, 0.0))
    begun = LAG.with_parameters(T_F=0.2)
    free = (ParameterPrior("T_F", 1e-3, 10.0, 0.2, np.inf, 0.1),)
    expected = np.column_stack([x[windows.starts, 0], windows.u[windows.bounds[windows.record], 0]])
    fit = fit_windows(begun, windows, free, expected, np.array([1.0, 100.0]))
    assert fit.values == pytest.approx(0.4, rel=1e-3)
    assert fit.x0[0, 1] == pytest.approx(x[0, 1], rel=1e-2)


def test_states_of_the_prior_and_what_moves_with_them_are_not_led():
    windows, _ = records(LAG)
    loaded = CART.replace(
        states={"v": "m/s", "z": ""}, equations={**CART.equations, "z": "v - z"}, outputs={"v": "v"}
    )
    assert led_states(LAG, windows) == ("F_lagged",)
    assert led_states(CART, windows) == ()
    assert led_states(loaded, windows) == ()
    assert led_states(LAG, replace(windows, states=tuple(LAG.states))) == ()
    assert led_states(LAG, replace(windows, states=None)) == ()


def test_windows_whose_products_overflow_are_lost_without_a_warning():
    windows, x = records(LAG)
    huge = replace(windows, u=2.5e151 * windows.u)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = evaluate(LAG, huge, start_values(LAG, windows, x), ("d", "m", "T_F"))
    assert np.isinf(found.squares).all()
