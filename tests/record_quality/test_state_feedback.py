"""Inputs that are functions of the states are told from machines that follow their inputs."""

import math

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.record_quality.feedback import (
    find_state_feedback,
    replay_inputs,
    window_states,
)
from sklearn_pgnn.simulation.window_fit import fit_windows
from sklearn_pgnn.trajectories import read_records


def cart():
    return PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F - k*x - d*v)/m"},
        {"m": 2.0, "d": 1.0, "k": 10.0},
        {"F": "N"},
        {"position": "x"},
        inertia={"v": "m"},
    )


def slider():
    """A cart without a spring."""
    return PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F - d*v)/m"},
        {"m": 2.0, "d": 1.0},
        {"F": "N"},
        {"position": "x"},
        inertia={"v": "m"},
    )


def pendulum():
    return PhysicsModel(
        {"phi": "rad", "omega": "rad/s"},
        {"phi": "omega", "omega": "(T - w*sin(phi) - d*omega)/J"},
        {"J": 0.1, "w": 1.0, "d": 0.02},
        {"T": "N m"},
        {"angle": "phi"},
        inertia={"omega": "J"},
    )


def heater():
    return PhysicsModel(
        {"T": "K"}, {"T": "(P - h*T)/C"}, {"C": 500.0, "h": 2.0}, {"P": "W"}, {"sensor": "T"}
    )


def motor():
    return PhysicsModel(
        {"i": "A", "w": "rad/s"},
        {"i": "(U - R*i - k*w)/L", "w": "(k*i - d*w)/J"},
        {"R": 1.0, "L": 0.01, "k": 0.1, "J": 0.001, "d": 1e-4},
        {"U": "V"},
        {"current": "i", "speed": "w"},
    )


#: the same equations by hand: rates, sample time [s], noise
PLANTS = {
    cart: (lambda x, u: [x[1], (u - 10 * x[0] - x[1]) / 2], 0.02, [2e-3]),
    slider: (lambda x, u: [x[1], (u - x[1]) / 2], 0.02, [2e-3]),
    pendulum: (lambda x, u: [x[1], 10 * (u - math.sin(x[0]) - 0.02 * x[1])], 0.02, [2e-3]),
    heater: (lambda x, u: [(u - 2 * x[0]) / 500], 5.0, [0.05]),
    motor: (
        lambda x, u: [100 * (u - x[0] - 0.1 * x[1]), 1e3 * (0.1 * x[0] - 1e-4 * x[1])],
        0.005,
        [0.02, 0.1],
    ),
}


def record(plant, law, starts, n_samples, seed=0, every=1.0, noisy=1.0):
    """Return X and y of a plant under ``law(t, x, record)``, which sees the states themselves."""
    rates, step, noise = PLANTS[plant]
    rng, step = np.random.default_rng(seed), step * every
    t = step * np.arange(n_samples)
    X, y = [], []
    for r, start in enumerate(starts):
        x, us, xs = np.array(start, dtype=float), [], []
        for time in t:
            us.append(float(law(time, x, r)))
            xs.append(x)
            for _ in range(4):
                x = runge_kutta(lambda z, u=us[-1]: np.array(rates(z, u)), x, step / 4)
        seen = np.array(xs)[:, : len(noise)]
        y.append(seen + noisy * np.array(noise) * rng.standard_normal(seen.shape))
        X.append(pd.DataFrame({"trajectory": r, "t": t, plant_input(plant): us}))
    return pd.concat(X, ignore_index=True), np.concatenate(y)


def runge_kutta(rate, x, h):
    a = rate(x)
    b = rate(x + h / 2 * a)
    c = rate(x + h / 2 * b)
    return x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c))


def plant_input(plant):
    return next(iter(plant().inputs))


def as_problem(model, X, y):
    problem = build_problem(model, read_records(model, X, y))
    estimate = problem.states.estimate(model)
    expected = estimate.x[problem.windows.starts]
    return problem, fit_windows(model, problem.windows, (), expected, estimate.spread)


