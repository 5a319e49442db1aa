"""HTTP requests with custom headers to a server of pages."""

import json
import re
import socket
from html import unescape
from http.client import HTTPConnection
from urllib.parse import urlsplit

from ..processes import WAIT_S


def opened(address, path, method="GET", body="", **headers):
    """Return a connection to a page server on which a request of a path was sent.

    The default of the Host header is the host of the address.
    """
    url = urlsplit(address)
    # A browser resolves names below localhost, Python only if the system does.
    host = "127.0.0.1" if url.hostname.endswith(".localhost") else url.hostname
    connection = HTTPConnection(host, url.port, timeout=WAIT_S)
    connection.putrequest(method, path, skip_host=True)
    for name, value in ({"Host": url.netloc, "Content-Length": str(len(body))} | headers).items():
        connection.putheader(name, value)
    connection.endheaders(body.encode())
    return connection


def ask(address, path, method="GET", body="", **headers):
    """Send a request to a page server, and return status, headers and body."""
    connection = opened(address, path, method, body, **headers)
    http_response = connection.getresponse()
    response = http_response.status, http_response.headers, http_response.read()
    connection.close()
    return response


def local(port):
    """Return a socket that is connected to a port of this machine."""
    return socket.create_connection(("127.0.0.1", port), timeout=WAIT_S)


class Visitor:
    """Browser session that was opened at the printed address of a page server.

    It has the cookie, the origin and the home path of the page.
    """

    def __init__(self, address):
        self.url, self.address = urlsplit(address), address
        status, answered, page = ask(address, f"{self.url.path}?{self.url.query}")
        assert status == 200
        self.set_cookie = str(answered["Set-Cookie"])
        self.home = unescape(re.search(r"0; url=([^\"]*)", page.decode())[1])
        self.cookie = self.set_cookie.split(";")[0]
        self.headers = {"Cookie": self.cookie, "Origin": f"http://{self.url.netloc}"}

    def get(self, path):
        """Return the body of the page at a path, which must exist."""
        status, _, body = ask(self.address, path, Cookie=self.cookie)
        assert status == 200, (path, status)
        return body

    def post(self, path, body=""):
        """Return status, headers and body of a POST request by the page."""
        return ask(self.address, path, "POST", body, **self.headers)

    def send(self, path, value):
        """Return status and decoded response of a POST request with JSON."""
        status, _, body = self.post(path, json.dumps(value))
        return status, json.loads(body)
