"""The likelihood beside a hidden input: of a known Gaussian, and along what a filter finds."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.simulation.disturbance import (
    Disturbance,
    LinearWindows,
    innovations,
    likeliest,
)
from sklearn_pgnn.simulation.filtered_response import Starts, linearise_filtered
from sklearn_pgnn.simulation.linear_response import linearise
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate

OSCILLATOR = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "F - k*x - d*v"},
    {"k": 4.0, "d": 0.3},
    {"F": "N"},
    outputs={"position": "x", "speed": "v"},
)
NOISE = np.array([0.02, 0.05])
KNOWN = Disturbance(variance=0.3, time=0.4)


def disturbed_windows(seed, n_windows=2, length=30, disturbance=KNOWN, lost=0.0):
    """Simulate an oscillator on which something unmeasured acts; the model begins a bit off."""
    rng, step = np.random.default_rng(seed), 0.05
    size = n_windows * length
    t = step * np.arange(size)
    kept, d = np.exp(-step / disturbance.time), np.zeros(size)
    d[0] = rng.normal()
    for k in range(size - 1):
        d[k + 1] = kept * d[k] + np.sqrt(1 - kept**2) * rng.normal()
    d *= np.sqrt(disturbance.variance)
    u = np.sin(2.0 * t)[:, None]
    start = rng.normal(size=2)
    rig = OSCILLATOR.simulate(t, u + d[:, None], start, substeps=4)
    y = rig.y + NOISE * rng.normal(size=(size, 2))
    y[rng.random(y.shape) < lost] = np.nan
    edges = np.arange(n_windows) * length, np.full(n_windows, length)
    windows = ShootingWindows(t, u, y, np.array([0, size]), *edges, NOISE, substeps=4)
    return windows, rig.x[windows.starts] + 0.01 * rng.normal(size=(n_windows, 2))


def linear(windows, x0):
    """Linearise the windows about the model's own trajectories."""
    residual = evaluate(OSCILLATOR, windows, x0, ()).residual
    F, H = linearise(OSCILLATOR, windows, x0, "v")
    mean, covariance = np.full(x0.shape, 0.02), np.tile(np.diag([0.01, 0.04]), (len(x0), 1, 1))
    return LinearWindows(windows, F, H, residual[..., None].copy(), mean, covariance, NOISE**2)


def of_the_gaussian(part: LinearWindows, disturbance) -> float:
    """Evaluate the likelihood by the covariance of all samples of a window at once."""
    windows, log_det, squares, count = part.windows, 0.0, 0.0, 0
    for w, (a, b) in enumerate(pairwise([*windows.starts, windows.t.size])):
        n = b - a
        by_start, by_input = np.zeros((n, 2, 2)), np.zeros((n, 2, n))
        s, sd = np.eye(2), np.zeros((2, n))
        for k in range(n):
            by_start[k], by_input[k] = part.H[a + k, :, :2] @ s, part.H[a + k, :, :2] @ sd
            s, sd = part.F[a + k, :2, :2] @ s, part.F[a + k, :2, :2] @ sd
            sd[:, k] += part.F[a + k, :2, 2]
        gaps = np.abs(windows.t[a:b, None] - windows.t[a:b])
        wander = disturbance.variance * np.exp(-gaps / disturbance.time)
        A, B = by_start.reshape(2 * n, 2), by_input.reshape(2 * n, n)
        noise = np.diag(np.tile(part.variance, n))
        residual = part.columns[a:b, :, -1].ravel() - A @ part.mean[w]
        seen = np.isfinite(residual)
        whole = (A @ part.covariance[w] @ A.T + B @ wander @ B.T + noise)[np.ix_(seen, seen)]
        log_det += np.linalg.slogdet(whole)[1]
        squares += residual[seen] @ np.linalg.solve(whole, residual[seen])
        count += seen.sum()
    factor = max(1.0, squares / count)
    return -0.5 * (log_det + count * np.log(factor) + squares / factor)


