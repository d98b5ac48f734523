"""Files of measured samples by file extension: CSV, MAT, Parquet, Excel, MDF and ROS bags."""

import os
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.channel_logs import BagLog, MdfLog, is_bag_folder
from sklearn_pgnn.trajectories.channels import ChannelLog, join_channels
from sklearn_pgnn.trajectories.csv_file import open_csv
from sklearn_pgnn.trajectories.excel_file import open_excel
from sklearn_pgnn.trajectories.file_table import FileTable
from sklearn_pgnn.trajectories.file_text import check_regular
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.several_files import read_each
from sklearn_pgnn.trajectories.shown import LISTED, cut

#: possible offsets of the signature in MAT files of version 7.3, and the signature
_HDF5, _STARTS = b"\x89HDF\r\n\x1a\n", (0, 512, 1024, 2048)
#: longest vector in a cell whose elements are columns
VECTOR = 100
#: MATLAB tables are opaque objects, which no library reads
_AS_STRUCT = (
    "Remedy: in MATLAB, s = table2struct(data, 'ToScalar', true) of a table, or vectors of a "
    "timeseries, and save('run.mat', '-struct', 's')."
)


def read_file(
    path: FilePath, model: PhysicsModel, sample_time: float | None = None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    r"""Read a file of measured samples as the X and y of a model, by its file extension.

    ``.mat`` holds vectors of equal length, in separate variables or in a struct; versions up to
    7 need no further library, 7.3 needs h5py, and so does ``.h5`` with its groups. ``.tdms`` needs
    nptdms, and has channels in groups, with the time of their waveform. ``.parquet`` needs pyarrow;
    a column ``state`` of vectors, as of LeRobot, is ``state/0``, ``state/1`` and so on. ``.xlsx``
    holds header and samples on one of its sheets, and needs openpyxl. All of these come with
    ``pip install "sklearn-pgnn[files]"``. ``.mf4`` and ``.mdf`` (extra ``mdf``), and ROS bags
    (extra ``ros``), a ``.bag``, ``.mcap`` or ``.db3`` or the folder of ROS 2, hold channels with
    separate clocks: there is a row wherever an output was measured, with NaN in the other outputs,
    and inputs have their mean until the next row. Any other file is read as CSV: the separator is
    that with which the header names most of the model's columns, headers may carry units, decimals
    points or commas, and the time is in seconds, dates or times of day; see :ref:`files`.

    Parameters
    ----------
    path : str or path-like
        The file.
    model : PhysicsModel
        Defines the columns; its `columns` give their names in the file (``/topic/field`` for a
        number in a bag), and the unit where the file does not: ``/joints/position/0 [deg]``.
    sample_time : float, optional
        Sample interval [s] of a file without a time; it overrides the time of one that has it.
        Channels with separate clocks are resampled to it by linear interpolation.

    Returns
    -------
    X : DataFrame
        ``trajectory`` (by default the file's stem), ``t``, the inputs, and the states that the
        file has, under the model's own names.
    y : DataFrame
        The outputs under the model's own names, NaN where there is no value.

    Raises
    ------
    RecordError
        If the file cannot be read or is not a valid record: ``FILE, row N: what``.
    ModuleNotFoundError
        If the library that reads the file is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from scipy.io import savemat
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.mat")
    ...     savemat(path, {"u": [1.5, 1.5, 1.5, 1.5], "y": [0.0, 0.6, 0.9, 1.2]})
    ...     X, y = read_file(path, lag, sample_time=0.5)
    >>> X["t"].tolist()
    [0.0, 0.5, 1.0, 1.5]
    """
    return open_file(path, model, sample_time).read()


def open_file(path: FilePath, model: PhysicsModel, sample_time: float | None = None) -> FileTable:
    """Open a file of measured samples, by its file extension, to inspect its content."""
    path = os.fspath(path)
    log = _LOGS.get(".bag" if is_bag_folder(path) else Path(path).suffix.lower())
    if log is not None:
        expected, opened = log
        return _ChannelTable(opened(path), model, sample_time, expected)
    ending = Path(path).suffix.lower()
    if ending in (".xlsx", ".xlsm"):
        return open_excel(path, model, sample_time)
    if ending not in _KINDS:
        return open_csv(path, model, sample_time)
    name, load, offset = _KINDS[ending]
    return _FrameTable(path, model, sample_time, name, load(path, model), offset)


def read_files(
    paths: Iterable, model: PhysicsModel, sample_time: float | None = None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    r"""Read several files as one X and y; every file is at least one trajectory.

    A file ``conditions.csv`` among them, or of another kind, is no record, but a table of inputs
    that are the same all through a record: its first column names files, or folders of files.

    Parameters
    ----------
    paths : iterable of str or path-like
        The files, of any kind that `read_file` reads.
    model : PhysicsModel
        Defines the columns; its `columns` give their names in the files.
    sample_time : float, optional
        Sample interval [s] of files without a time; it overrides the time of those that have it.

    Returns
    -------
    X : DataFrame
        As returned by `read_file`; ``trajectory`` holds the file's stem, made unique.
    y : DataFrame
        The outputs.

    Raises
    ------
    RecordError
        As raised by `read_file`, or if there is no file.
    ModuleNotFoundError
        If the library that reads a file is not installed.

    Examples
    --------
    >>> import tempfile
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.csv")
    ...     _ = path.write_text("y\n1\n0.6\n0.4\n0.2\n")
    ...     X, y = read_files([path, path], lag, sample_time=0.5)
    >>> X["trajectory"].unique().tolist()
    ['run', 'run-2']
    """
    return read_each(open_file, paths, model, sample_time)


class _FrameTable(FileTable):
    """A file with typed columns."""

    def __init__(
        self,
        path: str,
        model: PhysicsModel,
        sample_time: float | None,
        kind: str,
        frame: pd.DataFrame,
        offset: int,
    ):
        super().__init__(path, model, sample_time)
        self.kind, self.frame, self.offset = f"{kind} file", frame, offset
        self.header = [str(name).strip() for name in frame.columns]

    @property
    def size(self) -> int:
        """Number of samples."""
        return len(self.frame)

    def place(self, row: int | None) -> str:
        """Return the row number, counted as in the file's own program."""
        return "" if row is None else f", {self.name_of(row)}"

    def name_of(self, row: int) -> str:
        """Return the row."""
        return f"row {self.frame.index[row] + self.offset}"

    def cells(self, k: int) -> list[Any]:
        """Return the values of a column."""
        return self.frame.iloc[:, k].tolist()

    def read_dates(self, k: int) -> pd.Series | None:
        """Return a column of dates or time differences."""
        column = self.frame.iloc[:, k].reset_index(drop=True)
        return column if column.dtype.kind in "mM" else super().read_dates(k)


class _ChannelTable(_FrameTable):
    """A log of channels with separate clocks, of which only those the model needs are read."""

    def __init__(self, log: ChannelLog, model: PhysicsModel, sample_time: float | None, kind: str):
        titles = _loaded(log.path, kind, lambda: log.titles)
        super().__init__(log.path, model, sample_time, "", pd.DataFrame(columns=titles), 0)
        self.log, self.expected, self.kind = log, kind, kind.split(" ", 1)[1]
        own = {self.find(name) for name in (TIME, TRAJECTORY)}
        self.header = [title for k, title in enumerate(self.header) if k not in own]
        self.header.insert(0, model.columns.get(TIME, TIME))

    @cached_property
    def joined(self) -> pd.DataFrame:
        """The channels that the model needs, in one table."""
        model = self.model
        measured = [name for name in model.outputs if self.find(name) is not None]
        inputs = self._titles(name for name in model.inputs if not self.knows(name))
        outputs = self._titles(measured or [] if inputs else model.outputs)
        known = [name for name in model.states if self.find(name) is not None]
        states = [title for title in self._titles(known) if title not in (*inputs, *outputs)]
        found = _loaded(
            self.path, self.expected, partial(self.log.load, [*inputs, *states, *outputs])
        )
        parts = ({title: found[title] for title in part} for part in (inputs, states, outputs))
        hold = model.simulation.get("hold", "zoh")
        return join_channels(self.path, *parts, hold=hold, sample_time=self.sample_time)

    def _titles(self, names: Iterable[str]) -> list[str]:
        return [self.header[k] for k in dict.fromkeys(self.column(name) for name in names)]

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.joined)

    def name_of(self, row: int) -> str:
        """Return the time of a row."""
        return f"at {self.joined[TIME].iloc[row]:.9g} s"

    def cells(self, k: int) -> list[Any]:
        """Return the values of a channel."""
        return self.joined[self.header[k] if k else TIME].tolist()

    def times(self, names: list[str]) -> np.ndarray:
        """Return the clock that all channels share."""
        return self.joined[TIME].to_numpy()

    def read_dates(self, k: int) -> None:
        """Return None: the clocks of channels count seconds."""


# -- files -----------------------------------------------------------------------------------------


def _loaded(path: str, kind: str, load: Callable[[], Any]) -> Any:
    """Load a file, or raise `RecordError` for any error that a library raises on a broken file."""
    try:
        if not is_bag_folder(path):
            check_regular(path, kind)
            Path(path).open("rb").close()
        return load()
    except (ModuleNotFoundError, RecordError):
        raise
    except OSError as error:
        why = error.strerror or str(error)
    except Exception as error:
        why = str(error) or type(error).__name__
    said = cut(" ".join(why.split()), LISTED)
    raise RecordError(f"{path}: expected {kind}, got: {said}.") from None


def _load_parquet(path: str, model: PhysicsModel) -> pd.DataFrame:
    with needed_by("Reading a Parquet file"):
        import pyarrow  # noqa: F401
    frame = _loaded(path, "a Parquet file", partial(pd.read_parquet, path, engine="pyarrow"))
    if isinstance(frame.index, pd.DatetimeIndex | pd.TimedeltaIndex) and TIME not in frame:
        frame.insert(0, TIME, frame.index)
    return _with_lists_apart(frame.reset_index(drop=True))


def _with_lists_apart(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table in which a column ``q`` of vectors is columns ``q/0``, ``q/1`` and so on."""
    vectors: dict[Hashable, pd.DataFrame] = {}
    for name, column in frame.items():
        cells = column.tolist() if column.dtype == object else []
        sizes = {len(cell) if isinstance(cell, np.ndarray | list) else 0 for cell in cells}
        if len(sizes) == 1 and 0 < max(sizes) <= VECTOR:
            vectors[name] = pd.DataFrame(np.stack(cells)).add_prefix(f"{name}/")
    if not vectors:
        return frame
    return pd.concat([vectors.get(name, column) for name, column in frame.items()], axis=1)


def _load_nested(
    kind: str, content: Callable[[str], Mapping], path: str, model: PhysicsModel
) -> pd.DataFrame:
    """Return the vectors of a file that are as long as the time, and its matrices' columns."""
    found = _leaves(_loaded(path, kind, partial(content, path)))
    vectors = {name: values for name, values in found.items() if values.ndim == 1}
    vectors = {**_matrix_columns(found), **vectors}
    if not vectors:
        remedy = f" {_AS_STRUCT}" if "MAT" in kind else ""
        raise RecordError(f"{path}: expected vectors of samples, got none.{remedy}")
    wanted = [TIME, TRAJECTORY, *model.inputs, *model.states, *(model.outputs or ())]
    called = [model.columns.get(name, name) for name in wanted]
    time = vectors.get(called[0])
    sizes = Counter(values.size for values in vectors.values())
    size = sizes.most_common(1)[0][0] if time is None else time.size
    for name in called:
        if name in found and found[name].shape != (size,):
            raise RecordError(
                f"{path}: variable {name!r}: expected a vector of {size} samples, got an array of "
                f"shape {found[name].shape}. Remedy: save every quantity as a vector of its own, "
                f"all of one length."
            )
    return pd.DataFrame({name: values for name, values in vectors.items() if values.size == size})


def _matrix_columns(found: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return matrix columns as ``data_1`` and so on; samples are the longer dimension."""
    matrices = {name: values for name, values in found.items() if values.ndim == 2}
    return {
        f"{name}_{k}": column
        for name, values in matrices.items()
        for k, column in enumerate(values.T if len(values) > values.shape[1] else values, start=1)
    }


def _nested_content(path: str) -> Mapping:
    """Return the content of a MAT file, or of any HDF5 file."""
    from scipy.io import loadmat

    if not _is_hdf5(path):
        return loadmat(path, simplify_cells=True)
    with needed_by("Reading an HDF5 file, or a MAT file of version 7.3,"):
        import h5py
    with h5py.File(path, "r") as file:
        return _hdf5_content(file)


def _tdms_content(path: str) -> Mapping:
    """Return the channels of a TDMS file by group; the time of a waveform where none is stored."""
    with needed_by("Reading a TDMS file"):
        from nptdms import TdmsFile
    groups = TdmsFile.read(path).groups()
    content = {group.name: {c.name: c[:] for c in group.channels()} for group in groups}
    waves = [c for group in groups for c in group.channels() if "wf_increment" in c.properties]
    return {TIME: waves[0].time_track(), **content} if waves else content


def _is_hdf5(path: str) -> bool:
    with open(path, "rb") as file:
        head = file.read(_STARTS[-1] + len(_HDF5))
    return any(head[start:].startswith(_HDF5) for start in _STARTS)


def _hdf5_content(group: Mapping[str, Any]) -> dict:
    """Return variables and structs; MATLAB's internal groups begin with ``#``."""
    content = {}
    for name, item in group.items():
        if hasattr(item, "items"):
            content[name] = {} if name.startswith("#") else _hdf5_content(item)
        else:
            content[name] = np.squeeze(item[()])
    return content


def _leaves(content: Mapping, path: str = "") -> dict[str, np.ndarray]:
    """Return the numbers of nested structs by their own names, or by path where names repeat."""
    found: list[tuple[str, str, np.ndarray]] = []

    def walk(part: Mapping, path: str) -> None:
        for name, item in part.items():
            if isinstance(item, Mapping):
                walk(item, f"{path}{name}.")
            elif not name.startswith("__") and np.asarray(item).dtype.kind in "biuf":
                found.append((name, path + name, np.asarray(item)))

    walk(content, path)
    shared = Counter(name for name, _, _ in found)
    return {name if shared[name] == 1 else full: values for name, full, values in found}


#: by file extension: kind of channel log, and its reader
_LOGS: dict[str, tuple[str, type[ChannelLog]]] = {
    ".bag": ("a ROS bag", BagLog),
    ".db3": ("a ROS bag", BagLog),
    ".mcap": ("a ROS bag", BagLog),
    ".mdf": ("an MDF file", MdfLog),
    ".mf4": ("an MDF file", MdfLog),
}
#: by file extension: name of the format, its reader, and the number of the first sample
_KINDS: dict[str, tuple[str, Callable[..., pd.DataFrame], int]] = {
    ".h5": ("HDF5", partial(_load_nested, "an HDF5 file", _nested_content), 0),
    ".hdf5": ("HDF5", partial(_load_nested, "an HDF5 file", _nested_content), 0),
    ".mat": ("MAT", partial(_load_nested, "a MAT file", _nested_content), 1),
    ".parquet": ("Parquet", _load_parquet, 0),
    ".pq": ("Parquet", _load_parquet, 0),
    ".tdms": ("TDMS", partial(_load_nested, "a TDMS file", _tdms_content), 0),
}
