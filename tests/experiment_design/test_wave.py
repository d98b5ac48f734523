"""Designed excitations are functions of time, whatever they are sampled at."""

import numpy as np
import pytest

from sklearn_pgnn.experiment_design.separation import waves

DURATION = 12.0
WAVES = waves(1.5, DURATION, 0.02)


@pytest.mark.parametrize("wave", WAVES, ids=str)
def test_a_wave_stays_within_one_and_begins_at_rest(wave):
    values = wave(np.linspace(0.0, DURATION, 601), DURATION)
    assert 0.95 < np.abs(values).max() <= 1.0 + 1e-12
    assert abs(values[0]) < 1e-9


@pytest.mark.parametrize("wave", WAVES, ids=str)
def test_a_wave_is_the_same_at_any_sample_rate_and_in_parts(wave):
    fine = np.linspace(0.0, DURATION, 601)
    whole = wave(fine, DURATION)
    np.testing.assert_array_equal(wave(fine[::10], DURATION), whole[::10])
    np.testing.assert_array_equal(wave(fine[:300], DURATION), whole[:300])


def test_no_wave_is_quicker_than_samples_can_show():
    assert max(wave.high for wave in WAVES) * 0.02 <= 0.5
    assert len(waves(1.5, DURATION, 0.1)) < len(WAVES)
