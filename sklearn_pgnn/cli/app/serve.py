"""The job of ``sklearn-pgnn app``: serve the page until it is stopped."""

import click

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.extras import needed_by

with needed_by("The page"):
    from sklearn_pgnn.cli.app.server import ADDRESS, listen, make_server


def serve(port: int, *, opens: bool, quiet: bool) -> None:
    """Serve the page on this machine until a signal ends it.

    Parameters
    ----------
    port : int
        The port; 0 for any free one.
    opens : bool
        Whether to open the page.
    quiet : bool
        Whether to print the address only.

    Raises
    ------
    OptionError
        If the port is taken.
    """
    try:
        listening = listen(port)
    except OSError as error:
        raise OptionError(
            f"--port: expected a free port, got {port} ({error.strerror}). Remedy: --port 0 "
            f"selects a free one."
        ) from error
    url = f"http://{ADDRESS}:{listening.getsockname()[1]}/"
    click.echo(url if quiet else f"The page is at {url}, for this computer only. Ctrl-C ends it.")
    if opens:
        click.launch(url)
    make_server(listening).run(sockets=[listening])
