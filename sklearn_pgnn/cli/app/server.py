"""The page's server: its responses, and the address on which it listens."""

import json
import secrets
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import uvicorn
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from sklearn_pgnn.cli.app.guard import Guard
from sklearn_pgnn.cli.app.page import (
    clean_mapping,
    clean_options,
    of_report,
    page,
    sections,
    source,
    style,
)
from sklearn_pgnn.cli.app.visitor import Visitor
from sklearn_pgnn.cli.app.work import ALL_BYTES, FORM_BYTES, MODEL_BYTES, RECORD_BYTES, Refused

ADDRESS = "127.0.0.1"
#: permissions of the report: those of its own policy, and none of this page
SANDBOX = "sandbox allow-scripts; frame-ancestors 'none'"
_HTML, _TEXT = "text/html; charset=utf-8", "text/plain; charset=utf-8"
SCRIPT = "text/javascript"

Change = Callable[[Visitor, Request], Awaitable[object]]
Endpoint = Callable[[Request], Awaitable[Response]]


class Server:
    """Answers the requests of the page at the address with the secret."""

    def __init__(self, hosts: Iterable[str], secret: str, folder: Path):
        self.visitor = Visitor(folder)
        self.app = Guard(Starlette(routes=self._routes(), lifespan=self._lifespan), hosts, secret)

    @asynccontextmanager
    async def _lifespan(self, _app: Starlette) -> AsyncIterator[None]:
        try:
            yield
        finally:
            await self.visitor.close()

    def _routes(self) -> list[Route]:
        return [
            Route("/favicon.ico", _fixed(Response(status_code=204))),
            Route("/style.css", _fixed(Response(style(), media_type="text/css"))),
            Route("/app.js", _fixed(Response(source("app.js"), media_type=SCRIPT))),
            Route("/zoom.js", _fixed(Response(of_report("zoom.js"), media_type=SCRIPT))),
            *(Route(path, self._seen(show)) for path, show in SHOWN.items()),
            *(Route(path, self._changing(do), methods=[m]) for (path, m), do in CHANGES.items()),
        ]

    def _seen(self, show: Callable[[Visitor, Request], Response]) -> Endpoint:
        """Return an endpoint that shows something of the session."""

        async def endpoint(request: Request) -> Response:
            return show(self.visitor, request)

        return endpoint

    def _changing(self, change: Change) -> Endpoint:
        """Return an endpoint that changes something of the session, and shows the result."""

        async def endpoint(request: Request) -> Response:
            try:
                await change(self.visitor, request)
            except TooLarge as error:
                return JSONResponse({"message": str(error)}, 413)
            except Refused as refused:
                return _state(self.visitor, str(refused), 400)
            except ClientDisconnect:
                return Response(status_code=400)
            return _state(self.visitor, "")

        return endpoint


def _fixed(response: Response) -> Endpoint:
    """Return an endpoint that always says the same."""

    async def endpoint(_request: Request) -> Response:
        return response

    return endpoint


# -- what is shown ---------------------------------------------------------------------------------


def _state(visitor: Visitor, message: str, status: int = 200) -> Response:
    shown = {"sections": sections(visitor), "busy": visitor.running is not None}
    return JSONResponse({"message": message, **shown}, status)


def _unknown() -> Response:
    return JSONResponse({"message": "There is no such file. Reload the page."}, 404)


def _model_file(visitor: Visitor, _request: Request) -> Response:
    if visitor.model is None:
        return _unknown()
    return _download(visitor.folder / "model.yaml")


def _result_file(visitor: Visitor, request: Request) -> Response:
    """Return a file of the result; only names in the list of its files are accepted."""
    wanted = request.path_params["name"]
    known = [name for name, _ in (visitor.result or {}).get("files", ()) if name == wanted]
    if not known:
        return _unknown()
    path = visitor.folder / "result" / known[0]
    if known[0] == "report.html" and "download" not in request.query_params:
        headers = {"Content-Security-Policy": SANDBOX}
        return Response(path.read_bytes(), headers=headers, media_type=_HTML)
    return _download(path)


def _download(path: Path) -> Response:
    name = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "_" for c in path.name)
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(path.read_bytes(), headers=headers, media_type=_TEXT)


