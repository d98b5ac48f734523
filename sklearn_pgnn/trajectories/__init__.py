"""What a record is: tables and CSV files read as trajectories, and their smoothing."""

from sklearn_pgnn.trajectories.reader import read_records, rows_in_order, split_rows
from sklearn_pgnn.trajectories.record import Record

__all__ = ["Record", "read_records", "rows_in_order", "split_rows"]
