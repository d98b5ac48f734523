"""A function that a model calls is compiled where numba can, and computes the same."""

import math

import numpy as np
import pytest

from sklearn_pgnn.exceptions import ModelWarning, SimulationWarning
from sklearn_pgnn.physics.external import external_functions
from sklearn_pgnn.priors import from_function
from sklearn_pgnn.simulation.native_function import how_called, native_function

SETTINGS = {"states": {"x": "m", "v": "m/s"}, "inputs": {"F": "N"}, "parameters": {"m": 2.0}}
TABLE = [0.0, 0.1, 0.3], [0.0, 2.0, 9.0]
T = np.linspace(0, 2, 101)
U = np.sin(5 * T)


def stiffened(x):
    return float(np.interp(abs(x), *TABLE)) * (1.0 if x > 0 else -1.0)


def by_name(t, x, u, p):
    return [x["v"], (u["F"] - stiffened(x["x"])) / p["m"]]


def by_number(t, x, u, p):
    place, speed = x
    return (speed, (u[0] - stiffened(place)) / p[0])


def as_array(t, x, u, p):
    return np.array([x[1], (u[0] - stiffened(x[0])) / p[0]])


def in_python_only(t, x, u, p):
    return [x["v"], (u["F"] - stiffened(x["x"])) / dict(zip(p.names, p, strict=True))["m"]]


def function_of(model):
    (function,) = external_functions(model.equations.values())
    return function


@pytest.fixture(scope="module")
def in_python():
    model = from_function(in_python_only, trace=False, **SETTINGS)
    assert "in Python, since numba cannot compile it" in how_called(function_of(model))
    return model.simulate(T, U, [0.2, 0.0], wrt=("m",))


@pytest.mark.slow
@pytest.mark.parametrize("rates", [by_name, by_number, as_array])
def test_it_is_compiled_and_computes_the_same(rates, in_python):
    model = from_function(rates, trace=False, **SETTINGS)
    assert how_called(function_of(model)) == "compiled by numba"
    found = model.simulate(T, U, [0.2, 0.0], wrt=("m",))
    np.testing.assert_allclose(found.y, in_python.y, atol=1e-12)
    np.testing.assert_allclose(found.sensitivities, in_python.sensitivities, rtol=1e-7, atol=1e-9)


@pytest.mark.slow
def test_outputs_by_name_are_compiled():
    def seen(t, x, u, p):
        return {"place": x["x"] if x["x"] > 0 else 0.0, "sine": math.sin(x["v"])}

    model = from_function(by_number, trace=False, outputs=seen, **SETTINGS)
    functions = external_functions(model.outputs.values())
    assert [how_called(function) for function in functions] == ["compiled by numba"]
    run = model.simulate(T, U, [0.2, 0.0])
    place, speed = run.x.T
    np.testing.assert_allclose(run.y.T, [np.maximum(place, 0), np.sin(speed)])


@pytest.mark.slow
def test_what_computes_something_else_when_compiled_is_called_in_python():
    def rates(t, x, u, p):  # beyond 64 bits
        return [x[1], float((int(abs(x[0])) + 3) * 2**62) / 2.0**62]

    model = from_function(rates, trace=False, **SETTINGS)
    assert not native_function(function_of(model)).address


@pytest.mark.slow
def test_the_warning_says_how_it_is_called():
    with pytest.warns(ModelWarning, match="the function, compiled by numba"):
        from_function(by_number, **SETTINGS)


def test_what_a_compiled_function_raises_is_named():
    def rates(t, x, u, p):
        return [x[1], [1.0, 2.0][int(x[0] > 0) + 2 * int(x[0] > 0.5)]]

    with np.errstate(all="ignore"):
        model = from_function(rates, trace=False, **SETTINGS)
    with pytest.warns(SimulationWarning, match="line .*IndexError"):
        model.simulate(T, U, [0.45, 1.0])


def test_results_at_one_point_are_computed_once():
    points = []

    def rates(t, x, u, p):
        points.append(tuple(x))
        return [math.sin(x[0]) * x[1], math.cos(x[1]), u[0] * abs(x[2])]

    model = from_function(rates, {"a": "", "b": "", "c": ""}, inputs={"u": ""}, trace=False)
    points.clear()
    model.simulate(T[:11], U[:11], [0.1, 0.2, 0.3], method="euler")
    assert len(points) <= 2 * 10
