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
        "the diagnosis re-tuned a and c to the limits of their spreads. The named causes may "
        "compensate for wrong parameter values. Remedy: widen the spread of parameters that were "
        "not measured, Parameter(..., spread=inf) for unknown ones. (The fits of GreyBoxRegressor "
        "use the bounds, not the spreads.)"
    )
    with pytest.warns(UserWarning, match=f"^{re.escape(said)}$"):
        warn_of_spreads(tank(), tank().with_parameters(a=2.2, c=1.8))


def test_a_single_one_is_no_reason():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_spreads(tank(), tank().with_parameters(a=2.2))
