"""Server of web pages, by default for a browser on this machine only.

A request needs this server's host, no other origin, and the token. The printed address contains the
token, which becomes a cookie at once and leaves the address.

A browser sends a cookie to every port of its host. On the loopback the host is therefore a random
name below `localhost`, which browsers resolve to this machine (RFC 6761, section 6.3) and which no
other server knows. All servers of one process share it, because a page in a frame of another host
would not receive its cookie (SameSite=Strict).
"""

from __future__ import annotations

import asyncio
import errno
import html
import logging
import re
import secrets
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple
from urllib.parse import quote

import uvicorn
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cam_rig.errors import ConfigError
from cam_rig.live.sockets import LOOPBACK, require_loopback

#: Headers of every response, including those that refuse a request.
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
#: Pattern of the paths that are accepted: plain characters, and not two slashes first, which would
#: name a host.
PATH = re.compile(rb"/(?!/)[!-~]*")
#: Loopback address of IPv6.
LOOPBACK_6 = "::1"
#: Host name of this process's pages on the loopback. It is random.
LOCAL_HOST = f"{secrets.token_hex(8)}.localhost"
#: Page that stores the cookie and then opens a path. A redirect (303) would be part of a navigation
#: that a file or another site has started, in which a browser sends no cookie of SameSite=Strict.
ENTRY = """<!doctype html>
<meta charset="utf-8">
<link rel="icon" href="data:,">
<meta http-equiv="refresh" content="0; url={path}">
<title>cam_rig</title>
<a href="{path}">cam-rig</a>
"""
#: Close code with which a websocket is closed that breaks a rule (RFC 6455).
REFUSED = 1008
#: Largest size of a websocket message and of the body of a request, bytes.
MAX_MESSAGE = 1 << 16
#: Longest wall-clock time (s) from the request to stop until a server ends.
END_S = 3.0


@dataclass(frozen=True)
class Access:
    """Access rules of a server: the host, origin and token that a request must have.

    If `host` is not the loopback, browsers send the cookie to all ports of that address.
    """

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    host: str = LOOPBACK

    @property
    def netloc(self) -> str:
        """Host and port in the address of a page of the server."""
        return f"{LOCAL_HOST if self.host == LOOPBACK else self.host}:{self.port}"

    def address(self, path: str = "/") -> str:
        """Return the address of a page for a browser, with the token."""
        return f"http://{self.netloc}{path}?token={self.token}"

    @property
    def cookie_name(self) -> str:
        """Name of the server's cookie, which differs between the servers of a process."""
        return f"cam_rig_{self.port}"

    @property
    def cookie(self) -> str:
        """Value of the header that sets the cookie of the server."""
        return f"{self.cookie_name}={self.token}; HttpOnly; Path=/; SameSite=Strict"

    def refusal_reason(
        self, headers: Mapping[str, str], token: str | None, needs_origin: bool = False
    ) -> str:
        """Return the reason why a request is refused, or an empty text if it is accepted.

        Parameters
        ----------
        headers : mapping
            Headers of the request.
        token : str, optional
            Token in the address of the request. None if the address has no token.
        needs_origin : bool
            True for a websocket or a POST, in which a browser always sends the origin. It sends
            none in the request of a page.
        """
        if headers.get("host") != self.netloc:
            return "the host must be that of the printed address"
        origin = headers.get("origin")
        if (origin is not None or needs_origin) and origin != f"http://{self.netloc}":
            return "the origin must be that of the printed address"
        if token is None:  # Python's cookie parser would take seconds for malicious cookies
            cookies = (headers.get("cookie") or "").split(";")
            pairs = (cookie.strip().partition("=") for cookie in cookies)
            token = next((value for name, _, value in pairs if name == self.cookie_name), "")
        if not secrets.compare_digest(token.encode(errors="replace"), self.token.encode()):
            return "the token is missing or wrong; open the complete printed address"
        return ""


