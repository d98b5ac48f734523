"""The scheme and the number of steps come from eigenvalues and accuracy, not from luck."""

import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.simulation.fastest import fastest
from sklearn_pgnn.simulation.finite_run import steps_for
from sklearn_pgnn.simulation.linearly_implicit import COUPLING, DIAGONAL, NODES, STAGES, WEIGHTS
from sklearn_pgnn.simulation.stepping import counts_between
from sklearn_pgnn.simulation.substeps import EXPLICIT, IMPLICIT, MAX_SUBSTEPS, Steps
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

RNG = np.random.default_rng(7)


def lag(time_constant):
    model = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": time_constant}, {"u": "V"})
    return model, read_records(model, [[float(k), float(k % 2)] for k in range(20)])


def chain(rates, stages="abcdef"):
    """Return lags in a row and their exact course under a held input."""
    names = stages[: len(rates)]
    before = dict(zip(names, ["u", *names[:-1]], strict=True))
    equations = {name: f"k{name}*({before[name]} - {name})" for name in names}
    parameters = {f"k{name}": float(rate) for name, rate in zip(names, rates, strict=True)}
    model = PhysicsModel(dict.fromkeys(names, "V"), equations, parameters, {"u": "V"})

    def course(t, u):
        n = len(rates)
        A = np.zeros((n + 1, n + 1))
        for i, rate in enumerate(rates):
            A[i, i], A[i, i - 1 if i else n] = -rate, rate
        x = np.zeros((t.size, n))
        for k, width in enumerate(np.diff(t)):
            x[k + 1] = (expm(width * A) @ np.append(x[k], u[k]))[:n]
        return x

    return model, course


def test_a_slow_machine_takes_one_scheme_and_few_steps_and_says_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        steps = steps_for(*lag(100.0))
    assert steps.method == EXPLICIT
    assert steps.substeps < MAX_SUBSTEPS


@pytest.mark.parametrize("time_constant", [0.01, 1e-4, 1e-9])
def test_a_machine_far_quicker_than_its_samples_is_simulated_in_implicit_steps(time_constant):
    model, records = lag(time_constant)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        steps = steps_for(model, records)
        run = model.simulate(records[0].t, records[0].u)
    assert steps.method == IMPLICIT
    assert run.y[1:, 0] == pytest.approx(records[0].u[:-1, 0], abs=3e-3)


def test_a_machine_that_no_steps_resolve_is_told_so():
    model = PhysicsModel(
        {"x": "m", "v": "m/s"}, {"x": "v", "v": "-w**2*x"}, {"w": 300.0}, initial_state={"x": 1.0}
    )
    records = read_records(model, [[float(k)] for k in range(20)])
    with pytest.warns(SimulationWarning, match=r"still changes with 32 .* Remedy: .*set substeps"):
        steps_for(model, records)


@pytest.mark.parametrize("seed", range(6))
def test_stiff_chains_follow_the_matrix_exponential(seed):
    rng = np.random.default_rng(seed)
    rates = 10.0 ** rng.uniform(0, 7, rng.integers(2, 5))
    model, course = chain(rates)
    t = np.arange(0, 2, 0.01)
    u = np.sign(np.sin(2 * np.pi * rng.uniform(0.5, 2) * t))
    assert model.simulate(t, u).x == pytest.approx(course(t, u), abs=4e-3)


@pytest.mark.parametrize("seed", range(4))
def test_uneven_samples_take_steps_by_their_length(seed):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.choice([0.1, 0.3, 2.0, 7.0], 60))
    model, course = chain(rng.uniform(0.3, 3.0, 2))
    u = rng.normal(size=t.size)
    assert model.simulate(t, u).x == pytest.approx(course(t, u), abs=6e-3)


def test_a_step_is_never_longer_than_half_as_much_again_as_usual():
    t = np.cumsum(RNG.uniform(0.01, 30.0, 500))
    steps = np.diff(t) / counts_between(t, 1.0)
    assert steps.max() <= 1.5
    assert counts_between(t[:2], np.inf).tolist() == [1.0]


def test_a_stiff_oscillator_follows_radau():
    """Van der Pol's, whose eigenvalues go from stable and fast to unstable along the run."""
    model = PhysicsModel(
        {"x": "1", "v": "1"}, {"x": "v", "v": "mu*(1 - x**2)*v - x"}, {"mu": 300.0},
        initial_state={"x": 2.0},
    )  # fmt: skip
    t = np.linspace(0, 200.0, 201)
    exact = solve_ivp(
        lambda _, x: [x[1], 300.0 * (1 - x[0] ** 2) * x[1] - x[0]], (0, 200), [2.0, 0.0],
        method="Radau", t_eval=t, rtol=1e-9, atol=1e-11,
    ).y.T  # fmt: skip
    run = model.simulate(t)
    assert run.success
    assert run.x[:, 0] == pytest.approx(exact[:, 0], abs=5e-3)


