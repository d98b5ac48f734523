"""What a recipe warns of points to the line of the user that called fit."""

import numpy as np
import pytest

from sklearn_pgnn import GreyBoxRegressor, ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.exceptions import DiagnosisWarning
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
