"""The process that works for the page: commanded by lines of JSON, ended to cancel; its limits."""

import asyncio
import contextlib
import json
import os
import signal
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

#: largest model file and largest file of records [byte], and largest sum of them
MODEL_BYTES, RECORD_BYTES, ALL_BYTES = 1_000_000, 50_000_000, 200_000_000
#: largest other request [byte]
FORM_BYTES = 100_000
#: files of records
RECORDS = 50
#: most memory of the process that reads and diagnoses [byte]
MEMORY = 8_000_000_000
#: time after which what should take seconds is ended [s]
PATIENCE = 120.0
#: characters of a file's name that are kept
NAME = 80


MODULE = "sklearn_pgnn.cli.app.worker"
#: longest line that the process may answer [byte]
LINE = 4_000_000


#: why the process may have ended by itself
NO_MEMORY = (
    f"The work was ended, perhaps since it needed more than {MEMORY / 1e9:g} GB of memory. "
    f"Remedy: fewer or smaller files, or sklearn-pgnn diagnose."
)


class Refused(Exception):
    """A request that cannot be carried out, with the reason for the visitor."""


class Ended(Exception):
    """The process ended before it answered."""


class Worker:
    """A process that reads, simulates and diagnoses in a folder; it starts when it is asked."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._process: asyncio.subprocess.Process | None = None
        self._turn, self._beginning = asyncio.Lock(), asyncio.Lock()

    async def start(self) -> asyncio.subprocess.Process:
        """Return the process, started if there is none."""
        async with self._beginning:
            if self._process is None or self._process.returncode is not None:
                self._process = await asyncio.create_subprocess_exec(
                    sys.executable,
                    "-m",
                    MODULE,
                    cwd=self.folder,
                    env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                    stdin=asyncio.subprocess.PIPE,
                    stdout=asyncio.subprocess.PIPE,
                    limit=LINE,
                    start_new_session=True,
                )
            return self._process

    async def ask(self, command: Mapping, progress: Callable[[dict], object]) -> dict:
        """Send a command to the process and wait for its result."""
        async with self._turn:
            process = await self.start()
            assert process.stdin is not None
            assert process.stdout is not None
            with contextlib.suppress(ConnectionError):
                process.stdin.write(json.dumps(command).encode() + b"\n")
                await process.stdin.drain()
            while line := await process.stdout.readline():
                told = json.loads(line)
                if "refused" in told:
                    raise Refused(told["refused"])
                if "done" in told:
                    return told["done"]
                progress(told)
            await process.wait()
            raise Ended

    async def end(self) -> None:
        """End the process and all processes that it started."""
        async with self._beginning:  # one that is about to start is ended, too
            process, self._process = self._process, None
        if process is None or process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
        await process.wait()
