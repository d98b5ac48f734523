"""The command line as ``python -m sklearn_pgnn``."""

from sklearn_pgnn.cli import run

run()
