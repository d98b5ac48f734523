"""Files that are there whole or not at all."""

import os
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

#: who may read and write a file, before the user's mask: all, or the user alone
USUAL, PRIVATE = 0o666, 0o600


def write_whole(path: Path, content: str | bytes, mode: int = USUAL) -> None:
    """Write a file beside its place, and put it there in one step.

    Parameters
    ----------
    path : Path
        Where it goes; what is there is replaced.
    content : str or bytes
        What it holds; a text is written as UTF-8, its ends of line as they are.
    mode : int, default=0o666
        Permissions, of which the user's mask takes some.

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
