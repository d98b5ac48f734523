"""A model's source compiled to machine code, once per machine."""

import hashlib
import importlib.util
import os
import sys
import tempfile
from functools import lru_cache
from pathlib import Path

import numba
from numba import types

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.source import write_source

_ARRAY = types.float64[::1]
SIGNATURE = types.void(types.float64, _ARRAY, _ARRAY, _ARRAY, _ARRAY, _ARRAY)
#: the type of a model's function as an argument of the time loop
FUNCTION = types.FunctionType(SIGNATURE)


def cache_folder() -> Path:
    """Give the folder that compiled models are kept in.

    ``SKLEARN_PGNN_CACHE`` overrules the user's cache folder; where neither can be written, a
    temporary folder serves.
    """
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(os.environ.get("SKLEARN_PGNN_CACHE") or Path(base) / "sklearn_pgnn")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="sklearn_pgnn_"))


def compile_model(model: PhysicsModel, wrt: tuple[str, ...] | None = None):
    """Compile a model's function.

    Parameters
    ----------
    model : PhysicsModel
        The model; its parameter values do not matter.
    wrt : tuple of str, optional
        Parameters to differentiate by; without it only rates and outputs are computed.

    Returns
    -------
    function : numba function
        To be called by the time loop.
    source : Source
        What was compiled.
    """
    source = write_source(model, wrt)
    return _compile(source.text), source


@lru_cache(maxsize=4096)
def _compile(text: str):
    """Write the source where numba can cache its machine code, and load it."""
    digest = hashlib.sha256(f"{numba.__version__}\n{text}".encode()).hexdigest()[:24]
    path = cache_folder() / f"model_{digest}.py"
    if not path.exists():
        _write_whole(path, text)
    spec = importlib.util.spec_from_file_location(f"sklearn_pgnn_model_{digest}", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot load the compiled model {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # numba finds the function's module by name
    spec.loader.exec_module(module)
    return numba.njit(SIGNATURE, cache=True, error_model="numpy")(module.function)


def _write_whole(path: Path, text: str) -> None:
    """Write a file so that no other process ever reads half of it."""
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(name, path)