def _everything(visitor: Visitor, _request: Request) -> Response:
    """Return the model, the records and the results in one archive."""
    packed = BytesIO()
    with ZipFile(packed, "w", ZIP_DEFLATED) as archive:
        for name, path in visitor.all_files().items():
            archive.write(path, name)
    headers = {"Content-Disposition": 'attachment; filename="diagnosis.zip"'}
    return Response(packed.getvalue(), headers=headers, media_type="application/zip")


SHOWN: dict[str, Callable[[Visitor, Request], Response]] = {
    "/": lambda visitor, _: HTMLResponse(page(visitor)),
    "/sections": lambda visitor, _: _state(visitor, visitor.message),
    "/model.yaml": _model_file,
    "/result/{name}": _result_file,
    "/diagnosis.zip": _everything,
}


# -- what is changed -------------------------------------------------------------------------------


async def _take_record(visitor: Visitor, request: Request) -> None:
    number = visitor.new_number()
    content = await _body(request, min(RECORD_BYTES, ALL_BYTES - visitor.size))
    await visitor.take_record(number, _label(request), content)


async def _begin(visitor: Visitor, request: Request, what: str) -> None:
    form = await _form(request)
    if visitor.columns is None:
        raise Refused("Expected a model and records first.")
    mapping = clean_mapping(form.get("mapping"), visitor.columns)
    options = clean_options(form.get("options")) if what == "diagnose" else {}
    visitor.begin(what, mapping, options)


async def _take_model(visitor: Visitor, request: Request) -> None:
    await visitor.take_model(await _body(request, MODEL_BYTES), _label(request))


async def _take_system(visitor: Visitor, request: Request) -> None:
    await visitor.take_system(str((await _form(request)).get("system", "")))


CHANGES: dict[tuple[str, str], Change] = {
    # so that the process is ready when it is needed
    ("/start", "POST"): lambda visitor, _: visitor.worker.start(),
    ("/model", "POST"): _take_model,
    ("/system", "POST"): _take_system,
    ("/go_on", "POST"): lambda visitor, _: visitor.go_on(),
    ("/example", "POST"): lambda visitor, _: visitor.take_example(),
    ("/records", "POST"): _take_record,
    ("/records/{number:int}", "DELETE"): lambda visitor, request: visitor.drop_record(
        request.path_params["number"]
    ),
    ("/look", "POST"): lambda visitor, request: _begin(visitor, request, "look"),
    ("/diagnosis", "POST"): lambda visitor, request: _begin(visitor, request, "diagnose"),
    ("/work", "DELETE"): lambda visitor, _: visitor.stop(),
}


def _label(request: Request) -> str:
    return request.query_params.get("name", "")


class TooLarge(Exception):
    """A request exceeds the accepted size."""


async def _body(request: Request, most: int) -> bytes:
    """Return the body of a request; raise `TooLarge` as soon as it exceeds the accepted size."""
    said = f"Expected at most {max(most, 0) / 1e6:g} MB more, got more than that."
    with suppress(ValueError):
        if int(request.headers.get("content-length", "0")) > most:
            raise TooLarge(said)
    parts, size = [], 0
    async for part in request.stream():
        size += len(part)
        if size > most:
            raise TooLarge(said)
        parts.append(part)
    return b"".join(parts)


async def _form(request: Request) -> dict:
    try:
        form = json.loads(await _body(request, FORM_BYTES) or b"{}")
    except (ValueError, RecursionError):
        raise Refused("Expected JSON.") from None
    if not isinstance(form, dict):
        raise Refused("Expected a JSON object.")
    return form


# -- where it listens ------------------------------------------------------------------------------


def listen(port: int) -> socket.socket:
    """Return a socket that listens on this machine only."""
    return socket.create_server((ADDRESS, port))


def new_secret() -> str:
    """Return a secret that nobody guesses."""
    return secrets.token_urlsafe(24)


def make_server(listening: socket.socket, secret: str, folder: Path) -> uvicorn.Server:
    """Return the server for a socket, the secret in its address, and the folder of its files."""
    port = listening.getsockname()[1]
    config = uvicorn.Config(
        Server([f"{ADDRESS}:{port}", f"localhost:{port}"], secret, folder).app,
        log_level="warning",
        access_log=False,
        server_header=False,
        ws="none",
        limit_concurrency=200,
        timeout_graceful_shutdown=2,
    )
    return uvicorn.Server(config)
