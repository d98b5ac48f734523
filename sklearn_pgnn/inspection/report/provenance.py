"""Where a diagnosis comes from: its files, the command, the day."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path


@dataclass(frozen=True)
class SourceFile:
    """A file that was read.

    Parameters
    ----------
    name : str
        Its path, as it was given.
    sha256 : str
        Hash of its bytes, in hexadecimal digits.

    Examples
    --------
    >>> from pathlib import Path
    >>> _ = Path("run.csv").write_text("t,force,position")
    >>> SourceFile.read("run.csv").sha256[:8]
    'c037ddee'
    """

    name: str
    sha256: str

    @classmethod
    def read(cls, path: str | PathLike) -> "SourceFile":
        """Return a file with the hash of what it holds now.

        Parameters
        ----------
        path : str or path-like
            The file.

        Returns
        -------
        SourceFile
            Its name and hash.

        Raises
        ------
        OSError
            If it cannot be read.
        """
        return cls(fspath(path), hashlib.sha256(Path(path).read_bytes()).hexdigest())


@dataclass(frozen=True)
class Provenance:
    """Where a diagnosis comes from, as its report states it.

    Parameters
    ----------
    model : SourceFile, optional
        The model file.
    data : tuple of SourceFile, default=()
        The files of the records.
    command : str, default=""
        The command that made the diagnosis.
    date : str, optional
        The day; by default that on which the report is written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.csv")
    ...     _ = path.write_text("t,y")
    ...     known = Provenance.of_files(None, [path], date="2026-11-22")
    >>> known.data[0].sha256[:12], known.date
    ('51edb69b8c8b', '2026-11-22')
    """

    model: SourceFile | None = None
    data: tuple[SourceFile, ...] = ()
    command: str = ""
    date: str | None = None

    @classmethod
    def of_files(
        cls,
        model: str | PathLike | None,
        data: Iterable[str | PathLike],
        command: str = "",
        date: str | None = None,
    ) -> "Provenance":
        """Return the provenance of a diagnosis that was read from files.

        Parameters
        ----------
        model : str or path-like or None
            The model file.
        data : iterable of str or path-like
            The files of the records.
        command, date : str, optional
            See `Provenance`.

        Returns
        -------
        Provenance
            With the hashes of what the files hold now.

        Raises
        ------
        OSError
            If a file cannot be read.
        """
        file = None if model is None else SourceFile.read(model)
        return cls(file, tuple(map(SourceFile.read, data)), command, date)
