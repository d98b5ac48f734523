"""Checks of every request: its secret, its host, its origin; and what a browser may do."""

import hmac
from collections.abc import Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
#: requests that change nothing
SAFE = ("GET", "HEAD")
#: the page without the secret
CLOSED = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>The address is not complete</title></head>
<body><h1>The address is not complete</h1>
<p>The address of the page has a secret in it, which keeps others out. It is printed in the terminal
in which <code>sklearn-pgnn app</code> was started: open that one, or start with
<code>--open</code>.</p></body></html>
"""


class Guard:
    """Passes on requests whose path begins with the secret, without it; refuses all others.

    Who has the secret has the session; nobody else can see or change anything. It is in the path,
    so that the addresses of the page itself, which are relative to it, keep it. A foreign page may
    make a browser send requests here, or have its own host name resolve to this server: it does not
    know the secret, and it can change neither the host nor the origin that the browser states.
    """

    def __init__(self, app: ASGIApp, hosts: Iterable[str], secret: str):
        self.app, self.hosts, self.secret = app, frozenset(hosts), secret

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        answer = self.refused(scope) or self.app
        opened = {**scope, "path": _inside(scope)[1]} if answer is self.app else scope
        await answer(opened, receive, _with_headers(send))

    def refused(self, scope: Scope) -> Response | None:
        """Return the answer to a request that is refused; None if it is accepted."""
        if scope["type"] != "http":
            return PlainTextResponse("expected a request of a page.", 400)
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if host not in self.hosts:
            return PlainTextResponse(f"expected the host {' or '.join(sorted(self.hosts))}.", 421)
        told, path = _inside(scope)
        if not hmac.compare_digest(told.encode(), self.secret.encode()) or not path:
            return HTMLResponse(CLOSED, 403)
        foreign = headers.get("sec-fetch-site", "same-origin") != "same-origin"
        if scope["method"] not in SAFE and (foreign or headers.get("origin") != f"http://{host}"):
            return PlainTextResponse("expected a request from the page itself.", 403)
        return None


def _inside(scope: Scope) -> tuple[str, str]:
    """Return the first part of a path, and the path behind it."""
    secret, slash, path = scope["path"].removeprefix("/").partition("/")
    return secret, slash + path


def _with_headers(send: Send) -> Send:
    async def answer(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return answer
