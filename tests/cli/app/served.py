"""The page's server in a thread, and a visitor that speaks HTTP."""

import json
import re
import time
from contextlib import contextmanager
from http.client import HTTPConnection
from threading import Thread
from urllib.parse import quote

from sklearn_pgnn.cli.app.server import listen, make_server


@contextmanager
def served():
    """Serve the page on a free port; yield the port."""
    listening = listen(0)
    server = make_server(listening)
    thread = Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join()


class Client:
    """A browser with a cookie and the token of its page."""

    def __init__(self, port):
        self.port, self.host = port, f"127.0.0.1:{port}"
        self.cookie = self.token = ""
        page = self.get("/")
        self.cookie = page.headers["set-cookie"].split(";")[0]
        self.token = re.search(r'name="token" content="([^"]+)"', page.text)[1]

    def send(self, method, path, body=None, **headers):
        """Return the answer to a request; a header that is None is left out."""
        known = {"Host": self.host, "Cookie": self.cookie}
        if method != "GET":
            known |= {"Origin": f"http://{self.host}", "X-Token": self.token}
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
        self.text = response.read().decode()

    @property
    def json(self):
        return json.loads(self.text)

    @property
    def sections(self):
        return self.json["sections"]

    @property
    def message(self):
        return self.json["message"]
