"""CasADi functions and systems of python-control as models."""

import pickle

import casadi as ca
import control
import numpy as np
import pytest

from sklearn_pgnn import export, systems
from sklearn_pgnn.exceptions import ModelError, ModelWarning
from sklearn_pgnn.priors import from_casadi, from_control

T = np.arange(0.0, 3.0, 0.01)


def cart(symbols):
    x, u, p = symbols.sym("x", 2), symbols.sym("u"), symbols.sym("p", 2)
    force = u - p[1] * x[1] - ca.if_else(x[0] > 0, 3 * x[0], ca.fmax(x[0], -0.1))
    return ca.Function(
        "cart", [x, u, p], [ca.vertcat(x[1], force / p[0]), x[0] ** 2],
        ["x", "u", "p"], ["rates", "seen"],
    )  # fmt: skip


@pytest.mark.parametrize("symbols", [ca.SX, ca.MX])
def test_it_computes_what_the_function_computes(symbols):
    function = cart(symbols)
    model = from_casadi(
        function, {"x": "m", "v": "m/s"}, inputs={"F": "N"}, parameters={"m": 2.0, "d": 0.5},
        outputs=["square"],
    )  # fmt: skip
    assert model.name == "cart"
    x, h = np.array([0.0, 0.0]), T[1]
    for u in np.sin(T[:-1]):  # the simulation's own steps
        stages = [np.zeros(2)]
        for c in (0.0, 0.5, 0.5, 1.0):
            stages.append(function(x + c * h * stages[-1], u, [2.0, 0.5])[0].full().ravel())
        x = x + h * (stages[1] + 2 * stages[2] + 2 * stages[3] + stages[4]) / 6
    found = model.simulate(T, np.sin(T))
    assert np.allclose(found.x[-1], x, atol=1e-9)
    assert np.allclose(found.y[:, 0], found.x[:, 0] ** 2)


def test_what_went_out_comes_in_again():
    tanks = systems.two_tanks()
    again = from_casadi(
        export.to_casadi(tanks, free=tuple(tanks.parameters)), tanks.states, inputs=tanks.inputs,
        parameters=tanks.parameters, outputs=list(tanks.outputs),
        initial_state=tanks.initial_state,
    )  # fmt: skip
    u = 0.5 + np.zeros_like(T)
    assert np.allclose(again.simulate(T, u).y, tanks.simulate(T, u).y)


def test_a_lookup_is_called():
    x = ca.MX.sym("x")
    lookup = ca.interpolant("table", "linear", [[0.0, 1.0, 2.0]], [0.0, 1.0, 4.0])
    function = ca.Function("f", [x], [-lookup(x)], ["x"], ["rates"])
    with pytest.raises(ModelError, match=r"expected elementary operations, got call"):
        from_casadi(function, {"x": ""}, trace=True)
    with pytest.warns(ModelWarning, match=r"got call.*calls the function, in Python"):
        model = from_casadi(function, {"x": ""})
    assert model.to_text() == "x' = f[x](x)"
    found = model.simulate(T, x0=[0.9]).y[:, 0]
    np.testing.assert_allclose(found, 0.9 * np.exp(-T), rtol=1e-6)
    again = pickle.loads(pickle.dumps(model))
    assert again == model == from_casadi(function, {"x": ""}, trace=False)
    np.testing.assert_array_equal(again.simulate(T, x0=[0.9]).y[:, 0], found)


def test_other_arguments_are_refused():
    x = ca.MX.sym("x")
    other = ca.Function("f", [x], [-x], ["y"], ["rates"])
    with pytest.raises(ModelError, match=r"expected arguments among x of 1 states"):
        from_casadi(other, {"x": ""})
    with pytest.raises(ModelError, match=r"expected a second result of 1 outputs, seen"):
        from_casadi(ca.Function("f", [x], [-x], ["x"], ["rates"]), {"x": ""}, outputs=["seen"])


def response(system, u):
    return control.input_output_response(
        system, T, u, solve_ivp_kwargs={"rtol": 1e-10, "atol": 1e-12}
    ).outputs


def test_a_nonlinear_system_runs_as_it_does_there():
    def rates(t, x, u, params):
        return np.array([x[1], (u[0] - params["d"] * x[1]) / params.get("m", 2.0) - np.sin(x[0])])

    system = control.nlsys(
        rates, lambda t, x, u, params: x[0] + 0.1 * u[0], states=2, inputs=1, outputs=["seen"],
        params={"d": 0.5},
    )  # fmt: skip
    model = from_control(system, states={"phi": "rad", "omega": "rad/s"}, inputs={"F": "N"})
    assert list(model.parameters) == ["d"]
    assert list(model.outputs) == ["seen"]
    u = np.sin(T)
    assert np.allclose(
        model.simulate(T, u, hold="foh", substeps=4).y[:, 0], response(system, u), atol=1e-6
    )


def test_a_linear_system_has_its_matrices():
    system = control.ss([[0, 1], [-20, -0.75]], [[0], [0.5]], [[1, 0]], [[0]])
    model = from_control(system)
    assert list(model.states) == ["x0", "x1"]
    again = export.to_control(model).linearize([0, 0], 0)
    assert np.allclose(again.A, system.A)
    assert np.allclose(again.B, system.B)


def test_discrete_time_and_other_things_are_refused():
    with pytest.raises(ModelError, match=r"in continuous time, got 1 states and dt=0.1"):
        from_control(control.ss([[0.5]], [[1]], [[1]], [[0]], 0.1))
    with pytest.raises(ModelError, match=r"got TransferFunction\. Remedy: control\.ss"):
        from_control(control.tf([1], [1, 1]))
    with pytest.raises(ModelError, match=r"states: expected 1 names, got a, b"):
        from_control(control.ss([[-1]], [[1]], [[1]], [[0]]), states={"a": "", "b": ""})
