"""Records: tables and files read as trajectories, and their smoothing."""

from sklearn_pgnn.trajectories.files import read_file, read_files
from sklearn_pgnn.trajectories.reader import read_records, rows_in_order, split_rows
from sklearn_pgnn.trajectories.record import Record

__all__ = [
    "Record",
    "read_file",
    "read_files",
    "read_records",
    "rows_in_order",
    "split_rows",
]
