"""The extras that messages name are those that can be installed."""

import re
import tomllib
from pathlib import Path

import pytest

from sklearn_pgnn.extras import EXTRAS

pytestmark = pytest.mark.core

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
#: what is installed to build and test, and what takes in all others
OTHERS = {"all", "docs", "test"}


def test_every_extra_can_be_installed_and_all_takes_them_in():
    offered = PROJECT["project"]["optional-dependencies"]
    assert set(offered) - OTHERS == set(EXTRAS)
    (every,) = offered["all"]
    assert set(re.search(r"\[(.*)\]", every)[1].split(",")) == set(EXTRAS)
