"""Requests to a server of pages, header by header."""

import json
from http.client import HTTPConnection
from urllib.parse import urlsplit

from ..processes import WAIT_S


def opened(address, path, method="GET", body="", **headers):
    """A connection on which a path has been asked for; ``Host`` is the address's by default."""
    url = urlsplit(address)
    connection = HTTPConnection(url.hostname or "", url.port, timeout=WAIT_S)
    connection.putrequest(method, path, skip_host=True)
    for name, value in ({"Host": url.netloc, "Content-Length": str(len(body))} | headers).items():
        connection.putheader(name, value)
    connection.endheaders(body.encode())
    return connection


def ask(address, path, method="GET", body="", **headers):
    """Status, headers and body."""
    connection = opened(address, path, method, body, **headers)
    answer = connection.getresponse()
    found = answer.status, answer.headers, answer.read()
    connection.close()
    return found


class Visitor:
    """A browser that came with the whole address: its cookie, its origin, where it was led to."""

    def __init__(self, address):
        self.url, self.address = urlsplit(address), address
        status, answered, _ = ask(address, f"{self.url.path}?{self.url.query}")
        assert status == 303
        self.home, self.set_cookie = str(answered["Location"]), str(answered["Set-Cookie"])
        self.cookie = self.set_cookie.split(";")[0]
        self.headers = {"Cookie": self.cookie, "Origin": f"http://{self.url.netloc}"}

    def get(self, path):
        """The body of a path that there is."""
        status, _, body = ask(self.address, path, Cookie=self.cookie)
        assert status == 200, (path, status)
        return body

    def post(self, path, body=""):
        """What a page's own request is answered with."""
        return ask(self.address, path, "POST", body, **self.headers)

    def send(self, path, value):
        """Status and answer of what a page sends as JSON."""
        status, _, body = self.post(path, json.dumps(value))
        return status, json.loads(body)
