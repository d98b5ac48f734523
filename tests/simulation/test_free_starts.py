"""A free run's error is not that of its initial state."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.inspection.first_look import first_look
from sklearn_pgnn.simulation.free_starts import fit_starts
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

G, STEP, NOISE = 9.81, 0.02, 3e-3
PENDULUM = PhysicsModel(
    {"theta": "rad", "omega": "rad/s"},
    {"theta": "omega", "omega": "-(g/l)*sin(theta) - d*omega"},
    {"l": {"value": 0.3, "unit": "m"}, "d": 0.02, "g": {"value": G, "fixed": True}},
    outputs={"theta": "theta"},
    initial_state={"theta": 0.5},
)


def swings(seed, d=0.02, n=3, duration=15.0):
    """Return free swings from unknown starts, integrated by scipy, with noise."""
    rng, tables, outputs, starts = np.random.default_rng(seed), [], [], []
    t = np.arange(0.0, duration, STEP)
    for k in range(n):
        begin = [rng.uniform(0.5, 1.2), rng.uniform(-3.0, 3.0)]
        run = solve_ivp(
            lambda _, x: [x[1], -G / 0.3 * np.sin(x[0]) - d * x[1]],
            (0.0, t[-1]),
            begin,
            t_eval=t,
            rtol=1e-9,
            atol=1e-10,
        )
        tables.append(pd.DataFrame({"trajectory": k, "t": t}))
        outputs.append(run.y[0] + NOISE * rng.normal(size=t.size))
        starts.append(begin)
    y = pd.DataFrame({"theta": np.concatenate(outputs)})
    return pd.concat(tables, ignore_index=True), y, np.array(starts)


def errors(model, windowed, starts):
    """Return the free-run error of every record."""
    windows = windowed.windows
    spans = zip(pairwise(windows.bounds), starts, strict=True)
    runs = [free_run(model, windows, a, b, start) for (a, b), start in spans]
    cuts = windows.bounds[1:-1]
    return [
        float(np.sqrt(np.mean((run.y - y) ** 2)))
        for run, y in zip(runs, np.split(windows.y, cuts), strict=True)
    ]


@pytest.mark.parametrize("seed", range(3))
def test_the_free_run_of_the_true_model_leaves_the_noise(seed):
    X, y, _ = swings(seed)
    look = first_look(PENDULUM, X, y)
    assert look.outputs[0].error < 1.1 * NOISE


def test_the_first_reading_of_a_sensor_is_no_known_start():
    X, y, starts = swings(3)
    X = X.assign(theta=y["theta"])  # as in a file whose column of the output has the state's name
    windowed = window_records(PENDULUM, read_records(PENDULUM, X, y))
    found = fit_starts(PENDULUM, windowed.windows, windowed.states)
    assert np.abs(found - starts)[:, 0].max() < NOISE
    assert max(errors(PENDULUM, windowed, found)) < 1.1 * NOISE


def test_a_start_that_is_given_is_kept():
    X, y, starts = swings(4)
    first = ~X["trajectory"].duplicated()
    X.loc[first, ["theta", "omega"]] = starts + 0.01
    windowed = window_records(PENDULUM, read_records(PENDULUM, X, y))
    found = fit_starts(PENDULUM, windowed.windows, windowed.states)
    np.testing.assert_allclose(found, starts + 0.01, atol=1e-12)


def test_a_start_does_not_make_up_for_a_wrong_model():
    X, y, starts = swings(5, d=0.3)
    windowed = window_records(PENDULUM, read_records(PENDULUM, X, y))
    found = fit_starts(PENDULUM, windowed.windows, windowed.states)
    assert np.abs(found - starts)[:, 0].max() < 0.05
    assert min(errors(PENDULUM, windowed, found)) > 20 * NOISE
