"""Compiled code has a folder, without a home as well, that nobody else can have made."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numba
import pytest

from sklearn_pgnn.simulation import cache_folder

pytestmark = pytest.mark.core

#: as a service runs: no home, and an installation that belongs to somebody else
NOBODY = """
import os, sys
import numba
from sklearn_pgnn import PhysicsModel, simulation  # Python itself may be where nobody can read
simulation.simulate
for name in [name for name in sys.modules if name.startswith("sklearn_pgnn")]:
    del sys.modules[name]
os.setgroups([])
os.setgid(65534)
os.setuid(65534)
from sklearn_pgnn import PhysicsModel
lag = PhysicsModel({"y": "V"}, {"y": "-y"})
print(lag.simulate([0.0, 0.1, 0.2], x0=[1.0], substeps=8).y[-1, 0], numba.config.CACHE_DIR)
"""


@pytest.fixture
def nobody(tmp_path, monkeypatch):
    """A user whose home is not there; the parent of what would be it."""
    for name in ("SKLEARN_PGNN_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("HOME", str(tmp_path / "no" / "home"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


posix = pytest.mark.skipif(os.name != "posix", reason="a home is elsewhere on Windows")


@pytest.mark.slow
@posix
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="not root")
def test_a_user_without_a_home_simulates_with_an_installation_of_somebody_else():
    if not all(folder.stat().st_mode & 0o001 for folder in cache_folder.HERE.parents):
        pytest.skip("this checkout is for root alone")
    paths = [str(Path(path).absolute()) for path in sys.path]
    told = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    told |= {"HOME": "/nonexistent", "PYTHONDONTWRITEBYTECODE": "1"}
    for name in ("SKLEARN_PGNN_CACHE_DIR", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "TMPDIR"):
        told.pop(name, None)
    command = [sys.executable, "-c", NOBODY]
    done = subprocess.run(command, capture_output=True, text=True, env=told, cwd="/", check=False)
    assert done.returncode == 0, done.stderr
    value, folder = done.stdout.split()
    assert float(value) == pytest.approx(0.8187307531)  # exp(-0.2)
    assert folder == str(Path(tempfile.gettempdir(), "sklearn_pgnn_65534"))
    assert not Path("/nonexistent").exists()


@posix
def test_a_home_that_is_not_there_is_not_made(nobody):
    found = cache_folder.folder()
    assert found.parent == nobody
    assert found.stat().st_mode & 0o777 == 0o700
    assert not (nobody / "no").exists()


@posix
def test_a_home_that_is_there_is_used(nobody):
    (nobody / "no" / "home").mkdir(parents=True)
    folder = cache_folder.folder()
    assert folder.is_relative_to(nobody / "no" / "home")
    assert not folder.exists()  # it is made when something is kept


@posix
@pytest.mark.parametrize("mode", [0o755, 0o770, 0o777])
def test_a_temporary_folder_that_others_see_is_not_used(nobody, mode):
    cache_folder.folder().chmod(mode)
    assert cache_folder.folder() is None


@posix
def test_a_link_in_place_of_the_temporary_folder_is_not_used(nobody):
    place = cache_folder.folder()
    place.rmdir()
    (nobody / "elsewhere").mkdir(mode=0o700)
    place.symlink_to(nobody / "elsewhere")
    assert cache_folder.folder() is None


@posix
def test_numba_is_given_a_folder_only_where_it_finds_none(nobody, monkeypatch):
    assert cache_folder.numba_caches()
    assert numba.config.CACHE_DIR == ""  # beside the code
    monkeypatch.setattr(cache_folder, "HERE", nobody / "none")
    assert cache_folder.numba_caches()
    assert numba.config.CACHE_DIR.startswith(str(nobody))


@posix
def test_without_any_folder_numba_keeps_nothing(nobody, monkeypatch):
    monkeypatch.setenv("SKLEARN_PGNN_CACHE_DIR", "")
    monkeypatch.setattr(cache_folder, "HERE", nobody / "none")
    assert not cache_folder.numba_caches()
    assert not (nobody / "no").exists()


def test_the_folder_is_beside_what_numba_keeps(tmp_path, monkeypatch):
    monkeypatch.delenv("SKLEARN_PGNN_CACHE_DIR", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert cache_folder.folder() == tmp_path / "sklearn_pgnn"
