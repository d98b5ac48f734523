"""Where compiled code is kept: this package's own, and numba's where numba finds no place for it.

It is the folder of the environment variable ``SKLEARN_PGNN_CACHE_DIR``, nothing being kept where
that is empty; else a folder in numba's ``NUMBA_CACHE_DIR``, else the user's for such files. A user
without a home, such as that of a service or a container, has a private folder among the temporary
files: no home is made.
"""

import os
import stat
import tempfile
from pathlib import Path

import numba
from numba.core.caching import FunctionCache
from numba.misc.appdirs import AppDirs

HERE = Path(__file__).parent


def folder() -> Path | None:
    """Return the folder of what is kept; None where nothing is to be kept, or can be."""
    said = os.environ.get("SKLEARN_PGNN_CACHE_DIR")
    if said is not None:
        return Path(said).absolute() if said else None
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR).absolute() / "sklearn_pgnn"
    return _of_user() or _temporary()


def _of_user() -> Path | None:
    """Return the folder in the user's home; None without a home that can be written."""
    found = Path(AppDirs("sklearn_pgnn", appauthor=False).user_cache_dir)
    if not found.is_absolute():
        return None
    home = found.parents[1]  # ~/.cache/sklearn_pgnn
    there = next((place for place in (found, found.parent, home) if place.is_dir()), None)
    return found if there and os.access(there, os.W_OK) else None


def _temporary() -> Path | None:
    """Return a temporary folder that no other user can have made, or write to."""
    who = os.geteuid() if hasattr(os, "geteuid") else "own"
    try:
        place = Path(tempfile.gettempdir(), f"sklearn_pgnn_{who}")
        place.mkdir(mode=0o700, exist_ok=True)
        status = place.lstat()
    except OSError:
        return None
    return place if _is_private(status) else None


def _is_private(status: os.stat_result) -> bool:
    if not stat.S_ISDIR(status.st_mode):
        return False
    if not hasattr(os, "geteuid"):  # Windows: the folder is in the user's profile
        return True
    return status.st_uid == os.geteuid() and not status.st_mode & 0o077


def numba_caches() -> bool:
    """Return whether numba has a folder for its files, which it is given where it finds none.

    Beside the code and in the user's home numba finds its own; asked to keep files where there is
    no folder, it refuses to compile.
    """
    if not (numba.config.CACHE_DIR or os.access(HERE, os.W_OK) or _of_user()):
        own = folder()
        if own is None:
            return False
        numba.config.CACHE_DIR = str(own)
    try:
        FunctionCache(numba_caches)
    except RuntimeError:
        return False
    return True
