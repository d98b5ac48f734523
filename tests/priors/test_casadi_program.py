"""CasADi functions as models."""

import pickle

import casadi as ca
import numpy as np
import pytest

from sklearn_pgnn import export, systems
from sklearn_pgnn.exceptions import ModelError, ModelWarning
from sklearn_pgnn.priors import from_casadi

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
