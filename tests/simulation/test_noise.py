"""The noise of a record: known, and told from the record alone, however few samples a period."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.simulation.record_windows import dominant_period, output_noise
from sklearn_pgnn.trajectories.noise import finest_differences, noise_level
from sklearn_pgnn.trajectories.record import Record

OMEGA = 2 * np.pi


def oscillator(hardening=0.0):
    """Make a lightly damped oscillator with a period of 1 s."""
    return PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "F - k*x - d*v - b*x**3"},
        {"k": OMEGA**2, "d": 0.04 * OMEGA, "b": hardening},
        {"F": "N"},
        {"position": "x"},
    )


def swing(samples_a_period, kind, seed, n=3000, hardening=0.0):
    """Simulate it, freely or under many sines up to 1.5 times its frequency; the range is 1."""
    t, rng = np.arange(n) / samples_a_period, np.random.default_rng(seed)
    force, start = np.zeros(n), [1.0, 0.0]
    if kind == "driven":
        f = np.linspace(0.05, 1.5, 60)
        force = np.sin(OMEGA * np.outer(t, f) + rng.uniform(0, OMEGA, 60)).sum(axis=1)
        force, start = 0.2 * OMEGA**2 * force / force.std(), [0.0, 0.0]
    y = oscillator(hardening).simulate(t, force, x0=start, substeps=16, hold="foh").y[:, 0]
    return t, y / np.abs(y).max()


def with_noise(y, noise, seed):
    return y + noise * np.random.default_rng(seed + 100).standard_normal(len(y))


@pytest.mark.parametrize("noise", [6e-4, 6e-3, 3e-2])
@pytest.mark.parametrize("samples_a_period", [8, 12, 20, 100])
@pytest.mark.parametrize("kind", ["free", "driven"])
def test_noise_is_found_however_few_samples_a_period(kind, samples_a_period, noise):
    for seed in range(3):
        t, y = swing(samples_a_period, kind, seed)
        assert noise_level(with_noise(y, noise, seed), t) == pytest.approx(noise, rel=0.2)


def test_noise_is_found_on_a_hardening_spring_at_eight_samples_a_period():
    t, y = swing(8, "driven", 0, hardening=1.0)
    assert noise_level(with_noise(y, 6e-4, 0), t) == pytest.approx(6e-4, rel=0.2)


@pytest.mark.parametrize("missing", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("jitter", [0.0, 0.1, 0.45])
def test_noise_is_found_on_uneven_clocks_and_where_samples_are_missing(jitter, missing):
    f = np.linspace(0.05, 1.5, 60)
    response = 1 / (1 - f**2 + 0.04j * f)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        t = (np.arange(3000) + rng.uniform(-jitter, jitter, 3000)) / 8
        phases = OMEGA * np.outer(t, f) + rng.uniform(0, OMEGA, f.size)
        y = (response * np.exp(1j * phases)).imag.sum(axis=1)
        y = with_noise(y / np.abs(y).max(), 3e-3, seed)
        y[rng.uniform(size=y.size) < missing] = np.nan
        assert noise_level(y, t) == pytest.approx(3e-3, rel=0.2)
        known = np.isfinite(y)
        assert noise_level(y[known], t[known]) == pytest.approx(3e-3, rel=0.2)


def friction(t, seed):
    cart = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "F - v/2 - 2*x"},
        inputs={"F": "N"},
        outputs={"v": "v"},
    )
    force = 2 * np.sin(0.35 * t / 10 + seed) + np.sin(0.095 * t)
    rig = cart + effects.CoulombFriction("v", level=0.5)
    return rig.simulate(t / 20, force, substeps=8).y[:, 0]


@pytest.mark.parametrize(
    ("signal", "noise"),
    [
        (lambda k, seed: 0 * k, 0.01),
        (lambda k, seed: 1e-3 * k + 1e-6 * k**2, 0.01),
        (lambda k, seed: np.cumsum(np.random.default_rng(seed).normal(0, 2e-3, k.size)), 0.01),
        (lambda k, seed: np.repeat(np.random.default_rng(seed).normal(size=60), 50), 0.01),
        (lambda k, seed: np.repeat(np.random.default_rng(seed).normal(size=300), 10), 0.01),
        (friction, 3e-3),
    ],
    ids=["none", "drift", "wander", "rare steps", "steps", "dry friction"],
)
def test_noise_is_found_on_other_signals(signal, noise):
    for seed in range(3):
        y = with_noise(signal(np.arange(3000.0), seed), noise, seed)
        assert noise_level(y) == pytest.approx(noise, rel=0.2)


@pytest.mark.parametrize("step", [0.005, 0.01, 0.03])
def test_rounding_counts_as_noise(step):
    y = with_noise(np.sin(np.arange(3000) / 30), 0.01, 0)
    expected = np.hypot(0.01, step / np.sqrt(12))
    assert noise_level(np.round(y / step) * step) == pytest.approx(expected, rel=0.1)


@given(n=st.integers(0, 60), seed=st.integers(0, 2**16), missing=st.floats(0, 1))
def test_short_records_have_a_noise_too(n, seed, missing):
    rng = np.random.default_rng(seed)
    y, t = rng.standard_normal(n), np.cumsum(rng.uniform(0.5, 1.5, n))
    y[rng.uniform(size=n) < missing] = np.nan
    assert 0 <= noise_level(y, t) < 10
    assert (noise_level(y, t) > 0) == (np.isfinite(y).sum() > 3)


@given(scale=st.floats(1e-6, 1e6), shift=st.floats(-10, 10), late=st.floats(0, 2e9))
def test_noise_has_the_unit_of_the_signal_and_no_time_of_day(scale, shift, late):
    t = np.arange(400) / 8
    y = with_noise(np.sin(OMEGA * t), 0.01, 0)
    assert noise_level(scale * (y + shift), late + t) == pytest.approx(
        scale * noise_level(y, t), rel=1e-3
    )


def test_white_noise_alternates_in_its_finest_differences():
    t, y = swing(8, "driven", 0)
    differences, order = finest_differences(with_noise(y, 3e-3, 0), t)
    assert differences[1:] @ differences[:-1] < -0.6 * differences @ differences
    assert order > 3


def record(step, seed, n=1500):
    t = step * np.arange(n)
    y = with_noise(np.sin(OMEGA * t), 0.3, seed)
    return Record(t, np.zeros((n, 1)), y[:, None], np.full(2, np.nan), str(seed), np.arange(n))


def test_the_period_is_the_same_whatever_the_order_of_records_of_different_clocks():
    records = [record(0.002, 0), record(0.02, 1)]
    periods = [dominant_period(tuple(some)) for some in (records, records[::-1])]
    assert periods[0] == pytest.approx(periods[1], rel=1e-9)
    assert periods[0] == pytest.approx(1.0, rel=0.15)


def test_output_noise_is_that_of_the_records():
    records = (record(0.02, 0), record(0.03, 1))
    assert output_noise(records)[0] == pytest.approx(0.3, rel=0.1)
