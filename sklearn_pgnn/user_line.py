"""Warnings that point to the line of the user's code that led to them."""

import os
import sys
import warnings
from types import FrameType

#: the folder of the package
HERE = os.path.dirname(os.path.abspath(__file__)) + os.sep
#: libraries that call the package back; a user's line is in none of them
BETWEEN = frozenset(
    {"concurrent", "contextlib", "functools", "joblib", "scipy", "skorch", "sklearn", "torch"}
)


def warn_user(message: str | Warning, category: type[Warning] = UserWarning) -> None:
    """Warn at the innermost line that is neither in the package nor in a library that calls it.

    It is what ``skip_file_prefixes`` of `warnings.warn` does since Python 3.12; the number of calls
    in between may change without an effect on the line.
    """
    warnings.warn(message, category, stacklevel=_level())


def _level() -> int:
    """Return the level of the user's line, that of the outermost where there is none."""
    level, frame = 1, sys._getframe(1)  # of `warn_user`
    while frame.f_back is not None and _is_between(frame):
        level, frame = level + 1, frame.f_back
    return level


def _is_between(frame: FrameType) -> bool:
    library = str(frame.f_globals.get("__name__")).partition(".")[0]
    return library in BETWEEN or frame.f_code.co_filename.startswith(HERE)
