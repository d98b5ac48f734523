"""Verbose output of the estimators."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps

#: takes one line of text
PrintLine = Callable[[str], None]


def silence(*_) -> None:
    """Do nothing: the progress of a search without ``verbose``."""


def progress_printer(estimator) -> PrintLine:
    """Return a function that prints a line if the estimator is verbose, and else does nothing."""
    if not estimator.verbose:
        return silence
    name = type(estimator).__name__

    def print_line(text: str) -> None:
        print(f"[{name}] {text}", flush=True)

    return print_line


@contextmanager
def progress_display(estimator) -> Iterator[Callable[..., None]]:
    """Yield ``show(stage, done, total)``: if verbose, a bar in a terminal, else lines."""
    if not estimator.verbose:
        yield silence
        return
    from rich.console import Console

    from sklearn_pgnn.progress_display import shown_progress

    with shown_progress(Console(), type(estimator).__name__) as show:
        yield show


def with_progress(method):
    """Decorate a method: ``self._show`` reports its stages to a display and ``progress``."""

    @wraps(method)
    def shown(self, *args, **kwargs):
        with progress_display(self) as show:
            self._show = _both(show, getattr(self, "progress", None))
            try:
                return method(self, *args, **kwargs)
            finally:
                del self._show

    return shown


def _both(show, told):
    if show is silence or told is None:
        return told if show is silence else show

    def report(*step) -> None:
        show(*step)
        told(*step)

    return report
