"""Source code and machine code of models, kept on disk: what was written once is not written again.

A file is named by a hash of all that its content depends on: what is asked for, the processor, the
code that writes it and the libraries that this code calls. Machine code is run, so a file counts
only where the user alone can have written it: the user owns it, nobody else may write it, and it
begins with a hash of its name and its content. Where anything is amiss it is as if there were none.

The folder holds at most `MOST` bytes: what has not been read for longest goes.

Where compiled code is kept: this package's own, and numba's where numba finds no place for it.

It is the folder of the environment variable ``SKLEARN_PGNN_CACHE_DIR``, nothing being kept where
that is empty; else a folder in numba's ``NUMBA_CACHE_DIR``, else the user's for such files. A user
without a home, such as that of a service or a container, has a private folder among the temporary
files: no home is made.
"""

import hashlib
import os
import stat
import tempfile
from contextlib import suppress
from functools import cache
from itertools import count
from pathlib import Path
from uuid import uuid4

import llvmlite
import numba
import sympy
from numba.core.caching import FunctionCache
from numba.misc.appdirs import AppDirs

from sklearn_pgnn.whole_file import PRIVATE, write_whole

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
    """Return whether numba has a folder for its files, which it is given where it finds none."""
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


#: most bytes that are kept, and how many files are written until they are counted again
MOST, COUNTED_EVERY = 100_000_000, 500
#: the code that writes what is kept, in this folder
_WRITERS = (
    "../physics/dry_friction.py",
    "disk_cache.py",
    "linearly_implicit.py",
    "machine_code.py",
    "model_function.py",
    "reactions.py",
    "source.py",
    "straight_line.py",
)
_LIBRARIES = tuple(module.__version__ for module in (llvmlite, numba, sympy))
_HASH = hashlib.sha256().digest_size
_WRITTEN = count()


def key_of(*parts) -> str:
    """Return the name of what depends on parts, by ``repr``, this code and the libraries.

    >>> key_of("ab", "c") == key_of("ab", "c"), key_of("ab", "c") == key_of("a", "bc")
    (True, False)
    """
    return hashlib.sha256(repr((_writers(), *parts)).encode()).hexdigest()


@cache
def _writers() -> tuple[str, ...]:
    """Return what tells versions of the code and of the libraries apart."""
    code = hashlib.sha256()
    try:
        for name in _WRITERS:
            code.update((Path(__file__).parent / name).read_bytes())
    except OSError:  # packed into one file: nothing is found again
        return (uuid4().hex,)
    return (code.hexdigest(), *_LIBRARIES)


def load(key: str) -> bytes | None:
    """Return what is kept under a name; None where there is nothing that can be trusted."""
    where = folder()
    if where is None:
        return None
    try:
        whole = _read(where / key)
    except OSError:
        return None
    content = whole[_HASH:]
    return content if whole[:_HASH] == _seal(key, content) else None


def _read(path: Path) -> bytes:
    """Return the content of a file of the user's own, which is marked as read just now."""
    flags = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(path, "rb", opener=lambda name, _: os.open(name, flags)) as file:
        if not _is_own(os.fstat(file.fileno())):
            return b""
        with suppress(OSError):
            os.utime(path)
        return file.read()


def _is_own(status: os.stat_result) -> bool:
    """Return whether nobody but the user can have written a file."""
    if not stat.S_ISREG(status.st_mode):
        return False
    if not hasattr(os, "geteuid"):  # Windows: the folder is in the user's profile
        return True
    return status.st_uid == os.geteuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _seal(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode() + content).digest()


def keep(key: str, content: bytes) -> None:
    """Keep a content under a name; where that cannot be, nothing is kept."""
    where = folder()
    if where is None:
        return
    with suppress(OSError):
        where.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_whole(where / key, _seal(key, content) + content, PRIVATE)
        if next(_WRITTEN) % COUNTED_EVERY == 0:
            _make_room(where)


def _make_room(where: Path) -> None:
    """Remove the files that have not been read for longest, where all take too much."""
    with os.scandir(where) as entries:
        files = [(entry.stat(follow_symlinks=False), entry.path) for entry in entries]
    left = sum(status.st_size for status, _ in files)
    for status, path in sorted(files, key=lambda file: file[0].st_mtime):
        if left <= MOST:
            return
        with suppress(OSError):
            os.unlink(path)
            left -= status.st_size
