"""The model files of a diagnosis hold what was found, and every rival has one of its own."""

import pytest
from situations import situation

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.inspection.result_files import EXTENDED, described_models, model_files

pytestmark = [pytest.mark.core, pytest.mark.filterwarnings("ignore:.*the term:UserWarning")]


def read_back(diagnosis, folder):
    """Return the models of a diagnosis as their files say."""
    models = {}
    for name, text in model_files(diagnosis).items():
        (folder / name).write_text(text(), encoding="utf-8")
        models[name] = PhysicsModel.from_yaml(folder / name)
    return models


def test_a_formula_is_in_the_file(tmp_path):
    (model,) = read_back(situation("unexplained"), tmp_path).values()
    assert "F**2" in str(model.equations["v"])


def test_every_rival_has_a_file_with_it_in_the_place_of_the_cause(tmp_path):
    diagnosis = situation("ambiguous")
    (cause,) = diagnosis.causes_
    models = read_back(diagnosis, tmp_path)
    assert len(models) == 1 + len(cause.confused_with)
    assert models[EXTENDED] == diagnosis.extended_model_
    (rival,) = (name for name in models if name != EXTENDED)
    assert rival == "extended_model_with_constant_load_v_for_input_bias_F.yaml"
    assert set(models[rival].parameters) != set(models[EXTENDED].parameters)


@pytest.mark.parametrize("name", ["adequate", "ambiguous", "named", "unexplained"])
def test_every_file_is_described(name):
    diagnosis = situation(name)
    assert set(described_models(diagnosis)) == set(model_files(diagnosis))
