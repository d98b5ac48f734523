"""What a notebook shows: equations, words and numbers, escaped; what Python prints is short."""

from html.parser import HTMLParser

import pytest
from sledge import SLEDGE, rough_sledge

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems

pytestmark = pytest.mark.core

INJECTED = "<script>alert(1)</script>"


#: tags that nothing closes; scikit-learn has a box to tick
VOID = {"br", "img", "input", "link", "meta"}


class Balance(HTMLParser):
    """Check that every tag that is opened is closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags = [], set()
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        self.tags.add(tag)

    def handle_endtag(self, tag):
        assert tag in VOID or self.open.pop() == tag


def test_a_model_shows_its_equations_and_units():
    text = systems.golf_robot()._repr_html_()
    assert "math" in Balance(text).tags
    for what in ("golf robot", "phi_measured", "rad/s", "kg m²", "known"):
        assert what in text
    assert systems.golf_robot()._repr_latex_().startswith("$$\n\\begin{aligned}")


def test_names_and_units_are_escaped():
    model = PhysicsModel({"v": INJECTED}, {"v": "-v/T"}, {"T": 2.0}, name=INJECTED)
    assert "script" not in Balance(model._repr_html_()).tags


@pytest.mark.parametrize("kind", effects.CATALOGUE, ids=lambda kind: kind.id)
def test_every_effect_shows_what_it_is(kind):
    effect = kind("v")
    text = effect._repr_html_()
    Balance(text)
    assert kind.title("v") in text
    law = effect._repr_latex_()
    assert law is None or (law.startswith("$") and law.endswith("$"))


def test_an_effect_of_ones_own_without_documentation_has_no_law():
    class Own(effects.CoulombFriction):
        pass

    Own.__doc__ = None
    assert Own("v")._repr_latex_() is None


def test_a_diagnosis_shows_its_settings_and_then_its_verdict():
    diagnosis, _, _ = rough_sledge()
    assert "Cause named" not in ModelDiagnosis(SLEDGE)._repr_html_()
    assert ModelDiagnosis(SLEDGE)._repr_latex_() is None
    text = diagnosis._repr_mimebundle_()["text/html"]
    Balance(text)
    shown = ("Cause named.", "Coulomb friction on v", "v, windows", "v, free run", "&gt; 99.9 %")
    assert all(what in text for what in shown)
    assert "sign" in diagnosis._repr_latex_()


def test_a_cause_shows_its_size_and_how_to_check_it():
    (cause,) = rough_sledge()[0].causes_
    text = cause._repr_html_()
    Balance(text)
    for what in ("Coulomb friction on v", "level", "m/s²", cause.check):
        assert what in text
    assert cause._repr_latex_() == effects.CoulombFriction("v")._repr_latex_()


def test_a_detectability_is_a_line_in_python_and_a_table_in_a_notebook():
    found = rough_sledge()[0].detectability([effects.InputBias])
    assert repr(found) == "<Detectability: 1 of 1 effects, power 0.9>"
    Balance(found._repr_html_())
    assert "input bias of F" in found._repr_html_()
