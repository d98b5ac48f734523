"""Atomic writing of files: complete or not at all, and nothing is left of what was killed.

What is being written is under a name of its own, locked by the process that writes it. The lock
ends with the process, however it ends: what begins with such a name and has no lock is a leftover.
"""

import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from time import time
from uuid import uuid4

#: file permissions before the user's mask: for all, or for the user alone
USUAL, PRIVATE = 0o666, 0o600
#: beginning of the names of what is being written, and age from which it may be a leftover [s]
UNFINISHED, YOUNG = ".sklearn_pgnn_", 60.0


def is_stream(path: str | os.PathLike) -> bool:
    """Return whether a path leads to a pipe or a device, which may have no end."""
    mode = os.stat(path).st_mode
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def write_whole(path: Path, content: str | bytes, mode: int = USUAL) -> None:
    """Write a temporary file next to the target, and move it into place in one step.

    A text is written as UTF-8, its line endings unchanged; `mode` is reduced by the user's mask.
    """
    data = content.encode(errors="replace") if isinstance(content, str) else content
    temporary = path.with_name(f"{UNFINISHED}{uuid4().hex[:12]}")
    try:
        with open(temporary, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            with suppress(OSError):  # a file system without locks
                _lock(file.fileno())
            file.write(data)
            file.flush()
            if os.name != "nt":  # what is open cannot be moved there
                os.replace(temporary, path)
        if os.name == "nt":
            os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


class WorkingFolder:
    """A new folder for what is being written; leftovers of killed processes beside it are removed.

    Its name begins with `begin`; `path` is where it is.
    """

    def __init__(self, parent: Path, begin: str = UNFINISHED):
        remove_leftovers(parent, begin)
        self.path = Path(tempfile.mkdtemp(prefix=begin, dir=parent))
        self._held = _hold(self.path)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._held is not None:
            os.close(self._held)
            self._held = None


def remove_leftovers(parent: Path, begin: str = UNFINISHED) -> None:
    """Remove what killed processes of this user have left in a folder."""
    if not hasattr(os, "geteuid"):  # Windows: nothing tells whether its process is gone
        return
    with suppress(OSError):
        for path in parent.glob(f"{begin}*"):
            _remove_if_left(path)


def _remove_if_left(path: Path) -> None:
    """Remove a file or a folder that no living process holds."""
    with suppress(OSError):
        status = path.lstat()
        if status.st_uid != os.geteuid() or time() - status.st_mtime < YOUNG:
            return
        held = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            _lock(held)
            if stat.S_ISDIR(status.st_mode):
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()
        finally:
            os.close(held)


def _hold(folder: Path) -> int | None:
    """Return the descriptor that locks a folder until it is closed; None on Windows."""
    if os.name == "nt":
        return None
    descriptor = os.open(folder, os.O_RDONLY)
    with suppress(OSError):  # a file system without locks
        _lock(descriptor)
    return descriptor


def _lock(descriptor: int) -> None:
    """Lock what is open; raise `OSError` where another process has it locked."""
    with suppress(ModuleNotFoundError):  # Windows
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
