"""Progress on stderr, interrupted by signals."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console

from sklearn_pgnn.cli.signals import check
from sklearn_pgnn.progress_display import Show, shown_progress


@contextmanager
def show_progress(quiet: bool) -> Iterator[Show]:
    """Show the progress on stderr, unless quiet; every step checks for signals."""
    if quiet:
        yield lambda *_: check()
    else:
        with shown_progress(Console(stderr=True)) as show:
            yield _checked(show)


def _checked(show: Show) -> Show:
    def progress(*step) -> None:
        check()
        show(*step)

    return progress
