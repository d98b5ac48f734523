"""What is kept on disk changes no number, and counts only where the user alone has written it."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import Mock

import numba
import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, priors
from sklearn_pgnn.simulation import disk_cache, machine_code
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.source import Source, write_source

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
    if not all(folder.stat().st_mode & 0o001 for folder in disk_cache.HERE.parents):
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
    found = disk_cache.folder()
    assert found.parent == nobody
    assert found.stat().st_mode & 0o777 == 0o700
    assert not (nobody / "no").exists()


@posix
def test_a_home_that_is_there_is_used(nobody):
    (nobody / "no" / "home").mkdir(parents=True)
    folder = disk_cache.folder()
    assert folder.is_relative_to(nobody / "no" / "home")
    assert not folder.exists()  # it is made when something is kept


@posix
@pytest.mark.parametrize("mode", [0o755, 0o770, 0o777])
def test_a_temporary_folder_that_others_see_is_not_used(nobody, mode):
    disk_cache.folder().chmod(mode)
    assert disk_cache.folder() is None


@posix
def test_a_link_in_place_of_the_temporary_folder_is_not_used(nobody):
    place = disk_cache.folder()
    place.rmdir()
    (nobody / "elsewhere").mkdir(mode=0o700)
    place.symlink_to(nobody / "elsewhere")
    assert disk_cache.folder() is None


@posix
def test_numba_is_given_a_folder_only_where_it_finds_none(nobody, monkeypatch):
    assert disk_cache.numba_caches()
    assert numba.config.CACHE_DIR == ""  # beside the code
    monkeypatch.setattr(disk_cache, "HERE", nobody / "none")
    assert disk_cache.numba_caches()
    assert numba.config.CACHE_DIR.startswith(str(nobody))


@posix
def test_without_any_folder_numba_keeps_nothing(nobody, monkeypatch):
    monkeypatch.setenv("SKLEARN_PGNN_CACHE_DIR", "")
    monkeypatch.setattr(disk_cache, "HERE", nobody / "none")
    assert not disk_cache.numba_caches()
    assert not (nobody / "no").exists()


def test_the_folder_is_beside_what_numba_keeps(tmp_path, monkeypatch):
    monkeypatch.delenv("SKLEARN_PGNN_CACHE_DIR", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert disk_cache.folder() == tmp_path / "sklearn_pgnn"


PENDULUM = PhysicsModel(
    {"phi": "rad", "omega": "rad/s"},
    {"phi": "omega", "omega": "u - k*sin(phi) - d*omega*abs(omega) - c*sign(omega)"},
    {"k": 9.0, "d": 0.1, "c": 0.3},
    {"u": ""},
)

RUN = """
import sys
import numpy as np
from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.simulation import machine_code, source
from sklearn_pgnn.simulation.compiled import compile_model

def refuse(*_, **__):
    raise AssertionError("done again")

if sys.argv[1] == "again":
    source._written = machine_code._module = refuse
