"""Checks of every request: its host, its origin, and what a browser may do."""

from collections.abc import Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse

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


class Guard:
    """Refuses requests for another host, and changes that another page asks for.

    A foreign page may make a browser send requests here, or have its own host name resolve to this
    server; it can change neither the host nor the origin that the browser states.

    Parameters
    ----------
    app : ASGI application
        Application that answers all other requests.
    hosts : iterable of str
        Permitted names of the server, with its port.
    """

    def __init__(self, app, hosts: Iterable[str]):
        self.app, self.hosts = app, frozenset(hosts)

    async def __call__(self, scope, receive, send) -> None:
        """Answer a request."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        refused = self.refused(scope)
        answer = self.app if refused is None else PlainTextResponse(*refused)
        await answer(scope, receive, _with_headers(send))

    def refused(self, scope) -> tuple[str, int] | None:
        """Return the reason for refusing a request, with the status; None if it is accepted."""
        if scope["type"] != "http":
            return "expected a request of a page.", 400
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if host not in self.hosts:
            return f"expected the host {' or '.join(sorted(self.hosts))}.", 421
        if scope["method"] in SAFE:
            return None
        if headers.get("origin") != f"http://{host}":
            return "expected a request from the page itself.", 403
        if headers.get("sec-fetch-site", "same-origin") != "same-origin":
            return "expected a request from the page itself.", 403
        return None


def _with_headers(send):
    async def answer(message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return answer
