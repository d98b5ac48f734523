"""Progress: on a terminal finished stages and a live line, elsewhere a line now and then.

The command line shows it, and estimators with ``verbose=1``. Imports nothing heavy, so that the
first output appears before the libraries are loaded.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, Task, TextColumn
from rich.text import Text

from sklearn_pgnn.stages import BEST, in_words

#: takes a stage, the number of steps done and of all
Show = Callable[..., None]
#: seconds between two lines of one stage where there is no terminal
EVERY = 5.0


@contextmanager
def shown_progress(console: Console, name: str = "") -> Iterator[Show]:
    """Show the progress on a console, in brackets after a name where lines are printed.

    Yields a function, to be called as ``progress(stage, done, total)``, or ``progress(stage)`` if
    nothing is counted; stages may recur.
    """
    prefix = f"[{name}] " if name else ""
    if console.is_terminal:
        with _bars(console) as bars:
            live = _Live(bars)
            yield _in_words(live)
            live.finish()
    else:

        def write(line: str) -> None:
            console.print(f"{prefix}{line}", highlight=False, markup=False, soft_wrap=True)

        yield _in_words(Lines(write))


def _in_words(show: Show) -> Show:
    """Put stages in words; a single step is not counted."""

    def progress(stage: str, done: int = 0, total: int | None = None) -> None:
        show(in_words(stage), done, None if total == 1 else total)

    return progress


def _bars(console: Console) -> Progress:
    began = monotonic()

    def elapsed(_task: Task) -> Text:
        minutes, seconds = divmod(int(monotonic() - began), 60)
        return Text(f"{minutes}:{seconds:02d}")

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[count]}"),
        _Column(elapsed),
    )
    return Progress(*columns, console=console, transient=True)


class _Column(TextColumn):
    """A column whose text is computed by a function."""

    def __init__(self, text: Callable):
        super().__init__("")
        self.text = text

    def render(self, task: Task) -> Text:
        """Return the text of a task."""
        return self.text(task)


class _Live:
    """Finished stages with their durations, and below them a line for the current one."""

    def __init__(self, bars: Progress, clock: Callable[[], float] = monotonic):
        self.bars, self.clock = bars, clock
        self.now: tuple | None = None
        self.began = clock()

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        if stage.startswith(BEST):
            self.bars.console.print(Text(f"{'':10}{stage}"))
            return
        if self.now is not None and self.now[0] != stage:
            self.finish()
        if self.now != (stage, total):
            self.now = stage, total
            for task in self.bars.task_ids:
                self.bars.remove_task(task)
            self.bars.add_task(stage, total=total, count="")
        if total is not None:
            self.bars.update(self.bars.task_ids[-1], completed=done, count=f"{done}/{total}")

    def finish(self) -> None:
        """Leave a line with the duration of the current stage."""
        if self.now is not None:
            now = self.clock()
            line = f"{now - self.began:6.1f} s  {self.now[0]}"
            self.bars.console.print(Text(line, style="dim"))
            self.began = now


class Lines:
    """A line when a stage begins, and every few seconds [s] of the clock while it goes on."""

    def __init__(self, write: Callable[[str], object], clock: Callable[[], float] = monotonic):
        self.write, self.clock = write, clock
        self.seen: set[str] = set()
        self.began, self.last = clock(), -math.inf

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        """Show a step, unless the last line is very recent."""
        now = self.clock()
        if stage.startswith(BEST):
            self.write(stage)
            return
        if stage in self.seen and now - self.last < EVERY:
            return
        self.seen.add(stage)
        self.last = now
        step = "" if total is None else f": {done} of {total}"
        since = int(now - self.began)
        self.write(f"{stage}{step}, {since} s ..." if since else f"{stage}{step} ...")
