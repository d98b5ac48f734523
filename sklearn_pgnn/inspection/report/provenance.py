"""Where a diagnosis comes from: its files, the command, the day, the method, the versions."""

import hashlib
import platform
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from os import PathLike, fspath
from pathlib import Path

from sklearn_pgnn.inspection.numbers import number, percent
from sklearn_pgnn.physics.channel_kinds import in_words

LIBRARIES = ("numpy", "scipy", "sympy", "numba", "scikit-learn")


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


def method(diagnosis) -> str:
    """Return how it was done."""
    records, window = diagnosis.records_, diagnosis.window_
    count, samples = len(records.names), records.windows.t.size
    length, model = f"{number(window, 3)} s", diagnosis.model
    hold = "held" if diagnosis.hold_ == "zoh" else "linearly interpolated"
    channels = ""
    if model.channels:
        channels = f" Only faults that the channels can have were tried: {in_words(model)}."
    return (
        f"{samples} samples in {count} {'record' if count == 1 else 'records'} were cut into "
        f"{len(records.windows)} windows of about {length}, each with an initial state of "
        f"its own. Every candidate was fitted together with the model's free parameters and these "
        f"initial states. A cause is named only if a likelihood ratio on windows its parameters "
        f"were not fitted to supports it, at a false-alarm rate of {diagnosis.alpha:g}; if it "
        f"explains {percent(diagnosis.smallest_share)} of an output's error or more; and if the "
        f"free run does not contradict it. Inputs: {hold} between samples; "
        f"integration steps from sample to sample: {diagnosis.substeps_}. "
        f"Intervals are 95 % intervals, robust to residuals that are not white. The noise of an "
        f"output is the white part of what the extended model leaves of it over windows."
        f"{channels}"
    )


def versions() -> str:
    """Return the versions of the package, of Python and of its main dependencies."""
    package = import_module(__name__.split(".")[0])
    used = ", ".join(f"{name} {_version(name)}" for name in LIBRARIES)
    return f"sklearn-pgnn {package.__version__} (Python {platform.python_version()}, {used})"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "of unknown version"
