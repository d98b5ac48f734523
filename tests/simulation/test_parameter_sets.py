"""Many sets of parameters are simulated as one by one."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.simulation import simulate, simulate_sets

pytestmark = pytest.mark.core

GOLF = systems.golf_robot()
T = np.linspace(0.0, 1.0, 201)
TORQUE = np.sin(9.0 * T)


@pytest.mark.parametrize("n_jobs", [None, 2])
@pytest.mark.parametrize(
    "effect",
    [effects.CoulombFriction("omega", 0.02), effects.InputDelay("torque", 0.01)],
    ids=lambda effect: effect.id,
)
def test_sets_are_simulated_as_one_by_one(effect, n_jobs):
    model, rng = GOLF + effect, np.random.default_rng(0)
    (own,) = effect.names().values()
    sets = {"J": rng.uniform(0.1, 0.2, 7), own: rng.uniform(0.001, 0.05, 7)}
    together = simulate_sets(model, T, TORQUE, [0.5, 0.0], parameters=sets, n_jobs=n_jobs)
    for s in range(7):
        values = {name: column[s] for name, column in sets.items()}
        alone = simulate(model.with_parameters(**values), T, TORQUE, [0.5, 0.0])
        np.testing.assert_array_equal(together[s], alone.y)


def test_sets_that_diverge_are_told_and_lose_nothing_else():
    model = PhysicsModel({"x": ""}, {"x": "a*x**2"}, {"a": 0.0})
    with pytest.warns(
        SimulationWarning, match=r"at 1 of 2 parameter sets, first at set 1\. Remedy"
    ):
        y = simulate_sets(model, T, x0=[1.0], parameters={"a": [-1.0, 50.0]}, substeps=50)
    np.testing.assert_allclose(y[0, :, 0], 1 / (1 + T), rtol=1e-9)
    assert np.isfinite(y[1, :, 0]).sum() in range(1, len(T))


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        ({"mass": [1.0]}, "unknown parameter 'mass'; expected some of m, a, J"),
        ({"J": [[1.0]]}, r"expected finite values of 'J' of shape \(n_sets,\), got shape \(1, 1\)"),
        (
            {"J": [1.0, 2.0], "d": [1.0]},
            "the same number of values for every parameter, got 2 of J, 1 of d",
        ),
        ({}, "the same number of values for every parameter, got none"),
    ],
)
def test_what_is_no_set_is_refused(sets, told):
    with pytest.raises(ValueError, match=told):
        simulate_sets(GOLF, T, TORQUE, parameters=sets)
