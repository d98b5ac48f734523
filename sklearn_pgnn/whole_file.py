"""Atomic writing of files: complete or not at all."""

import os
import stat
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

#: file permissions before the user's mask: for all, or for the user alone
USUAL, PRIVATE = 0o666, 0o600


def is_stream(path: str | os.PathLike) -> bool:
    """Return whether a path leads to a pipe or a device, which may have no end.

    Raises
    ------
    OSError
        If there is nothing.
    """
    mode = os.stat(path).st_mode
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def write_whole(path: Path, content: str | bytes, mode: int = USUAL) -> None:
    """Write a temporary file next to the target, and move it into place in one step.

    Parameters
    ----------
    path : Path
        Target; an existing file is replaced.
    content : str or bytes
        Content; a text is written as UTF-8 with its line endings unchanged.
    mode : int, default=0o666
        Permissions, reduced by the user's mask.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_whole(Path(folder, "note.txt"), "read me")
    ...     os.listdir(folder)
    ['note.txt']
    """
    data = content.encode() if isinstance(content, str) else content
    temporary = path.with_name(f".{path.name}.{uuid4().hex[:12]}")
    try:
        with open(temporary, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            file.write(data)
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
