"""A fit that fails is recorded under its last cause, with the others and the reason."""

from types import SimpleNamespace

import numpy as np
import pytest

from sklearn_pgnn import effects
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.unusable import FailureLog, note_fit, tolerate_failures

pytestmark = pytest.mark.core

KEY = (frozenset(), frozenset())
BOTH = Hypothesis().plus(effects.CoulombFriction("v")).plus(effects.SensorGain("x"))


def fit(squares):
    squares = np.array(squares)
    usable = bool(np.isfinite(squares).all())
    return SimpleNamespace(usable=usable, evaluation=SimpleNamespace(squares=squares), x0=squares)


def test_an_error_is_the_reason_and_the_other_causes_are_told():
    failures = FailureLog()
    with tolerate_failures(failures, KEY, BOTH):
        raise np.linalg.LinAlgError("singular")
    expected = ("sensor_gain", "x", "singular with coulomb_friction of v")
    assert failures.entries() == (expected,)


def test_without_an_error_the_lost_windows_are_counted():
    failures, lost = FailureLog(), fit([1.0, np.inf, np.nan])
    assert note_fit(failures, KEY, BOTH, lost) is lost
    ((_, _, reason),) = failures.entries()
    assert "dominated by rounding errors in 2 of 3 windows" in reason


def test_what_was_fitted_from_another_start_is_usable():
    failures = FailureLog()
    with tolerate_failures(failures, KEY, Hypothesis()):
        raise FloatingPointError("overflow")
    note_fit(failures, KEY, Hypothesis(), fit([1.0]))
    assert failures.entries() == ()
