"""Compiled code calls functions of Python, and nothing that they raise is lost."""

import math

import numpy as np
import pytest

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.priors import from_function

pytestmark = pytest.mark.core

T = np.arange(0, 2, 0.05)


@pytest.mark.slow
def test_what_a_function_raises_is_told_and_ends_the_simulation():
    def ends(t, x, u, p):
        return [math.sqrt(1.0 - t)]

    model = from_function(ends, {"y": "V"}, trace=False)
    with pytest.warns(SimulationWarning, match=r"ends, line \d+: ValueError: math domain error"):
        found = model.simulate(T)
    assert np.isfinite(found.y[:20]).all()
    assert np.isnan(found.y[-1])


def test_a_signal_ends_the_loop_and_is_raised_behind_it():
    def stops(t, x, u, p):
        if armed and t > 1.0:
            armed.clear()
            raise KeyboardInterrupt
        return [t - x[0]]

    armed: list[bool] = []
    model = from_function(stops, {"y": "V"}, trace=False)
    armed.append(True)
    with pytest.raises(KeyboardInterrupt):
        model.simulate(T)
    assert np.isfinite(model.simulate(T).y).all()
