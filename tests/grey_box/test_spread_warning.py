"""Where several parameters went to the ends of their spreads a warning says so."""

import re
import warnings

import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.grey_box.spread_warning import warn_of_spreads


def tank():
    parameters = dict.fromkeys("abc", 2.0)
    return PhysicsModel({"h": "m"}, {"h": "a*u - b*h - c*h**2"}, parameters, {"u": "V"})


def test_several_are_told_with_the_remedy():
    said = (
        "the diagnosis re-tuned a and c to the ends of their spreads, within which a prior's "
        "parameters count as known, whatever cause it named beside them; the recipe fits them "
        "between their bounds. What it named may stand for wrong numbers. Remedy: give the spread "
        "of parameters that nobody has measured, Parameter(..., spread=inf) where nothing is known "
        "of them."
    )
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}$"):
        warn_of_spreads(tank(), tank().with_parameters(a=2.2, c=1.8))


def test_a_single_one_is_no_reason():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_spreads(tank(), tank().with_parameters(a=2.2))
