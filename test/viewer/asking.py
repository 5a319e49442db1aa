"""Requests to a server of pages, header by header."""

import json
import re
import socket
from html import unescape
from http.client import HTTPConnection
from urllib.parse import urlsplit

from ..processes import WAIT_S


def opened(address, path, method="GET", body="", **headers):
    """A connection on which a path has been asked for; ``Host`` is the address's by default."""
    url = urlsplit(address)
    # a browser resolves names below localhost, Python only if the system does
    host = "127.0.0.1" if url.hostname.endswith(".localhost") else url.hostname
    connection = HTTPConnection(host, url.port, timeout=WAIT_S)
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


def local(port):
    """Return a connection to a port of this machine."""
    return socket.create_connection(("127.0.0.1", port), timeout=WAIT_S)


class Visitor:
    """A browser that came with the whole address: its cookie, its origin, where it was led to."""

    def __init__(self, address):
        self.url, self.address = urlsplit(address), address
        status, answered, page = ask(address, f"{self.url.path}?{self.url.query}")
        assert status == 200
        self.set_cookie = str(answered["Set-Cookie"])
        self.home = unescape(re.search(r"0; url=([^\"]*)", page.decode())[1])
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
