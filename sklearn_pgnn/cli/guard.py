"""How a command runs: its progress, and errors in one line: unusable input, or a bug."""

import errno
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import click
from rich.console import Console

from sklearn_pgnn.cli.ending import check, stoppable
from sklearn_pgnn.cli.options import PROGRAM
from sklearn_pgnn.exceptions import UNUSABLE, code_of
from sklearn_pgnn.extras import EXTRA_OF
from sklearn_pgnn.progress_display import Show, shown_progress

#: characters of a file's name that an error shows, and of a line of text
SHOWN, LONGEST = 200, 2000


class Unusable(click.ClickException):
    """Input that cannot be used: one line on stderr."""

    exit_code = 2


class Bug(click.ClickException):
    """A bug of the package: one line on stderr, with what is kept in spite of it, if anything."""

    exit_code = 1

    def __init__(self, error: Exception, kept: str = ""):
        said = f"{type(error).__name__}: {error}".rstrip(". :")
        sentences = (
            f"a bug in sklearn-pgnn, not in your input: {said}.",
            kept,
            "Please report it, with what --debug shows.",
        )
        self.exit_code = 3 if kept else 1  # type: ignore[misc]
        super().__init__(one_line(" ".join(filter(None, sentences))))


def one_line(text: object) -> str:
    r"""Return a text on one line, without control characters, without the middle if it is long.

    >>> one_line("two\nlines \x1b[31m")
    'two lines ?[31m'
    """
    line = "".join(c if c.isprintable() else "?" for c in " ".join(str(text).split()))
    half = LONGEST // 2
    return line if len(line) <= LONGEST else f"{line[:half]} ... {line[-half:]}"


@contextmanager
def guarded(debug: bool) -> Iterator[None]:
    """Turn errors into one line and an exit code, and signals into an orderly end."""
    with stoppable():
        try:
            yield
        except Exception as error:
            gone = isinstance(error, OSError) and error.errno == errno.EPIPE  # as of ``| head``
            if gone or isinstance(error, click.exceptions.Exit | click.Abort):
                raise  # click handles them
            if debug:
                click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
            raise _told(error) from None


@contextmanager
def writing(what: object) -> Iterator[None]:
    """Turn errors of the file system into `Unusable`."""
    try:
        yield
    except OSError as error:
        raise Unusable(one_line(f"{what}: {error.strerror or error}.")) from error


def _told(error: Exception) -> Exception:
    if isinstance(error, click.ClickException):
        return error
    if isinstance(error, OSError) and error.errno is not None:
        name = "output" if error.filename is None else str(error.filename)  # else a stream
        name = name if len(name) <= SHOWN else f"{name[:SHOWN]} ..."
        return Unusable(one_line(f"{name}: {error.strerror}."))
    if isinstance(error, MemoryError):
        return Unusable("expected input that fits into memory, got more. Remedy: fewer records.")
    lacks = isinstance(error, ModuleNotFoundError) and error.name in EXTRA_OF
    if isinstance(error, UNUSABLE):
        code = code_of(type(error))
        return Unusable(one_line(f"{error} (see: {PROGRAM} explain {code})"))
    return Unusable(one_line(error)) if lacks else Bug(error)


@contextmanager
def show_progress(quiet: bool) -> Iterator[Show]:
    """Show the progress on stderr, unless quiet; every step checks for signals."""
    if quiet:
        yield lambda *_: check()
    else:
        with shown_progress(Console(stderr=True)) as show:

            def progress(*step: Any) -> None:
                check()
                show(*step)

            yield progress


def job(work: Callable[..., Callable[[], object] | None]) -> Callable[..., None]:
    """Make a command of what works with a progress, and returns what prints its result."""

    @wraps(work)
    def command(quiet: bool, debug: bool, **given: Any) -> None:
        with guarded(debug):
            with show_progress(quiet) as progress:
                progress("loading the libraries")
                show = work(progress, quiet=quiet, **given)
            if show is not None:
                show()

    return command
