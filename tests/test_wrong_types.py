"""Parameters of a wrong type are refused before any work, with what was expected and came."""

from pathlib import Path

import numpy as np
import pytest

from sklearn_pgnn import (
    ModelDiagnosis,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    SINDYcRegressor,
    effects,
    make_pgnn_pipeline,
)

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
T = np.linspace(0, 20, 201)
X = np.column_stack([T, np.sin(T)])
Y = LAG.simulate(T, X[:, 1]).y


@pytest.mark.parametrize("model", [{"states": {"y": "V"}}, "model.yaml", Path("model.yaml")])
@pytest.mark.parametrize(
    "estimator",
    [
        ModelDiagnosis,
        PGNNLRegressor,
        PhysicsModelRegressor,
        PhysicsModelTransformer,
        ResidualRegressor,
        SINDYcRegressor,
    ],
)
def test_a_model_is_a_physics_model(estimator, model):
    expected = r"^model: expected a PhysicsModel( or None)?, got .*(model\.yaml|states).* Remedy: "
    with pytest.raises(TypeError, match=expected):
        estimator(model=model).fit(X, Y)


def test_a_pipeline_wants_a_model():
    with pytest.raises(TypeError, match=r"got str 'a\.yaml'.*from_yaml\('a\.yaml'\)"):
        make_pgnn_pipeline("a.yaml")


@pytest.mark.parametrize("estimator", [ModelDiagnosis, PhysicsModelRegressor])
def test_a_model_that_is_needed_is_asked_for(estimator):
    with pytest.raises(TypeError, match="expected a PhysicsModel, got None"):
        estimator(None).fit(X, Y)


@pytest.mark.parametrize(
    ("catalogue", "expected"),
    [
        (["stickslip"], "got 'stickslip'; one of coulomb_friction, "),
        (["coulomb_frction"], "did you mean 'coulomb_friction'"),
        ("leak", "expected a sequence of effects"),
        (effects.Leak, "expected a sequence of effects"),
        ([effects.Leak("y")], "the classes, without a target"),
        ([3], "got 3"),
    ],
)
def test_a_catalogue_holds_effects(catalogue, expected):
    with pytest.raises(ValueError, match=expected):
        ModelDiagnosis(LAG, catalogue=catalogue).fit(X, Y)


def test_effects_are_known_by_their_ids():
    assert all(effects.by_id(kind.id) is kind for kind in effects.CATALOGUE)


@pytest.mark.slow
def test_a_catalogue_of_ids_is_the_same():
    noisy = 1.2 * Y + 1e-3 * np.random.default_rng(0).normal(size=Y.shape)
    by_class = ModelDiagnosis(LAG, catalogue=[effects.SensorGain]).fit(X, noisy)
    by_id = ModelDiagnosis(LAG, catalogue=["sensor_gain"]).fit(X, noisy)
    assert by_id.candidates_ == by_class.candidates_
    assert by_id.catalogue == ["sensor_gain"]
    rows = by_id.detectability(["sensor_bias"])
    assert [row.effect for row in rows.rows] == ["sensor_bias"]


@pytest.mark.parametrize("core", [{"neurons": (16, 8)}, {"layers": "two"}, {"neurons": 2.5}])
def test_a_width_is_a_number(core):
    (name,) = core
    core = {f"module__{name}": value for name, value in core.items()}
    with pytest.raises(ValueError, match=f"module__{name}: expected an integer >= 1, got "):
        PGNNLRegressor(LAG, **core).fit(X[:, :0], Y)  # nothing of X is read before


def test_a_text_is_no_sequence_of_names():
    expected = r"free: expected a sequence of parameters among T, got 'T'\. Remedy: free=\['T'\]"
    with pytest.raises(ValueError, match=expected):
        PhysicsModelRegressor(LAG, free="T").fit(X, Y)
    expected = r"targets: expected a sequence of .* got 'yu'\. Remedy: targets=\['yu'\]"
    with pytest.raises(ValueError, match=expected):
        ModelDiagnosis(LAG, targets="yu").fit(X, Y)


def test_targets_are_listed_once():
    with pytest.raises(
        ValueError, match=r"^targets: .* got 'zzz'; one of y, u, T(, |\.$)"
    ) as raised:
        ModelDiagnosis(LAG, targets=["zzz"]).fit(X, Y)
    listed = str(raised.value).split("one of ")[1].rstrip(".").split(", ")
    assert len(listed) == len(set(listed))


@pytest.mark.parametrize("count", [-1, 1.5, "a", None])
def test_causes_are_counted(count):
    with pytest.raises(ValueError, match=r"^max_causes: expected an integer >= 0, got "):
        ModelDiagnosis(LAG, max_causes=count).fit(X[:, :0], Y)  # nothing of X is read before


@pytest.mark.parametrize("name", ["validation_fraction", "overlap"])
def test_numbers_of_numpy_are_numbers(name):
    net = PGNNLRegressor(LAG, max_epochs=1, refine=None, substeps=1, **{name: np.float32(0.25)})
    assert net.fit(X, Y).score(X, Y) > 0
    with pytest.raises(ValueError, match=f"{name}: expected a "):
        net.set_params(**{name: "a quarter"}).fit(X, Y)
