"""Ctrl-C and SIGTERM: the work ends with cleanup, and the exit code gives the reason.

A handler raises `SystemExit`, so every ``with`` and ``finally`` on the way is executed. If Python
swallows the exception of a handler (in a finaliser, say), the next `check` raises it again.
"""

import signal
import threading
from contextlib import contextmanager

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
def held():
    """Defer signals until the block has ended."""
    _Stop.holders += 1
    try:
        yield
    finally:
        _Stop.holders -= 1
    check()


@contextmanager
def stoppable():
    """End the block in an orderly way on a signal.

    A signal that the caller ignores, as ``nohup`` does, stays ignored.
    """
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
    numbers = [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]
    heard = [n for n in numbers if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    return {number: signal.signal(number, _come) for number in heard}


def _come(number, _frame) -> None:
    _Stop.came = number
    check()
