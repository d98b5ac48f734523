"""Records: tables and files read as trajectories, and their smoothing."""

from sklearn_pgnn.trajectories.files import read_file, read_files
from sklearn_pgnn.trajectories.reader import read_records

__all__ = ["read_file", "read_files", "read_records"]