@pytest.mark.parametrize("disturbance", [KNOWN, Disturbance(0.0, 1.0), Disturbance(20.0, 0.05)])
@pytest.mark.parametrize("lost", [0.0, 0.4])
def test_it_is_that_of_the_gaussian_with_the_same_covariance(disturbance, lost):
    part = linear(*disturbed_windows(1, lost=lost))
    found = innovations(part, disturbance)
    assert found.n == np.isfinite(part.columns).sum()
    assert found.log_likelihood == pytest.approx(of_the_gaussian(part, disturbance), rel=1e-8)


@settings(max_examples=20, deadline=None)
@given(factor=st.floats(1e-3, 1e3), seed=st.integers(0, 9))
def test_a_ratio_knows_no_units_of_the_noise(factor, seed):
    part = linear(*disturbed_windows(seed))
    size = np.diag(factor * np.ones(2))
    scaled = LinearWindows(
        part.windows,
        part.F,
        part.H,
        factor * part.columns,
        factor * part.mean,
        size @ part.covariance @ size,
        factor**2 * part.variance,
    )
    larger = Disturbance(factor**2 * KNOWN.variance, KNOWN.time)
    calm, none = Disturbance(0.0, 1.0), innovations(part, Disturbance(0.0, 1.0)).log_likelihood
    ratio = innovations(part, KNOWN).log_likelihood - none
    other = innovations(scaled, larger).log_likelihood
    assert other - innovations(scaled, calm).log_likelihood == pytest.approx(ratio, abs=1e-6)


def test_columns_are_filtered_as_residuals_are():
    part = linear(*disturbed_windows(2))
    other = np.random.default_rng(0).normal(size=(*part.windows.y.shape, 1))
    both = np.concatenate([other, part.columns], axis=2)
    centred = {"mean": np.zeros_like(part.mean)}
    alone = [LinearWindows(**{**vars(part), **centred, "columns": c}) for c in (other, other + 1.0)]
    gram = innovations(LinearWindows(**{**vars(part), "columns": both}), KNOWN).gram
    assert gram[:, 0, 0] == pytest.approx(innovations(alone[0], KNOWN).gram[:, 0, 0])
    assert gram[:, 1, 1] == pytest.approx(innovations(part, KNOWN).gram[:, 0, 0])
    assert not np.allclose(gram[:, 0, 0], innovations(alone[1], KNOWN).gram[:, 0, 0])


def test_the_likeliest_disturbance_is_near_the_true_one():
    found = []
    for seed in range(5):
        part = linear(*disturbed_windows(seed, n_windows=20))
        disturbance, likelihood = likeliest(part, size=1.0, time=1.5)
        assert likelihood >= innovations(part, KNOWN).log_likelihood - 0.5
        found.append(disturbance)
    assert np.median([d.variance for d in found]) == pytest.approx(KNOWN.variance, rel=0.3)
    assert np.median([d.time for d in found]) == pytest.approx(KNOWN.time, rel=0.4)


def test_where_nothing_disturbs_hardly_anything_is_gained():
    calm = Disturbance(0.0, 1.0)
    part = linear(*disturbed_windows(3, n_windows=20, disturbance=calm))
    gained = likeliest(part, 1.0, 1.5)[1] - innovations(part, calm).log_likelihood
    assert gained < 3.0


def test_threads_and_other_windows_change_no_bit():
    part = linear(*disturbed_windows(5, n_windows=20))
    known, some = innovations(part, KNOWN), np.array([3, 11, 12])
    threaded = innovations(replace(part, windows=replace(part.windows, threads=2)), KNOWN)
    assert np.array_equal(threaded.gram, known.gram)
    assert threaded.log_variance == known.log_variance
    assert np.array_equal(innovations(part.select(some), KNOWN).gram, known.gram[some])


def test_what_is_not_finite_has_no_likelihood():
    part = linear(*disturbed_windows(4))
    part.F[5, 0, 0] = np.inf
    assert innovations(part, KNOWN).log_likelihood == -np.inf


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
