"""Systems of python-control as models."""

import control
import numpy as np
import pytest

from sklearn_pgnn import export
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.priors import from_control

T = np.arange(0.0, 3.0, 0.01)


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
