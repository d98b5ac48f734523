"""How records are cut into windows."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModelRegressor, systems
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
