"""The page's process: takes commands as lines of JSON, answers with steps and a result.

Its input closes when the server ends; then it ends, whatever it is doing.
"""

import json
import os
import queue
import sys
import threading
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import TextIO

from sklearn_pgnn.cli.app.jobs import JOBS
from sklearn_pgnn.cli.app.work import MEMORY, NO_MEMORY
from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.exceptions import UNUSABLE

#: least time between two reported steps of a stage [s]
EVERY = 0.1


class Answers:
    """Writes answers, a line each."""

    def __init__(self, stream: TextIO):
        self.stream = stream
        self._stage, self._last = "", 0.0

    def write(self, answer: dict) -> None:
        """Write an answer."""
        self.stream.write(json.dumps(answer) + "\n")
        self.stream.flush()

    def progress(self, stage: str, done: int = 0, total: int = 1) -> None:
        """Write a step, unless one of the same stage was just written."""
        now = monotonic()
        if stage != self._stage or now - self._last >= EVERY:
            self._stage, self._last = stage, now
            self.write({"stage": stage, "step": done, "steps": total})


def answer(command: dict, answers: Answers, jobs: dict[str, Callable] = JOBS) -> None:
    """Execute a command, and write the result."""
    name = command.pop("do")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            done = jobs[name](answers.progress, **command)
    except MemoryError:
        answers.write({"refused": NO_MEMORY})
    except (*UNUSABLE, ModuleNotFoundError) as error:
        answers.write({"refused": one_line(error)})
    except Exception as error:
        traceback.print_exception(error)
        said = f"A bug in sklearn-pgnn, not in your input: {type(error).__name__}: {error}"
        answers.write({"refused": one_line(said)})
    else:
        answers.write({"done": done})


def main() -> None:
    """Answer commands until the input closes."""
    limit_memory()
    answers = Answers(os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8"))
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what others print is no answer
    commands: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_listen, args=(commands,), daemon=True).start()
    while True:
        answer(json.loads(commands.get()), answers)


def limit_memory(most: int = MEMORY) -> None:
    """Let this process, and those that it starts, have so much memory; no limit on Windows."""
    with suppress(ModuleNotFoundError):
        import resource

        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _listen(commands: queue.Queue) -> None:
    for line in sys.stdin:
        commands.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
