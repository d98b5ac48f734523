"""The files of a diagnosis: written whole or not at all."""

import json
import math
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import contextmanager
from pathlib import Path

from sklearn_pgnn import __version__


def strict_json(diagnosis) -> str:
    """Write a diagnosis as strict JSON, with the package's version; what is not finite is null."""
    data = {**diagnosis.to_dict(), "version": __version__}
    return json.dumps(_finite(data), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _finite(value):
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def result_folder(output: Path):
    """Give a folder beside `output`; what is in it comes to `output` when all went well.

    Parameters
    ----------
    output : Path
        Where the files shall be in the end.

    Yields
    ------
    Path
        Where to write them.

    Raises
    ------
    ValueError
        If `output` is no folder, or none can be made there.
    """
    _check_place(output)
    with tempfile.TemporaryDirectory(prefix=".sklearn_pgnn_", dir=_beside(output)) as temporary:
        yield Path(temporary)
        output.mkdir(parents=True, exist_ok=True)
        for file in sorted(Path(temporary).iterdir()):
            _move(file, output / file.name)


def _check_place(output: Path) -> None:
    if output.exists() and not output.is_dir():
        raise ValueError(f"{output}: expected a folder for the results, got a file.")
    place = _beside(output)
    if not place.is_dir() or not os.access(place, os.W_OK):
        raise ValueError(f"{output}: cannot be written to.")


def _beside(output: Path) -> Path:
    """Give the output itself if it is there, else the nearest folder above that is."""
    return next(p for p in (output.absolute(), *output.absolute().parents) if p.exists())


def _move(file: Path, target: Path) -> None:
    try:
        os.replace(file, target)
    except OSError:  # another file system, or a folder of that name
        shutil.copy(file, target)
