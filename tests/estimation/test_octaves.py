"""Laws of octaves: no square is lost, and each is where its frequency is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from sklearn_pgnn.estimation.octaves import octaves_of

pytestmark = pytest.mark.core


def noise(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


@given(
    st.lists(st.integers(1, 70), min_size=1, max_size=6),
    st.floats(0.0, 20.0),
    st.floats(0.0, 0.9),
    st.integers(0, 99),
)
def test_no_square_is_lost(lengths, n_fitted, missing, seed):
    residual = noise(sum(lengths), 2, seed=seed)
    residual[np.random.default_rng(seed).random(residual.shape) < missing] = np.nan
    segment = np.repeat(np.arange(len(lengths)), lengths)
    found = octaves_of(residual, segment, n_fitted)
    np.testing.assert_allclose(found.squares.sum(axis=0), np.nansum(residual**2, axis=0))
    whole = octaves_of(residual, segment)
    assert (whole.counts.sum(axis=0) == np.isfinite(residual).sum(axis=0)).all()
    known = [np.unique(segment[each]).size for each in np.isfinite(residual).T]
    left = np.maximum(whole.counts.sum(axis=0) - n_fitted * np.array(known), 0.0)
    np.testing.assert_allclose(found.counts.sum(axis=0), left, atol=1e-8)


def test_units_scale_squares_and_the_order_of_segments_does_not_matter():
    parts = [noise(n, 1, seed=n) for n in (40, 55, 40)]
    one, other = (
        octaves_of(3.0 * np.concatenate(order), np.repeat(range(3), [len(p) for p in order]))
        for order in (parts, parts[::-1])
    )
    np.testing.assert_allclose(one.squares, other.squares)
    same = octaves_of(np.concatenate(parts), np.repeat(range(3), [40, 55, 40]))
    np.testing.assert_allclose(one.squares, 9.0 * same.squares)


@pytest.mark.parametrize(("period", "octave"), [(3.0, 0), (6.0, 1), (24.0, 3), (384.0, 7)])
def test_a_wave_is_in_the_octave_of_its_frequency(period, octave):
    wave = np.cos(2 * np.pi * (np.arange(1536) + 0.5) / period)[:, None]
    found = octaves_of(wave, np.zeros(1536))
    assert found.squares[octave, 0] == pytest.approx(768.0)


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_white_noise_is_white_also_where_an_initial_state_was_fitted(degree):
    residual = noise(400, 50)
    t = np.polynomial.Polynomial.basis
    basis = np.stack([t(k)(np.linspace(-1, 1, 50)) for k in range(degree + 1)], axis=1)
    left = residual - residual @ basis @ np.linalg.pinv(basis)
    found = octaves_of(left.reshape(-1, 1), np.repeat(np.arange(400), 50), degree + 1)
    counted = found.counts > 0
    assert found.power[counted] == pytest.approx(1.0, rel=0.15)


def test_first_order_noise_has_its_spectrum():
    kept, n = 0.8, 4096
    coloured = lfilter([1], [1, -kept], noise(n * 30))[:, None]
    found = octaves_of(coloured, np.repeat(np.arange(30), n))
    for octave in range(6):
        w = np.pi * 2.0 ** -(octave + 0.5 + np.linspace(-0.5, 0.5, 200))
        density = 1.0 / (1.0 - 2.0 * kept * np.cos(w) + kept**2)
        assert found.power[octave, 0] == pytest.approx(np.average(density, weights=w), rel=0.1)
