"""A request to a panel, header by header."""

from __future__ import annotations

from http.client import HTTPConnection, HTTPResponse
from urllib.parse import urlsplit


def ask(address: str, path: str, method: str = "GET", body: str = "", **headers: str) -> tuple:
    """Status, headers and body; ``Host`` is the address's unless another is given."""
    url = urlsplit(address)
    connection = HTTPConnection(url.hostname or "", url.port, timeout=20)
    connection.putrequest(method, path, skip_host=True)
    for name, value in ({"Host": url.netloc, "Content-Length": str(len(body))} | headers).items():
        connection.putheader(name, value)
    connection.endheaders(body.encode())
    answer: HTTPResponse = connection.getresponse()
    found = answer.status, answer.headers, answer.read()
    connection.close()
    return found
