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
