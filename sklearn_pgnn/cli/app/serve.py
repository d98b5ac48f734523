"""The job of ``sklearn-pgnn app``: serve the page until it is stopped."""

from html import escape
from pathlib import Path
from tempfile import gettempdir

import click

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.whole_file import WorkingFolder

with needed_by("The page"):
    from sklearn_pgnn.cli.app.server import ADDRESS, listen, make_server, new_secret


#: beginning of the names of folders in which the page keeps its files
BEGIN = "sklearn_pgnn_app_"


def serve(port: int, *, opens: bool, quiet: bool) -> None:
    """Serve the page on this machine until a signal ends it; port 0 is any free one."""
    try:
        listening = listen(port)
    except OSError as error:
        raise OptionError(
            f"--port: expected a free port, got {port} ({error.strerror}). Remedy: --port 0 "
            f"selects a free one."
        ) from error
    secret = new_secret()
    url = f"http://{ADDRESS}:{listening.getsockname()[1]}/{secret}/"
    said = "for you only: whoever has this address has the session. Ctrl-C ends it."
    click.echo(url if quiet else f"The page is at {url}\nIt is {said}")
    folder = WorkingFolder(Path(gettempdir()), BEGIN)
    try:
        if opens:
            click.launch(str(_door(folder.path, url)))
        make_server(listening, secret, folder.path).run(sockets=[listening])
    finally:
        folder.remove()


def _door(folder: Path, url: str) -> Path:
    """Write a file that leads to the page: arguments of programs are seen by all users."""
    page = folder / "open.html"
    page.write_text(
        f'<!DOCTYPE html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
        f'<meta http-equiv="refresh" content="0; url={escape(url)}"><title>sklearn-pgnn</title>',
        encoding="utf-8",
    )
    return page
