"""A program that runs as if some libraries were not installed."""

import os
import subprocess
import sys
from pathlib import Path

import sklearn_pgnn

PACKAGES = Path(sklearn_pgnn.__file__).parents[1]

BLOCKED = """
import sys
from importlib.machinery import PathFinder

class Without:
    def find_spec(name, path=None, target=None):
        return None if name in {libraries} else PathFinder.find_spec(name, path, target)

sys.meta_path = [Without if finder is PathFinder else finder for finder in sys.meta_path]
"""


def run_without(libraries, program, folder, *first):
    """Run a program in a folder; return its result.

    Python finds no module of the name of a library, and looks in the folders `first` before others.
    """
    path = os.pathsep.join(map(str, (*first, PACKAGES)))
    return subprocess.run(
        [sys.executable, "-c", BLOCKED.format(libraries=sorted(libraries)) + program],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": path},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=600,
    )
