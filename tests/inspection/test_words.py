"""The verdict in words."""

from types import SimpleNamespace

import pytest

from sklearn_pgnn.inspection import words


@pytest.mark.parametrize(
    ("much", "title"), [(True, "No cause found"), (False, "Model adequate")], ids=["much", "noise"]
)
def test_a_model_that_leaves_many_times_the_noise_is_not_titled_adequate(monkeypatch, much, title):
    monkeypatch.setattr(words, "leaves_much", lambda diagnosis: much)
    nothing = SimpleNamespace(complete_=True, verdict_="model_adequate")
    assert words.verdict_title(nothing) == title


def test_that_no_cause_acts_is_one_of_the_answers():
    rival = SimpleNamespace(effect="coulomb_friction", target="v", probability=0.05)
    cause = SimpleNamespace(probability=0.5, confused_with=(rival,))
    assert words.rivals(cause) == "Coulomb friction on v (5 %) and none of these (45 %)"
    cause.probability = 0.949
    assert words.rivals(cause) == "Coulomb friction on v (5 %)"
    cause.confused_with = ()
    assert words.rivals(cause) == ""
