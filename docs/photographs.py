"""Photograph what is seen in a browser: ``python docs/photographs.py``, with Chromium.

The page to drop files on, with the example that it offers, and the top of a report.
"""

import shutil
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

from playwright.sync_api import sync_playwright

from sklearn_pgnn.cli.app.server import listen, make_server, new_secret

FOLDER = Path(__file__).parent / "_static"
#: the system's; if it has none, the one that ``playwright install chromium`` brings
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


@contextmanager
def served():
    """Serve the page on a free port; yield its address."""
    listening, secret = listen(0), new_secret()
    with TemporaryDirectory() as folder:
        server = make_server(listening, secret, Path(folder))
        thread = Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}/{secret}/"
        finally:
            server.should_exit = True
            thread.join()


def main():
    """Write every photograph."""
    with served() as url, sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1080, "height": 2000}, color_scheme="light")
        page.goto(url)
        page.click("text=Show me")
        page.wait_for_selector("#seen figure svg")
        clip = {"x": 0, "y": 0, "width": 1080, "height": 1880}
        page.screenshot(path=FOLDER / "app.png", clip=clip)
        page.click("#diagnose")
        page.wait_for_selector("#result .verdict", timeout=300_000)
        with page.context.expect_page() as opening:
            page.click("#report")
        report = opening.value
        report.set_viewport_size({"width": 1080, "height": 760})
        report.screenshot(path=FOLDER / "report_top.png")
        browser.close()


if __name__ == "__main__":
    main()
