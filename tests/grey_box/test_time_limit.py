"""A recipe ends in time with the best until then, shows where it is, and can be kept."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sledge import SLEDGE as CART

from sklearn_pgnn import GreyBoxRegressor, ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.exceptions import OptionError

T = np.arange(0, 30, 0.02)
X = np.column_stack([T, 2 * np.sin(0.7 * T) + np.sin(1.9 * T)])
Y = (CART + effects.CoulombFriction("v", level=0.4)).simulate(T, X[:, 1], substeps=5).y
Y = Y + 1e-3 * np.random.default_rng(0).normal(size=Y.shape)
DEPTHS = ("prior", "fitted", "extended")


def test_the_first_depth_is_judged_however_short_the_time(capsys):
    recipe = GreyBoxRegressor(CART, depths=DEPTHS[:2], time_limit=1e-9, verbose=1)
    with pytest.warns(
        UserWarning, match=r"time limit of 1e-09 s: not judged: fitted\. Remedy: a l"
    ):
        recipe.fit(X, Y)
    assert recipe.depth_ == "prior"
    assert list(recipe.errors_) == ["prior"]
    assert recipe.stopped_ == "time limit of 1e-09 s: not judged: fitted"
    shown = capsys.readouterr().out
    assert "[GreyBoxRegressor] depth 'prior', folds: 0 of 6 ..." in shown
    assert "[GreyBoxRegressor] prior: cross-validated error " in shown


def test_the_diagnosis_gets_half_of_the_time_and_no_more_than_its_own():
    for own, limit, expected in ((None, 100.0, 50.0), (20.0, 100.0, 20.0), (90.0, 100.0, 50.0)):
        diagnosis = ModelDiagnosis(CART, catalogue=(), time_limit=own)
        recipe = GreyBoxRegressor(CART, depths=DEPTHS[:1], time_limit=limit, diagnosis=diagnosis)
        recipe.set_params(depths=("prior", "extended")).fit(X, Y)
        assert recipe.diagnosis_.time_limit == expected
        assert recipe.stopped_ is None


def test_a_recipe_shows_its_diagnosis_and_keeps_no_display(capsys, tmp_path):
    diagnosis = ModelDiagnosis(CART, catalogue=["coulomb_friction"], max_causes=1)
    recipe = GreyBoxRegressor(
        CART, depths=DEPTHS, diagnosis=diagnosis, verbose=1, memory=str(tmp_path)
    ).fit(X, Y)
    shown = capsys.readouterr().out
    assert "simulating the candidates" in shown
    assert "[GreyBoxRegressor] best candidate so far: error" in shown
    assert recipe.stopped_ is None
    kept = pickle.loads(pickle.dumps(recipe))
    assert np.array_equal(kept.predict(X), recipe.predict(X))
    assert kept.diagnosis_.progress is None


@pytest.mark.parametrize("limit", [0, -1.0, "soon"])
def test_a_limit_is_a_time(limit):
    with pytest.raises(OptionError, match="time_limit: expected a time above 0 s or None, got"):
        GreyBoxRegressor(CART, time_limit=limit).fit(X, Y)


CRANE = PhysicsModel(
    {"p": "m", "v": "m/s", "theta": "rad", "omega": "rad/s"},
    {
        "p": "v",
        "v": "(F - d*v + m*sin(theta)*(l*omega**2 + g*cos(theta)))/(M + m*sin(theta)**2)",
        "theta": "omega",
        "omega": "-(cos(theta)*(F - d*v + m*sin(theta)*(l*omega**2 + g*cos(theta)))"
        "/(M + m*sin(theta)**2) + g*sin(theta))/l - c*omega",
    },
    {"M": 5.0, "m": 2.0, "l": 1.5, "d": 4.0, "g": 9.81, "c": 0.1},
    {"F": "N"},
    outputs={"position": "p", "angle": "theta"},
)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_crane_with_the_default_settings(capsys):
    rubbing = CRANE.with_parameters(d=5.0).replace(
        equations={
            state: text.replace("F - d*v", "F - d*v - 3*tanh(v/0.01)")
            for state, text in ((state, str(rate)) for state, rate in CRANE.equations.items())
        }
    )
    t, rng = np.arange(0, 10, 0.02), np.random.default_rng(0)
    tables, outputs = [], []
    for name in range(3):
        force = 15 * np.sin(rng.uniform(0.8, 2) * t) + 8 * np.sign(np.sin(rng.uniform(0.3, 1) * t))
        run = rubbing.simulate(t, force, substeps=8)
        tables.append(pd.DataFrame({"trajectory": name, "t": t, "F": force}))
        outputs.append(run.y + [1e-3, 1e-3] * rng.normal(size=run.y.shape))
    X, y = pd.concat(tables, ignore_index=True), np.concatenate(outputs)
    recipe = GreyBoxRegressor(CRANE, verbose=1, time_limit=60.0).fit(X, y)
    assert min(recipe.errors_.values()) < recipe.errors_["prior"]
    assert recipe.errors_[recipe.depth_] <= 1.01 * min(recipe.errors_.values())
    shown = capsys.readouterr().out
    assert "best candidate so far" in shown
    assert f"chosen: {recipe.depth_}" in shown
    kept = pickle.loads(pickle.dumps(recipe))
    assert np.array_equal(kept.predict(X), recipe.predict(X))
