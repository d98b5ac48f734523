"""Linear along what a filter finds: the same where the model is linear, true where it is not."""

import numpy as np
import pytest
import sympy
from test_disturbance import KNOWN, NOISE, OSCILLATOR, disturbed_windows

from sklearn_pgnn.simulation.disturbance import LinearWindows, likeliest
from sklearn_pgnn.simulation.filtered_response import Starts, linearise_filtered
from sklearn_pgnn.simulation.linear_response import linearise
from sklearn_pgnn.simulation.windows import evaluate


def starts_of(x0):
    """Return where windows begin that may begin a bit elsewhere."""
    covariance = np.tile(np.diag([0.01, 0.04]), (len(x0), 1, 1))
    return Starts(x0, np.full(x0.shape, 0.02), covariance)


def along_runs(model, windows, x0):
    """Linearise along the model's own runs."""
    residual = evaluate(model, windows, x0, ()).residual
    return *linearise(model, windows, x0, "v"), residual


@pytest.mark.parametrize("lost", [0.0, 0.4])
def test_a_linear_model_is_the_same_along_any_states(lost):
    windows, x0 = disturbed_windows(0, lost=lost)
    found = linearise_filtered(OSCILLATOR, windows, starts_of(x0), "v", KNOWN, NOISE**2)
    last = windows.starts + windows.lengths - 1  # no interval follows
    for one, other in zip(found, along_runs(OSCILLATOR, windows, x0), strict=True):
        np.testing.assert_allclose(
            np.delete(one, last, axis=0), np.delete(other, last, axis=0), rtol=1e-6, atol=1e-9
        )


@pytest.mark.parametrize("seed", range(5))
def test_a_sensor_without_a_sign_bends_where_the_machine_was(seed):
    windows, x0 = disturbed_windows(seed, n_windows=4, length=60)
    rectified = OSCILLATOR.replace(
        outputs={name: sympy.Abs(g) for name, g in OSCILLATOR.outputs.items()}
    )
    windows.y[:] = np.abs(windows.y)
    model, starts, likelihoods = rectified.with_parameters(k=4.4), starts_of(x0), []
    filtered = linearise_filtered(model, windows, starts, "v", KNOWN, NOISE**2)
    for F, H, residual in (along_runs(model, windows, x0), filtered):
        part = LinearWindows(
            windows, F, H, residual[..., None].copy(), starts.mean, starts.covariance, NOISE**2
        )
        likelihoods.append(likeliest(part, size=1.0, time=1.0)[1])
    assert likelihoods[1] > likelihoods[0] + 10.0
