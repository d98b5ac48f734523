"""A start is found by what predicts, from the first measured samples alone."""

import numpy as np
import pytest

from sklearn_pgnn.grey_box.initial_state import find_initial_state

T = np.arange(20) * 0.1
MET = np.random.default_rng(0).normal(size=(50, 2))


def swing(starts):
    """Return the position of an oscillator that starts in several states at once."""
    position, speed = starts[:, :1], starts[:, 1:]
    return (position * np.cos(T) + speed * np.sin(T))[..., None]


def test_what_is_not_told_is_found():
    y = swing(np.array([[0.5, -0.3]]))[0]
    y[3:6] = np.nan
    found = find_initial_state(swing, np.full(2, np.nan), y, MET, np.array([1e-3]))
    assert found == pytest.approx([0.5, -0.3], abs=1e-4)
    half = find_initial_state(swing, np.array([0.5, np.nan]), y, MET, np.array([1e-3]))
    assert half == pytest.approx([0.5, -0.3], abs=1e-4)
    assert half[0] == 0.5


def test_a_start_that_diverges_is_none():
    def breaking(starts):
        return np.where(starts[:, :1, None] > 1.0, np.nan, swing(starts))

    y = swing(np.array([[0.9, 0.2]]))[0]
    found = find_initial_state(breaking, np.full(2, np.nan), y, MET, np.array([1e-3]))
    assert found == pytest.approx([0.9, 0.2], abs=1e-3)


def test_few_runs_are_asked_for_at_once():
    asked = []

    def counted(starts):
        asked.append(len(starts))
        return swing(starts)

    y = swing(np.array([[0.5, -0.3]]))[0]
    find_initial_state(counted, np.full(2, np.nan), y, MET, np.array([1e-3]))
    assert asked[0] == 50
    assert len(asked) < 100