def test_a_fast_reaction_follows_radau():
    """Robertson's: three rates that differ by nine orders, and a conserved sum."""
    model = PhysicsModel(
        {"A": "1", "B": "1", "C": "1"},
        {"A": "-k1*A + k3*B*C", "B": "k1*A - k3*B*C - k2*B**2", "C": "k2*B**2"},
        {"k1": 0.04, "k2": 3e7, "k3": 1e4}, initial_state={"A": 1.0},
    )  # fmt: skip
    t = np.linspace(0, 40.0, 81)

    def rates(_, x):
        ab, bc, bb = 0.04 * x[0], 1e4 * x[1] * x[2], 3e7 * x[1] ** 2
        return [-ab + bc, ab - bc - bb, bb]

    exact = solve_ivp(rates, (0, 40), [1, 0, 0], "Radau", t, rtol=1e-10, atol=1e-14).y.T
    run = model.simulate(t)
    assert run.x / np.ptp(exact, axis=0) == pytest.approx(exact / np.ptp(exact, axis=0), abs=2e-3)
    assert run.x.sum(axis=1) == pytest.approx(1.0, abs=1e-9)


def test_the_eigenvalues_are_those_along_the_run():
    model = PhysicsModel(
        {"x": "1"}, {"x": "-k*x**3"}, {"k": 100.0}, initial_state={"x": 2.0}
    )  # fmt: skip
    t = np.array([0.0, 0.5, 1.0])
    x = np.array([[2.0], [0.5], [0.1]])
    assert fastest(model, t, np.zeros((3, 0)), x, np.inf) == pytest.approx(600.0, rel=1e-4)


def test_explicit_steps_that_are_told_are_made_as_told():
    """Kutta's factor for one step of h lambda = -2.5, which is what was asked for."""
    model, _ = lag(1.0 / 2.5)
    one = model.simulate([0.0, 1.0], [1.0, 1.0], substeps=1)
    z = -2.5
    assert one.y[1, 0] == pytest.approx(1 - (1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24))
    free = model.simulate([0.0, 1.0], [1.0, 1.0])
    assert free.y[1, 0] == pytest.approx(1 - np.exp(-2.5), abs=1e-3)


def test_told_steps_that_are_not_stable_become_implicit():
    model, records = lag(0.01)
    assert steps_for(model, records, 2) == Steps(IMPLICIT, 2)
    assert steps_for(model, records, 64) == Steps(EXPLICIT, 64)


def test_coefficients_satisfy_the_conditions_of_order_three_for_any_matrix():
    gamma = DIAGONAL * (COUPLING + np.eye(4))
    a, c, b, g = STAGES, NODES, WEIGHTS, gamma.sum(axis=1)
    found = [b.sum(), b @ c, b @ g, b @ c**2, b @ a @ c, b @ a @ g, b @ gamma @ c, b @ gamma @ g]
    assert found == pytest.approx([1, 1 / 2, 0, 1 / 3, 1 / 6, 0, 0, 0], abs=1e-14)
    at_infinity = 1 - b @ np.linalg.solve(a + gamma, np.ones(4))
    assert at_infinity == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_implicit_steps_and_their_sensitivities_are_of_order_three(hold):
    model = PhysicsModel(
        {"x": "1", "v": "1"}, {"x": "v", "v": "-9*sin(x) - d*v**3 + u*x"}, {"d": 0.2},
        {"u": "1"}, initial_state={"x": 1.0},
    )  # fmt: skip
    t = np.arange(0, 2, 0.05)
    options = {"u": np.sin(3 * t), "hold": hold, "wrt": ("d",)}
    exact = model.simulate(t, method="rk4", substeps=64, **options)
    errors = []
    for n in (4, 8):
        run = model.simulate(t, method=IMPLICIT, substeps=n, **options)
        errors.append(
            [
                np.abs(run.x - exact.x).max(),
                np.abs(run.sensitivities - exact.sensitivities).max(),
            ]
        )
    assert np.log2(np.divide(*errors)) == pytest.approx([3.0, 3.0], abs=0.3)


def test_implicit_steps_cut_at_sticking_as_explicit_ones_do():
    """A sledge with a stiff drive in front: it stops, sticks, and stays where it is."""
    model = PhysicsModel(
        {"f": "N", "v": "m/s"}, {"f": "k*(u - f)", "v": "f - F*sign(v)"}, {"k": 1e5, "F": 0.5},
        {"u": "N"}, initial_state={"v": 1.0},
    )  # fmt: skip
    t = np.arange(0, 6, 0.01)
    u = np.where(t < 4, 0.2, 0.0)
    run = model.simulate(t, u)
    stop = 1.0 / 0.3  # decelerated by F - u
    assert run.x[:, 1] == pytest.approx(np.maximum(1.0 - 0.3 * t, 0.0), abs=1e-4)
    assert (run.x[t > stop + 0.01, 1] == 0.0).all()


def test_a_model_says_its_scheme_in_its_file(tmp_path):
    model, _ = lag(0.01)
    said = model.replace(simulation={"substeps": 2, "method": IMPLICIT})
    said.to_yaml(tmp_path / "m.yaml")
    again = PhysicsModel.from_yaml(tmp_path / "m.yaml")
    assert again.simulation == {"substeps": 2, "method": IMPLICIT}
    t = np.arange(5.0)
    assert again.simulate(t, t).y[-1, 0] == pytest.approx(3.0, abs=0.01)
    with pytest.raises(ValueError, match=r"simulation\.method: expected one of rk4, rosenbrock"):
        model.replace(simulation={"method": "magic"})
