"""How records are cut into windows."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, PhysicsModelRegressor, systems
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, window_records
from sklearn_pgnn.trajectories import read_records


@pytest.mark.parametrize("every", [1, 10, 40])
def test_every_window_has_enough_measured_samples(every):
    cart, t = systems.cart_on_spring(), np.arange(1600) / 100
    force = 20 * np.sin(1.7 * t) + 10 * np.sin(4.1 * t)
    y = cart.simulate(t, force).y
    y[np.arange(t.size) % every > 0] = np.nan
    records = read_records(cart, np.column_stack([t, force]), y)
    windows = window_records(cart, records).windows
    measured = [
        np.isfinite(windows.y[a : a + n]).sum()
        for a, n in zip(windows.starts, windows.lengths, strict=True)
    ]
    assert min(measured) >= MIN_SAMPLES


def test_parameters_are_found_from_few_measured_samples():
    cart, t = systems.cart_on_spring(), np.arange(1600) / 100
    force = 20 * np.sin(1.7 * t) + 10 * np.sin(4.1 * t)
    y = cart.simulate(t, force).y
    y[np.arange(t.size) % 40 > 0] = np.nan
    (free, *_) = cart.free_parameters
    off = cart.with_parameters(**{free: 1.2 * cart.parameters[free].value})
    fitted = PhysicsModelRegressor(off, free=[free]).fit(np.column_stack([t, force]), y)
    assert fitted.parameters_[free].value == pytest.approx(cart.parameters[free].value, rel=0.01)


@pytest.mark.parametrize("hold", [20, 40])
def test_an_input_that_steps_at_regular_times_steps_within_windows(hold):
    """Else the resistance of a cell is as good as the charge at which a window begins."""
    values, output = {"Q": 1e4, "R": 0.03}, {"V": "z + R*I"}
    cell = PhysicsModel({"z": ""}, {"z": "I/Q"}, values, {"I": "A"}, output)
    t, random = np.arange(960.0), np.random.default_rng(0)
    current = np.repeat(random.choice([-4.0, 0.0, 4.0], size=960 // hold), hold)
    y = cell.simulate(t, current).y + 1e-3 * random.normal(size=(960, 1))
    record = read_records(cell, np.column_stack([t, current]), y)
    for length in (None, 20.0):
        windows = window_records(cell, record, window_length=length).windows
        steps = np.flatnonzero(np.diff(current)) + 1
        assert np.isin(steps, windows.starts).mean() < 0.1
        assert windows.lengths.min() >= MIN_SAMPLES
        assert windows.lengths.sum() == 960
