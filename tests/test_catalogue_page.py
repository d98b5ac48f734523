"""The page of the catalogue has every effect, and the pictures that it shows are there."""

import re
from pathlib import Path

import pytest

from sklearn_pgnn import effects

pytestmark = pytest.mark.core
DOCS = Path(__file__).parents[1] / "docs"


def test_every_effect_is_on_the_page_and_every_picture_is_there():
    text = (DOCS / "catalogue.rst").read_text(encoding="utf-8")
    assert set(re.findall(r"^   \* - ``(\w+)``", text, re.MULTILINE)) == {
        effect.id for effect in effects.CATALOGUE
    }
    shown = re.findall(r"image:: (\S+)", text)
    assert [name for name in shown if not (DOCS / name).is_file()] == []
    assert len(shown) == len(effects.CATALOGUE)