model = PhysicsModel(
    {"phi": "rad", "omega": "rad/s"},
    {"phi": "omega", "omega": "u - k*sin(phi) - d*omega*abs(omega) - c*sign(omega)"},
    {"k": 9.0, "d": 0.1, "c": 0.3},
    {"u": ""},
)
compile_model(model, ("k", "c"))
t = np.arange(0, 2, 0.01)
print(model.simulate(t, np.sin(3*t), [0.3, 0.0]).y.tobytes().hex())
"""


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """Return an empty folder of what is kept."""
    monkeypatch.setenv("SKLEARN_PGNN_CACHE_DIR", str(tmp_path / "kept"))
    return tmp_path / "kept"


def compiled_anew(monkeypatch):
    """Return a function compiled, and how often LLVM had to compile."""
    made = []
    original = machine_code._module
    monkeypatch.setattr(machine_code, "_module", lambda *a: made.append(a) or original(*a))
    object_file = machine_code._object_file("key", write_source(PENDULUM, ("k",)), "rk4")
    monkeypatch.setattr(machine_code, "_module", original)
    return object_file, len(made)


def test_a_second_process_writes_and_compiles_nothing_and_gives_the_same_numbers(kept):
    outputs = []
    for which, seed in (("first", "1"), ("again", "2")):
        path = os.pathsep.join(sys.path)
        told = {**os.environ, "PYTHONPATH": path, "PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", RUN, which]
        done = subprocess.run(command, capture_output=True, text=True, env=told, check=False)
        assert done.returncode == 0, done.stderr
        outputs.append(done.stdout)
    assert len(outputs[0]) > 1000
    assert outputs[0] == outputs[1]


def test_what_is_kept_is_what_was_compiled(kept, monkeypatch):
    first, count = compiled_anew(monkeypatch)
    assert count == 1
    assert compiled_anew(monkeypatch) == (first, 0)


def test_a_source_is_read_as_it_was_written(kept):
    for wrt in (None, (), ("k", "c")):
        source = write_source(PENDULUM, wrt)
        assert Source.from_bytes(source.to_bytes()) == source


@pytest.mark.parametrize("harm", ["cut", "changed", "empty", "renamed", "folder"])
def test_a_file_that_is_not_what_was_kept_is_compiled_anew(kept, monkeypatch, harm):
    first, _ = compiled_anew(monkeypatch)
    file, whole = kept / "key", (kept / "key").read_bytes()
    file.unlink()
    if harm == "folder":
        file.mkdir()
    elif harm == "renamed":
        disk_cache.keep("other", first)
        (kept / "other").rename(file)
    else:
        file.write_bytes({"cut": whole[:-9], "changed": whole[:-1] + b"x", "empty": b""}[harm])
    assert compiled_anew(monkeypatch) == (first, 1)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no such owners here")
@pytest.mark.parametrize("mode", [0o620, 0o602])
def test_a_file_that_others_may_write_is_compiled_anew(kept, monkeypatch, mode):
    first, _ = compiled_anew(monkeypatch)
    (kept / "key").chmod(mode)
    assert compiled_anew(monkeypatch) == (first, 1)
    assert compiled_anew(monkeypatch) == (first, 0)  # it was replaced by one's own


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no such owners here")
def test_a_file_of_another_user_is_compiled_anew(kept, monkeypatch):
    first, _ = compiled_anew(monkeypatch)
    monkeypatch.setattr(os, "geteuid", lambda: (kept / "key").stat().st_uid + 1)
    assert compiled_anew(monkeypatch) == (first, 1)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with a name here")
def test_a_pipe_does_not_hold_up(kept, monkeypatch):
    kept.mkdir()
    os.mkfifo(kept / "key")
    assert compiled_anew(monkeypatch)[1] == 1


def test_without_a_folder_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("SKLEARN_PGNN_CACHE_DIR", "")
    assert disk_cache.folder() is None
    first, _ = compiled_anew(monkeypatch)
    assert compiled_anew(monkeypatch) == (first, 1)
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("SKLEARN_PGNN_CACHE_DIR", str(tmp_path / "file"))
    assert compiled_anew(monkeypatch) == (first, 1)


def test_other_processors_libraries_and_versions_have_other_files(monkeypatch):
    source, asked = write_source(PENDULUM), []
    monkeypatch.setattr(machine_code, "_MEMORIES", {})
    monkeypatch.setattr(machine_code, "CodeMemory", lambda: Mock(count=0))
    monkeypatch.setattr(machine_code._Begun, "memory", None)
    monkeypatch.setattr(machine_code, "_object_file", lambda key, *_: asked.append(key))
    machine_code.machine_code(source, "rk4")
    machine_code.machine_code(source, "euler")
    monkeypatch.setattr(machine_code, "processor", lambda: ("triple", "other", "+less"))
    machine_code.machine_code(source, "rk4")
    monkeypatch.setattr(disk_cache, "_writers", lambda: ("99.0",))
    machine_code.machine_code(source, "rk4")
    assert len(set(asked)) == 4


def test_models_that_differ_in_the_last_digit_have_other_files(kept):
    for number in (0.1234, np.nextafter(0.1234, 1.0)):
        write_source(PhysicsModel({"x": ""}, {"x": f"-{float(number)!r}*x"}))
    assert len(list(kept.iterdir())) == 2


def test_a_function_without_an_equation_is_not_kept(kept):
    def rates(t, x, u, p):
        return [-p["k"] * x["v"] ** 3 if x["v"] > 0.1 else 0.0]

    model = priors.from_function(rates, {"v": "m/s"}, parameters={"k": 0.5}, trace=False)
    assert model.opaque_functions
    compile_model(model, ("k",))
    assert not kept.exists()


def test_what_has_not_been_read_for_longest_goes(kept, monkeypatch):
    for name in ("a", "b", "c"):
        disk_cache.keep(name, bytes(1000))
        age = time.time() - {"a": 10, "b": 30, "c": 20}[name]
        os.utime(kept / name, (age, age))
    disk_cache.load("b")
    monkeypatch.setattr(disk_cache, "MOST", 2500)
    disk_cache._make_room(kept)
    assert sorted(path.name for path in kept.iterdir()) == ["a", "b"]
