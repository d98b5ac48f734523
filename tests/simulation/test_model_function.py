"""A step in machine code is the step of the textbook, of the states and of their sensitivities."""

from math import factorial

import numpy as np
import pytest
from numba import njit

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.simulation.compiled import call, compile_model
from sklearn_pgnn.simulation.model_function import OBSERVE, OUTPUTS, RATES, STEP
from sklearn_pgnn.simulation.simulate import parameter_values

LINEAR = PhysicsModel(
    {"x": "", "v": ""},
    {"x": "v", "v": "b*u - k*x - d*v"},
    {"k": 2.0, "d": 0.3, "b": 0.7},
    {"u": ""},
)
A, B, H = np.array([[0.0, 1.0], [-2.0, -0.3]]), np.array([0.0, 0.7]), 0.1


@njit
def run(function, task, t, h, x, S, u, p, s, stuck, out):
    call(function, task, t, h, x, S, u, u, p, s, stuck, out)


def run_task(task, model, x, u, *, wrt=(), method="rk4", stuck=(), s=()):
    """Return the states, their sensitivities and the entries behind a task."""
    function, source = compile_model(model, wrt, method)
    n_p = len(wrt)
    S, out = np.hstack([np.zeros((2, n_p)), np.eye(2)]), np.zeros(source.size)
    x = np.array(x, dtype=float)
    run(
        function.argument, task, 0.0, H, x, S, np.atleast_1d(u).astype(float),
        parameter_values(model), np.array(s, dtype=float), np.array(stuck, dtype=bool), out,
    )  # fmt: skip
    return x, S, out


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("rk4", 4)])
def test_a_step_of_a_linear_model_is_its_exponential_up_to_the_order(method, order):
    powers = [np.linalg.matrix_power(H * A, k) / factorial(k) for k in range(order + 1)]
    driven = H * sum(np.linalg.matrix_power(H * A, k) / factorial(k + 1) for k in range(order))
    x, S, _ = run_task(STEP, LINEAR, [0.5, -0.2], 1.5, method=method)
    np.testing.assert_allclose(S, sum(powers), rtol=1e-14)
    np.testing.assert_allclose(x, sum(powers) @ [0.5, -0.2] + driven @ B * 1.5, rtol=1e-14)


def test_the_derivative_by_a_gain_is_the_response_to_the_input():
    _, S, _ = run_task(STEP, LINEAR, [0.5, -0.2], 1.5, wrt=("b",))
    response, _, _ = run_task(STEP, LINEAR, [0.0, 0.0], 1.5 / 0.7)
    np.testing.assert_allclose(S[:, 0], response, rtol=1e-13)


@pytest.mark.parametrize("wrt", [(), ("d",), ("b", "k"), ("d", "b", "k")])
def test_derivatives_by_some_parameters_are_those_by_all(wrt):
    model = LINEAR.replace(outputs={"y": "k*x + b*v", "z": "d*u"})
    names = tuple(model.parameters)
    kept = [*map(names.index, wrt), -2, -1]
    _, S, _ = run_task(STEP, model, [0.5, -0.2], 1.5, wrt=wrt)
    _, all_S, _ = run_task(STEP, model, [0.5, -0.2], 1.5, wrt=names)
    np.testing.assert_array_equal(S, all_S[:, kept])
    _, _, out = run_task(OUTPUTS, model, [0.5, -0.2], 1.5, wrt=wrt)
    _, _, all_out = run_task(OUTPUTS, model, [0.5, -0.2], 1.5, wrt=names)
    by_states = slice(-2 * (2 + len(wrt)), -2 * len(wrt) or None)
    np.testing.assert_array_equal(out[by_states], all_out[-10:-6])
    by_parameters = out[len(out) - 2 * len(wrt) :].reshape(2, -1)
    np.testing.assert_array_equal(by_parameters, all_out[-6:].reshape(2, 3)[:, kept[:-2]])


def test_a_stuck_state_stays_with_its_sensitivities():
    model = LINEAR.replace(equations={"x": "v", "v": "u - k*x - sign(v)"})
    x, S, _ = run_task(STEP, model, [0.5, 0.0], 0.3, stuck=(True,), s=(-0.7,))
    assert x.tolist() == [0.5, 0.0]
    np.testing.assert_allclose(S, [[1.0, H], [0.0, 1.0]], rtol=1e-14)


def test_what_holds_a_stuck_state_acts_on_the_others():
    """Two masses, one of which is held: the reaction is what the other equation contains, too."""
    rates = {"x": "-2*sign(v) - x", "v": "u - 3*x - sign(v)"}
    x, S, _ = run_task(
        STEP, LINEAR.replace(equations=rates), [0.5, 0.0], 0.3, stuck=(True,), s=(0,)
    )
    # sign(v) = u - 3 x, so x' = -2 u + 5 x
    growth = sum((5 * H) ** k / factorial(k) for k in range(5))
    assert x[1] == 0
    np.testing.assert_allclose(x[0], 0.12 + (0.5 - 0.12) * growth, rtol=1e-14)
    np.testing.assert_allclose(S[0, 0], growth, rtol=1e-14)


def test_rates_and_outputs_are_evaluated_in_their_places():
    model = LINEAR.replace(outputs={"y": "k*x**2 + v"})
    _, _, rates = run_task(RATES, model, [0.5, -0.2], 1.5, wrt=("k",))
    _, _, outputs = run_task(OUTPUTS, model, [0.5, -0.2], 1.5, wrt=("k",))
    np.testing.assert_allclose(rates[:3], [-0.2, 1.05 - 1.0 + 0.06, 0.0])
    np.testing.assert_allclose(outputs[2:3], [2 * 0.25 - 0.2])
    np.testing.assert_allclose(outputs[-3:], [2 * 2 * 0.5, 1.0, 0.25])  # by x, v, and k


def test_sensitivities_of_the_outputs_stand_row_by_row():
    model = LINEAR.replace(outputs={"y": "k*x**2 + v", "z": "d*u"})
    _, S, out = run_task(OBSERVE, model, [0.5, -0.2], 1.5, wrt=("k", "d"))
    np.testing.assert_allclose(out[2:4], [2 * 0.25 - 0.2, 0.3 * 1.5])
    by_state, by_parameter = [[2 * 2 * 0.5, 1.0], [0, 0]], [[0.25, 0, 0, 0], [0, 1.5, 0, 0]]
    np.testing.assert_allclose(out[-8:].reshape(2, 4), by_state @ S + by_parameter)
