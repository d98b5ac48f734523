"""What a recipe warns of says the remedy, and points to the user's line that called fit."""

import re
import warnings

import numpy as np
import pytest

from sklearn_pgnn import GreyBoxRegressor, ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.exceptions import DiagnosisWarning
from sklearn_pgnn.grey_box.options import warn_of_spreads
from sklearn_pgnn.user_line import warn_user

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
T = np.arange(0, 20, 0.1)
X = np.column_stack([T, np.sin(T) + np.sin(0.31 * T)])
Y = LAG.simulate(T, X[:, 1], substeps=4).y + 1e-3 * np.random.default_rng(0).normal(
    size=(T.size, 1)
)


class BrokenOff(ModelDiagnosis):
    def fit(self, X, y):
        super().fit(X, y)
        warn_user("a stage failed", DiagnosisWarning)


@pytest.mark.parametrize(
    ("diagnosis", "what"),
    [(BrokenOff, "a stage failed"), (ModelDiagnosis, "has nothing for")],
)
def test_a_warning_points_to_the_call_of_fit(diagnosis, what):
    settings = diagnosis(LAG, catalogue=(effects.InputSaturation,))
    grey_box = GreyBoxRegressor(LAG, depths=("extended",), diagnosis=settings, n_splits=2)
    with pytest.warns(UserWarning, match=what) as told:
        grey_box.fit(X, Y)
    assert {each.filename for each in told if what in str(each.message)} == {__file__}


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
