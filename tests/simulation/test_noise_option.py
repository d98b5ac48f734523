"""The noise that is told is one finite number above zero for every output, or it is refused."""

import numpy as np
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, PhysicsModelRegressor
from sklearn_pgnn.exceptions import OptionError

pytestmark = pytest.mark.core

MASS = PhysicsModel(
    {"x": "m", "v": "m/s"}, {"x": "v", "v": "(F - d*v)/m"}, {"m": 1.0, "d": 0.4}, {"F": "N"}
)
ONE = MASS.replace(outputs={"place": "x"})
T = np.linspace(0, 10, 501)
X = np.column_stack([T, np.sin(T)])
TRUE = MASS.with_parameters(d=0.6).simulate(T, X[:, 1], [0.0, 0.0], substeps=4).y
Y = TRUE + 1e-3 * np.random.default_rng(0).normal(size=TRUE.shape)


@pytest.mark.parametrize("estimator", [PhysicsModelRegressor, ModelDiagnosis])
@pytest.mark.parametrize(
    "noise",
    [1e-3, [1e-3], [1e-3] * 3, [[1e-3, 1e-3]], [1e-3, np.nan], [np.inf, 1], [-1, 1], [0, 1], "x"],
)
def test_every_output_has_its_noise(estimator, noise):
    expected = (
        r"^noise_std: expected 2 finite numbers above 0, one for each output \(x, v\), got .*"
        r"Remedy: give the standard deviation of each output's noise in the output's own unit"
    )
    with pytest.raises(OptionError, match=expected):
        estimator(MASS, noise_std=noise).fit(X[:, :0], Y)  # nothing of X is read before


@pytest.mark.parametrize("noise", [0, -1e-3, np.nan, [1e-3, 1e-3]])
def test_the_noise_of_one_output(noise):
    expected = "^noise_std: expected one finite number above 0, for the output place, got "
    with pytest.raises(OptionError, match=expected):
        PhysicsModelRegressor(ONE, noise_std=noise).fit(X, Y[:, 0])


def test_a_number_is_the_noise_of_one_output():
    y = Y[:, 0]
    number, array = (
        PhysicsModelRegressor(ONE, search="local", noise_std=noise).fit(X, y)
        for noise in (1e-3, [1e-3])
    )
    assert number.noise_.tolist() == array.noise_.tolist() == [1e-3]
    assert number.parameters_ == array.parameters_
    assert np.array_equal(number.predict_ahead(X, y), array.predict_ahead(X, y))
    assert number.noise_std == 1e-3
