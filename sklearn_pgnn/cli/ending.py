"""How a command ends: signals with an orderly end, streams that take every text, no delay."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

import click

#: by name, because no system has all of them
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


class _Stop:
    """The signal received, and the number of blocks that defer it."""

    came = 0
    holders = 0


def check() -> None:
    """Raise `SystemExit` (128 + the signal's number) if a signal was received and not deferred."""
    if _Stop.came and not _Stop.holders:
        raise SystemExit(128 + _Stop.came)


@contextmanager
def held() -> Iterator[None]:
    """Defer signals until the block has ended."""
    _Stop.holders += 1
    try:
        yield
    finally:
        _Stop.holders -= 1
    check()


@contextmanager
def stoppable() -> Iterator[None]:
    """End the block in an orderly way on a signal; one that the caller ignores stays ignored."""
    before = _install()
    try:
        yield
        check()
    except SystemExit:
        if _Stop.came:
            click.echo(f"Stopped by {signal.Signals(_Stop.came).name}.", err=True)
        raise
    finally:
        _Stop.came = 0
        for number, handler in before.items():
            signal.signal(number, handler)


def _install() -> dict:
    """Install the handlers; only the main thread may."""
    if threading.current_thread() is not threading.main_thread():
        return {}

    def come(number: int, _frame: FrameType | None) -> None:
        _Stop.came = number
        check()

    heard = [n for n in _numbers() if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    return {number: signal.signal(number, come) for number in heard}


def _numbers() -> list[int]:
    return [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]


def take_any_text() -> None:
    """Replace characters that stdout cannot show, as on a terminal in ASCII, by question marks."""
    with suppress(AttributeError):  # not a stream of text
        sys.stdout.reconfigure(errors="replace")  # type: ignore[union-attr]


def open_closed_streams() -> None:
    """Let what was closed before the start (``>&-``) take everything, and no file its number."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


def run_to_the_end(command: Callable[[], object]) -> None:
    """Run a command; when it has ended nobody waits for workers, and a signal has no traceback."""
    code = 1
    open_closed_streams()
    try:
        command()
    except OSError as error:  # of what click writes
        code = 2
        sys.stderr.write(f"Error: output: {error.strerror}.\n")
        sys.exit(code)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
        raise
    finally:
        end_workers()
        try:
            sys.stdout.flush()
        except OSError:  # it was told, and is not told again at the end
            with suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        for number in _numbers():
            signal.signal(number, lambda *_: os._exit(code))


def end_workers() -> None:
    """End the processes of joblib that work for this one, whatever they do."""
    executors = sys.modules.get("joblib.externals.loky.reusable_executor")
    executor = getattr(executors, "_executor", None)
    if executor is not None:
        executor.shutdown(wait=True, kill_workers=True)
