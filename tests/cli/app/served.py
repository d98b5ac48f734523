"""The page's server in a thread, and a browser that speaks HTTP."""

import json
import time
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import NamedTuple
from urllib.parse import quote

from sklearn_pgnn.cli.app.server import listen, make_server, new_secret


@contextmanager
def served():
    """Serve the page on a free port; yield its address."""
    listening, secret = listen(0), new_secret()
    with TemporaryDirectory() as folder:
        server = make_server(listening, secret, Path(folder))
        thread = Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield Address(listening.getsockname()[1], secret, Path(folder))
        finally:
            server.should_exit = True
            thread.join()


class Address(NamedTuple):
    """Where the page is: its port and its secret; and the folder of its files."""

    port: int
    secret: str
    folder: Path

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/{self.secret}/"


class Client:
    """A browser at the page's address."""

    def __init__(self, address):
        self.port, self.host = address.port, f"127.0.0.1:{address.port}"
        self.secret = address.secret

    def send(self, method, path, body=None, **headers):
        """Return the answer to a request; a header that is None is left out."""
        return self.send_to(method, f"/{self.secret}{path}", body, **headers)

    def send_to(self, method, path, body=None, **headers):
        """Return the answer to a request of a path that need not begin with the secret."""
        known = {"Host": self.host}
        if method != "GET":
            known |= {"Origin": f"http://{self.host}"}
        known |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = HTTPConnection("127.0.0.1", self.port, timeout=120)
        kept = {name: value for name, value in known.items() if value is not None}
        connection.request(method, path, body, kept)
        return Answer(connection.getresponse())

    def get(self, path, **headers):
        return self.send("GET", path, **headers)

    def post(self, path, body=None, **headers):
        return self.send("POST", path, body, **headers)

    def ask(self, path, **form):
        return self.post(path, json.dumps(form))

    def bring(self, to, name, text):
        return self.post(f"/{to}?name={quote(name)}", text.encode())

    def wait(self, longest=120):
        """Return the state once nothing is being done any more."""
        until = time.monotonic() + longest
        while (state := self.get("/sections").json)["busy"]:
            assert time.monotonic() < until
            time.sleep(0.1)
        return state


class Answer:
    """What came back."""

    def __init__(self, response):
        self.status, self.headers = response.status, response.headers
        self.content = response.read()

    @property
    def text(self):
        return self.content.decode()

    @property
    def json(self):
        return json.loads(self.text)

    @property
    def sections(self):
        return self.json["sections"]

    @property
    def message(self):
        return self.json["message"]