@dataclass
class Guard:
    """Web application that checks host, origin and token of each request.

    A request that is accepted is passed to `app`. The path ``/`` leads to `home`. `policy` is the
    content security policy of every response.
    """

    app: ASGIApp
    access: Access
    home: str
    policy: str

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a web request, pass it to the guarded application, or refuse it."""
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        send = self._with_headers(send)
        if not PATH.fullmatch(scope["raw_path"]):
            return await _refuse("the path must start with one /", 400, scope, receive, send)
        connection, is_http = HTTPConnection(scope), scope["type"] == "http"
        token = connection.query_params.get("token") if is_http else None
        needs_origin = not is_http or scope["method"] not in ("GET", "HEAD")
        if reason := self.access.refusal_reason(connection.headers, token, needs_origin):
            return await _refuse(reason, 403, scope, receive, send)
        if token is not None:
            path = scope["path"]
            page = ENTRY.format(
                path=html.escape(self.home if path == "/" else "/" + quote(path.lstrip("/")))
            )
            response = HTMLResponse(page)
            response.headers["Set-Cookie"] = self.access.cookie
            return await response(scope, receive, send)
        await self.app(scope, receive, send)

    def _with_headers(self, send: Send) -> Send:
        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS | {"Content-Security-Policy": self.policy})
            await send(message)

        return sending


async def _refuse(reason: str, status: int, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()  # the handshake; a websocket closed before accept is answered with 403
        return await send({"type": "websocket.close", "code": REFUSED, "reason": reason})
    await PlainTextResponse(reason + "\n", status)(scope, receive, send)


class Served(NamedTuple):
    """Running server: access rules, and a function that returns True while it runs."""

    access: Access
    alive: Callable[[], bool]

    @property
    def address(self) -> str:
        """Address of the server's start page for a browser, with the token."""
        return self.access.address()


@contextmanager
def serve_application(
    app: ASGIApp, home: str, policy: str, port: int = 0, host: str = LOOPBACK
) -> Iterator[Served]:
    """Serve an application behind a `Guard` until the context ends.

    Port 0 selects a free port. `home` is the path to which ``/`` leads, `policy` the content
    security policy, and `host` the address of the server.
    """
    with ExitStack() as stack:
        listeners = [stack.enter_context(listener) for listener in _listeners(host, port)]
        access = Access(int(listeners[0].getsockname()[1]), host=host)
        config = uvicorn.Config(
            Guard(app, access, home, policy),
            log_config=None,
            access_log=False,
            ws="websockets-sansio",
            ws_max_size=MAX_MESSAGE,
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=1,
            server_header=False,
        )
        logging.getLogger("uvicorn.error").addFilter(_is_relevant)
        server = uvicorn.Server(config)

        thread = threading.Thread(target=server.run, args=(listeners,), daemon=True)
        thread.start()
        try:
            yield Served(access, thread.is_alive)
        finally:
            server.should_exit = True
            thread.join(END_S)  # a long request does not keep the command running


def _is_relevant(record: logging.LogRecord) -> bool:
    """Return True if a log record of the server is an error to be logged.

    Cancelled requests are not errors, and warnings on invalid or aborted requests are not logged.
    The traceback of invalid UTF-8 is removed.
    """
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, UnicodeDecodeError):
        record.exc_info = None
    return record.levelno >= logging.ERROR and not isinstance(error, asyncio.CancelledError)


def _listeners(host: str, port: int) -> list[socket.socket]:
    """Return the listening sockets, on the loopback those of IPv4 and IPv6.

    A browser tries both addresses of a name below localhost. If only one of them were used, another
    user's server at the same port of the other address could receive the cookie.
    """
    require_loopback()
    first = _listener(socket.AF_INET, host, port)
    if host != LOOPBACK or not _has_ipv6_loopback():
        return [first]
    try:
        second = _listener(socket.AF_INET6, LOOPBACK_6, int(first.getsockname()[1]))
    except ConfigError:
        first.close()
        raise
    return [first, second]


def _has_ipv6_loopback() -> bool:
    if not socket.has_ipv6:
        return False
    try:
        with socket.socket(socket.AF_INET6) as probe:
            probe.bind((LOOPBACK_6, 0))
    except OSError:
        return False
    return True


def _listener(family: socket.AddressFamily, host: str, port: int) -> socket.socket:
    listener = socket.socket(family)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()
    except OSError as error:
        listener.close()
        if host != LOOPBACK and error.errno != errno.EADDRINUSE:
            raise ConfigError(
                f"--host must be an address of this machine, got {host!r:.60} ({error.strerror})"
            ) from None
        reason = "is in use" if error.errno == errno.EADDRINUSE else f"({error.strerror})"
        raise ConfigError(
            f"--port {port} {reason}; choose another port, or 0 for a free port"
        ) from None
    return listener
