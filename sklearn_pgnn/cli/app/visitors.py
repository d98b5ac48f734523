"""All visitors, each known by a cookie."""

import secrets
from time import monotonic

from sklearn_pgnn.cli.app.limits import IDLE, VISITORS
from sklearn_pgnn.cli.app.visitor import Visitor


class Full(Exception):
    """The number of visitors has reached its limit."""


class Visitors:
    """The current visitors."""

    def __init__(self) -> None:
        self._known: dict[str, Visitor] = {}

    def find(self, key: str) -> Visitor | None:
        """Return the visitor with a key, if there is one."""
        visitor = self._known.get(key)
        if visitor is not None:
            visitor.seen = monotonic()
        return visitor

    async def welcome(self) -> tuple[str, Visitor]:
        """Return a new visitor with the key.

        Raises
        ------
        Full
            If there are too many already, and all of them are at work.
        """
        await self._forget(IDLE)
        if len(self._known) >= VISITORS:
            await self._forget_oldest()
        key = secrets.token_urlsafe(32)
        self._known[key] = Visitor()
        return key, self._known[key]

    async def _forget(self, age: float) -> None:
        """Forget visitors that were idle for a given time [s] and have no work in progress."""
        now = monotonic()
        for key, visitor in list(self._known.items()):
            if visitor.running is None and now - visitor.seen > age:
                await self._known.pop(key).close()

    async def _forget_oldest(self) -> None:
        """Forget the visitor without model and records that was idle for longest."""
        empty = [k for k, v in self._known.items() if v.model is None and not v.records]
        if not empty:
            raise Full
        oldest = min(empty, key=lambda key: self._known[key].seen)
        await self._known.pop(oldest).close()

    async def close(self) -> None:
        """Forget all visitors."""
        for visitor in list(self._known.values()):
            await visitor.close()
        self._known.clear()
