"""Pictures the scikit-learn way: what they hold, on what they draw, what they refuse."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sledge import SLEDGE, rough_sledge

from sklearn_pgnn import PhysicsModelRegressor
from sklearn_pgnn.inspection import (
    CandidatesDisplay,
    CharacteristicDisplay,
    ParametersDisplay,
    ResidualDisplay,
    SimulationDisplay,
    fit_percentage,
    resid,
)
from sklearn_pgnn.inspection.run_displays import correlation

pytestmark = pytest.mark.core

OF_A_DIAGNOSIS = (
    SimulationDisplay,
    ResidualDisplay,
    CandidatesDisplay,
    CharacteristicDisplay,
    ParametersDisplay,
)


@pytest.fixture(autouse=True)
def no_figure_is_left():
    yield
    plt.close("all")


# -- what all have in common -----------------------------------------------------------------------


@pytest.mark.parametrize("kind", OF_A_DIAGNOSIS)
def test_a_picture_is_drawn_on_a_figure_that_is_shown(kind):
    display = kind.from_estimator(rough_sledge()[0])
    assert display.figure_.number in plt.get_fignums()
    assert display.plot() is display


@pytest.mark.parametrize("kind", OF_A_DIAGNOSIS)
def test_a_picture_is_drawn_on_axes_that_are_given(kind):
    panels = 2 if kind is ResidualDisplay else 1
    figure, axes = plt.subplots(panels)
    display = kind.from_estimator(rough_sledge()[0], ax=axes)
    assert display.figure_ is figure
    assert plt.get_fignums() == [figure.number]
    with pytest.raises(ValueError, match=f"ax: expected {panels} axes, got 3"):
        display.plot(ax=plt.subplots(3)[1])


# -- simulation ------------------------------------------------------------------------------------


def test_the_fit_is_that_of_matlab():
    rng = np.random.default_rng(0)
    y, yhat = rng.normal(size=(2, 50))
    expected = 100 * (1 - np.linalg.norm(y - yhat) / np.linalg.norm(y - y.mean()))
    assert fit_percentage(y, yhat) == pytest.approx([expected])
    assert fit_percentage(y, np.full(50, y.mean())) == pytest.approx([0.0], abs=1e-9)
    assert fit_percentage(y, y) == [100.0]
    assert fit_percentage(y, np.full(50, np.inf)) == [-np.inf]
    assert np.isnan(fit_percentage(np.ones(5), np.ones(5)))
    y = np.array([0.0, np.nan, 1.0, 2.0])
    assert fit_percentage(y, [0.0, 9.0, 1.0, 2.0]) == [100.0]
    with pytest.raises(ValueError, match=r"expected the shape of what was measured, \(3,\)"):
        fit_percentage([1, 2, 3], [1, 2])


def test_the_models_of_a_diagnosis_are_compared_on_its_records():
    display = SimulationDisplay.from_estimator(rough_sledge()[0])
    given, retuned, extended = display.fits_.values()
    assert given < retuned < extended
    assert extended > 99
    labels = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert labels[0] == "measured"
    assert labels[-1] == f"model extended: fit {extended:.1f} %"


def test_several_models_and_estimators_are_compared_on_new_records():
    diagnosis, X, y = rough_sledge()
    several = {"on paper": SLEDGE, "diagnosed": diagnosis}
    display = SimulationDisplay.from_estimator(several, X, y, record=2)
    assert list(display.fits_) == ["on paper", "diagnosed"]
    assert display.fits_["diagnosed"] > display.fits_["on paper"]
    assert display.t.size == 500


def test_a_pipeline_and_a_search_are_run_as_their_model():
    _, X, y = rough_sledge()
    pipeline = make_pipeline(PhysicsModelRegressor(SLEDGE)).fit(X, y)
    search = GridSearchCV(PhysicsModelRegressor(SLEDGE), {"search": ["local"]}, cv=2).fit(X, y)
    several = {"pipeline": pipeline, "search": search}
    display = SimulationDisplay.from_estimator(several, X, y)
    assert display.fits_["pipeline"] == pytest.approx(display.fits_["search"], abs=0.1)


def test_what_cannot_be_simulated_is_refused():
    diagnosis, X, y = rough_sledge()
    for arguments, said in (
        ((SLEDGE,), "X: expected the records"),
        ((SLEDGE, X), "y: expected what was measured"),
        ((object(), X, y), "estimator: expected a PhysicsModel"),
    ):
        with pytest.raises(ValueError, match=said):
            SimulationDisplay.from_estimator(*arguments)
    with pytest.raises(ValueError, match="record: expected a number from 0 to 3, got 4"):
        SimulationDisplay.from_estimator(diagnosis, record=4)
    with pytest.raises(ValueError, match="output: expected one of v, got 'x'"):
        SimulationDisplay.from_estimator(diagnosis, output="x")


# -- residuals -------------------------------------------------------------------------------------


def test_white_noise_is_white_and_a_random_walk_is_not():
    rng = np.random.default_rng(1)
    records = [rng.normal(size=400) for _ in range(3)]
    assert ResidualDisplay(records, {}).is_white()
    assert not ResidualDisplay([np.cumsum(r) for r in records], {}).is_white()


def test_white_noise_is_white_after_a_level_was_fitted_to_short_windows_of_it():
    rng, n = np.random.default_rng(1), 12
    windows = [noise - noise.mean() for noise in rng.normal(size=(400, n))]
    expected = [-(n - k) / n / (n - 1) for k in range(1, 6)]
    assert not ResidualDisplay(windows, {}, n_lags=5).is_white()
    assert ResidualDisplay(windows, {}, n_lags=5, expected=expected).is_white()


def test_a_correlation_is_at_its_lag_and_never_spans_records():
    rng = np.random.default_rng(2)
    u = [rng.normal(size=500) for _ in range(2)]
    later = [np.roll(signal, 3) for signal in u]
    lags = np.arange(-5, 6)
    found = correlation(u, later, lags)
    assert lags[np.argmax(found)] == 3
    assert found.max() > 0.95
    apart = [np.array([1.0, 0.0, 0.0, -1.0]), np.array([0.0, 1.0, -1.0, 0.0])]
    assert correlation(apart, apart, [4]) == [0.0]


def test_lacking_dynamics_show_between_input_and_residuals():
    diagnosis, X, y = rough_sledge()
    mended = ResidualDisplay.from_estimator(diagnosis)
    assert mended.is_white()
    given = resid(SLEDGE, X, y, n_lags=10)
    assert not given.is_white()
    assert given.lags_.size == 21
    assert np.abs(given.cross_correlation_["F"]).max() > given.band_
    assert np.abs(mended.cross_correlation_["F"]).max() < mended.band_


# -- candidates, causes, parameters ----------------------------------------------------------------


def test_candidates_stand_from_the_best_and_the_cause_is_marked():
    diagnosis, _, _ = rough_sledge()
    display = CandidatesDisplay.from_estimator(diagnosis, most=1)
    assert display.names == ["Coulomb friction on v"]
    assert display.named == [True]
    assert 0 < display.noise <= display.left[0] * 1.2
    assert len(CandidatesDisplay.from_estimator(diagnosis).names) == len(diagnosis.candidates_)


def test_a_cause_that_was_not_named_has_no_characteristic():
    diagnosis, _, _ = rough_sledge()
    display = CharacteristicDisplay.from_estimator(diagnosis)
    assert display.ax_.get_xlabel() == "v [m/s]"
    with pytest.raises(ValueError, match="expected a number below 1"):
        CharacteristicDisplay.from_estimator(diagnosis, 1)


def test_parameters_of_a_fit_are_drawn_with_their_change():
    _, X, y = rough_sledge()
    fitted = PhysicsModelRegressor(SLEDGE).fit(X, y)
    display = ParametersDisplay.from_estimator(fitted)
    labels = [text.get_text() for text in display.ax_.get_yticklabels()]
    assert [text.split(" = ")[0] for text in labels] == ["m", "d"]