def findings(plant, law, starts, n_samples, model=None, **options):
    X, y = record(plant, law, starts, n_samples, **options)
    return find_state_feedback(*as_problem(plant() if model is None else model, X, y))


def pumped(t, x, r):
    """Energy shaping of the pendulum, with a limit."""
    energy = 0.05 * x[1] ** 2 + 1 - np.cos(x[0])
    return np.clip(0.5 * x[1] * (1.5 - energy), -0.4, 0.4)


PUSHED = [(0.3, 0), (0.5, 0), (-0.2, 1)]
FEEDBACK = {
    "stiffness": (cart, lambda t, x, r: -15 * x[0], PUSHED, 500, "x", "as k does"),
    "damper": (cart, lambda t, x, r: -3 * x[1], PUSHED, 500, "v", "as d does"),
    "two gains": (cart, lambda t, x, r: -30 * x[0] - 6 * x[1], PUSHED, 250, "x and v",
                  "as d and k do together"),
    "to a place": (slider, lambda t, x, r: 8 * (0.4 - x[0]) - 2 * x[1],
                   [(0, 0), (0.1, 0), (-0.5, 0)], 400, "x and v",
                   "as constant load on v, d and linear stiffness on v do together"),
    "relay": (cart, lambda t, x, r: 3 * np.sign(x[1]), PUSHED, 400, "",
              "as coulomb friction on v does"),
    "energy shaping": (pendulum, pumped, [(0.3, 0), (1, 0), (-2, 0)], 600, "phi and omega",
                       "as any missing part does that is the same function of phi and omega"),
    "upright": (pendulum, lambda t, x, r: -3 * (x[0] - np.pi) - 0.2 * x[1],
                [(3, 0), (3.4, 0), (2.9, 0)], 300, "phi and omega", "as d and w do together"),
    "thermostat": (heater, lambda t, x, r: np.clip(5 * (60 - x[0]), 0, 150), [(20,), (0,), (90,)],
                   300, "T", "as any missing part does that is the same function of T"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", FEEDBACK)
def test_an_input_that_a_controller_computes_is_found(case):
    plant, law, starts, n_samples, states, like = FEEDBACK[case]
    (finding,) = findings(plant, law, starts, n_samples)
    assert finding.kind == "state feedback"
    assert finding.where == plant_input(plant)
    if states:  # trees hardly tell that of a relay from one of more
        assert f"is a function of {states} at the same time" in finding.text
    assert f"then acts {like}, and these records cannot separate them" in finding.text
    assert finding.value > 0.95
    assert "test signal" in finding.remedy


@pytest.mark.slow
def test_it_is_found_with_a_model_that_is_wrong():
    stiff = cart().with_parameters(k=13.0, d=1.3)
    (finding,) = findings(cart, lambda t, x, r: -15 * x[0], PUSHED, 500, model=stiff)
    assert "is a function of x " in finding.text


def sines(frequencies, size, seed=0):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (3, len(frequencies)))
    return lambda t, x, r: size * np.sin(np.multiply(frequencies, t) + phases[r]).sum()


def steps(levels, hold, seed=0):
    drawn = np.random.default_rng(seed).choice(levels, (3, 1000))
    return lambda t, x, r: drawn[r, int(t / hold + 1e-9)]


REST = [(0, 0)] * 3
OPEN_LOOP = {
    "fast": (cart, sines([1.3, 3.1, 5], 3), REST, 500, 1),
    "so slow that the cart follows": (cart, sines([0.1, 0.23], 3), REST, 600, 5),
    "one sine": (cart, sines([1.5], 3), REST, 400, 2),
    "a ramp": (cart, lambda t, x, r: 0.2 * (1 + r) * t, REST, 400, 2),
    "up and down": (cart, lambda t, x, r: 5 - abs(t / 6 - 5), REST, 600, 5),
    "the same in every record": (cart, lambda t, x, r: 3 * np.sin(t) + np.sin(3 * t), REST, 500, 1),
    "in motion": (cart, sines([0.2, 0.33], 3), [(0.4, 0.1), (-0.3, -0.1)], 600, 5),
    "heated slowly": (heater, lambda t, x, r: 50 + sines([2e-4, 5e-4], 20)(t, x, r),
                      [(25,)] * 2, 1000, 6),
    "heated in steps": (heater, steps([0, 20, 50, 100], 1000), [(0,)] * 2, 1000, 1),
    "heated steadily from hot": (heater, lambda t, x, r: 0.05 * t, [(30,), (10,)], 600, 1),
    "a motor's fast current": (motor, sines([3, 7, 13], 4), REST, 800, 1),
    "a motor switched": (motor, steps([-6, -2, 3, 8], 0.5), REST, 800, 1),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("noisy", [0.01, 1.0])
@pytest.mark.parametrize("case", OPEN_LOOP)
def test_a_machine_that_follows_its_input_is_no_feedback(case, noisy):
    plant, law, starts, n_samples, every = OPEN_LOOP[case]
    assert findings(plant, law, starts, n_samples, every=every, noisy=noisy) == []


@pytest.mark.slow
def test_nor_is_it_with_a_model_that_is_wrong():
    wrong = heater().with_parameters(h=2.6, C=700.0)
    law = OPEN_LOOP["heated slowly"][1]
    assert findings(heater, law, [(25,)] * 2, 1000, every=6, model=wrong) == []


@pytest.mark.slow
def test_false_alarms_are_rare():
    """At an error rate of one in a thousand, none in thirty inputs that states follow closely."""
    rng = np.random.default_rng(0)
    for seed in range(30):
        slow = sines(0.05 * np.exp(rng.uniform(0, 1.5, 2)), 3, seed)
        assert findings(cart, slow, REST[:2], 400, seed=seed, every=5) == []


def test_a_controller_with_a_lively_reference_is_none_that_matters():
    follow = lambda t, x, r: 20 * (0.3 * np.sin(2 * t + r) + 0.2 * np.sin(5 * t) - x[0])  # noqa: E731
    assert findings(cart, follow, REST, 500) == []


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_findings_do_not_depend_on_the_unit_of_the_input(unit):
    X, y = record(cart, FEEDBACK["two gains"][1], PUSHED, 250)
    other = cart().replace(equations={"x": "v", "v": f"({unit}*F - k*x - d*v)/m"})
    (found,) = find_state_feedback(*as_problem(cart(), X, y))
    (same,) = find_state_feedback(*as_problem(other, X.assign(F=X["F"] / unit), y))
    assert same.text == found.text
    assert same.value == pytest.approx(found.value, rel=1e-6)


def test_a_replay_is_the_same_input_at_another_speed():
    X, y = record(cart, lambda t, x, r: np.sin(t), REST[:1], 400)
    problem, fit = as_problem(cart(), X, y)
    t = X["t"].to_numpy()
    ways = list(replay_inputs(problem, fit, window_states(problem, fit)))
    twice = ways[-1][0]
    np.testing.assert_allclose(twice.u[twice.known, 0], np.sin(2 * t[twice.known]), atol=1e-3)
    assert twice.known.sum() == 200
    assert ways[0][0].known.all()
    run = cart().simulate(t, twice.u[:, 0], x0=fit.x0[0], substeps=4).x
    np.testing.assert_allclose(twice.x, run, atol=1e-3)


@pytest.mark.slow
def test_the_diagnosis_tells_of_feedback():
    X, y = record(cart, FEEDBACK["stiffness"][1], PUSHED, 400)
    diagnosis = ModelDiagnosis(cart(), catalogue=()).fit(X, y)
    assert {("state feedback", "F")} <= {(f.kind, f.where) for f in diagnosis.data_quality_}
