"""The front door: a light import, and every public name behind it."""

import subprocess
import sys
from pathlib import Path

import pytest

import sklearn_pgnn

pytestmark = pytest.mark.core

HEAVY = {"matplotlib", "numba", "pysindy", "skorch", "torch"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "statement", ["import sklearn_pgnn", "from sklearn_pgnn import systems; systems.golf_robot()"]
)
def test_heavy_libraries_wait_until_they_are_used(statement):
    show = f"{statement}; import sys; print(*{{name.split('.')[0] for name in sys.modules}})"
    result = subprocess.run(
        [sys.executable, "-c", show],
        cwd=Path(sklearn_pgnn.__file__).parents[1],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    loaded = result.stdout.split()
    assert "sklearn_pgnn" in loaded
    assert HEAVY.isdisjoint(loaded)


@pytest.mark.parametrize("name", sklearn_pgnn.__all__)
def test_every_public_name_is_there(name):
    assert getattr(sklearn_pgnn, name) is not None
    assert name in dir(sklearn_pgnn)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = sklearn_pgnn.nothing
