"""Server of pages for a browser, on this machine only unless another address is requested.

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

#: Sent with every answer, also with a refusal.
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
#: Paths that are accepted: plain characters, and not two slashes first, which would name a host.
PATH = re.compile(rb"/(?!/)[!-~]*")
#: Loopback address of IPv6.
LOOPBACK_6 = "::1"
#: Host of the pages of this process on the loopback.
LOCAL_HOST = f"{secrets.token_hex(8)}.localhost"
#: Page that stores the cookie and leads to a path. A redirect (303) would be part of a navigation
#: that a file or another site has started, in which a browser sends no cookie of SameSite=Strict.
ENTRY = """<!doctype html>
<meta charset="utf-8">
<link rel="icon" href="data:,">
<meta http-equiv="refresh" content="0; url={path}">
<title>cam_rig</title>
<a href="{path}">cam-rig</a>
"""
#: Close code of a websocket that breaks a rule (RFC 6455).
REFUSED = 1008
#: Bytes of a page's message, and of a request's body, at most.
MAX_MESSAGE = 1 << 16
#: Wall time (s) that a server has to end, once asked.
END_S = 3.0


@dataclass(frozen=True)
class Access:
    """Host, origin and token that a request to a port must have.

    With a `host` other than the loopback, the cookie goes to all ports of that address.
    """

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    host: str = LOOPBACK

    @property
    def netloc(self) -> str:
        """Host and port in the address of a page."""
        return f"{LOCAL_HOST if self.host == LOOPBACK else self.host}:{self.port}"

    def address(self, path: str = "/") -> str:
        """Return the address for a browser, with the token."""
        return f"http://{self.netloc}{path}?token={self.token}"

    @property
    def cookie_name(self) -> str:
        """Name of the cookie, which differs between the servers of a process."""
        return f"cam_rig_{self.port}"

    @property
    def cookie(self) -> str:
        """Header that sets the cookie."""
        return f"{self.cookie_name}={self.token}; HttpOnly; Path=/; SameSite=Strict"

    def why_not(
        self, headers: Mapping[str, str], token: str | None, needs_origin: bool = False
    ) -> str:
        """Why a request is refused; empty where it is not.

        ``token`` is that of its address, None where that has none. A browser always names the
        origin of a websocket or a POST (``needs_origin``), and none of a page of its own.
        """
        if headers.get("host") != self.netloc:
            return "the host must be that of the printed address"
        origin = headers.get("origin")
        if (origin is not None or needs_origin) and origin != f"http://{self.netloc}":
            return "allowed: pages of this address alone"
        given = self._of_cookie(headers.get("cookie") or "") if token is None else token
        if not secrets.compare_digest(given.encode(errors="replace"), self.token.encode()):
            return "allowed: the whole address that was printed, with its token"
        return ""

    def _of_cookie(self, cookies: str) -> str:
        """By one split: Python's own parser takes seconds for what anybody may send."""
        pairs = (pair.strip().partition("=") for pair in cookies.split(";"))
        return next((value for name, _, value in pairs if name == self.cookie_name), "")


@dataclass
class Guard:
    """An application behind host, origin and token; an address of no path leads to ``home``."""

    app: ASGIApp
    access: Access
    home: str
    policy: str

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, hand on, or refuse."""
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        send = self._with_headers(send)
        if not PATH.fullmatch(scope["raw_path"]):
            return await _refuse("allowed: a path that begins with /", 400, scope, receive, send)
        asked, is_http = HTTPConnection(scope), scope["type"] == "http"
        token = asked.query_params.get("token") if is_http else None
        needs_origin = not is_http or scope["method"] not in ("GET", "HEAD")
        if words := self.access.why_not(asked.headers, token, needs_origin):
            return await _refuse(words, 403, scope, receive, send)
        if token is not None:
            path = scope["path"]
            page = ENTRY.format(
                path=html.escape(self.home if path == "/" else "/" + quote(path.lstrip("/")))
            )
            answer = HTMLResponse(page)
            answer.headers["Set-Cookie"] = self.access.cookie
            return await answer(scope, receive, send)
        await self.app(scope, receive, send)

    def _with_headers(self, send: Send) -> Send:
        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS | {"Content-Security-Policy": self.policy})
            await send(message)

        return sending


async def _refuse(words: str, status: int, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()  # its handshake; closed before it is accepted, it is answered by 403
        return await send({"type": "websocket.close", "code": REFUSED, "reason": words})
    await PlainTextResponse(words + "\n", status)(scope, receive, send)


class Served(NamedTuple):
    """What a browser must have, and whether its server runs."""

    access: Access
    alive: Callable[[], bool]

    @property
    def address(self) -> str:
        """What a browser is given; it leads to ``home``."""
        return self.access.address()


@contextmanager
def serve_application(
    app: ASGIApp, home: str, policy: str, port: int = 0, host: str = LOOPBACK
) -> Iterator[Served]:
    """Serve an application behind a `Guard` as long as the context lasts; port 0: a free one."""
    with ExitStack() as stack:
        listeners = [stack.enter_context(each) for each in _listeners(host, port)]
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
        logging.getLogger("uvicorn.error").addFilter(_in_one_line)
        server = uvicorn.Server(config)

        thread = threading.Thread(target=server.run, args=(listeners,), daemon=True)
        thread.start()
        try:
            yield Served(access, thread.is_alive)
        finally:
            server.should_exit = True
            thread.join(END_S)  # a request that computes does not keep the command


def _in_one_line(record: logging.LogRecord) -> bool:
    """No traceback for a message that is no UTF-8, no word of a request cut off or no HTTP."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, UnicodeDecodeError):
        record.exc_info = None
    return record.levelno >= logging.ERROR and not isinstance(error, asyncio.CancelledError)


def _listeners(host: str, port: int) -> list[socket.socket]:
    """Return the listening sockets; on the loopback of IPv4 and IPv6, if it has one.

    A browser tries both addresses of a name below localhost. Another user's server at the same port
    of the other one would receive the cookie.
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
            words = (
                f"--host: is {host!r:.60} ({error.strerror}); allowed: an address of this machine"
            )
            raise ConfigError(words) from None
        why = "is in use" if error.errno == errno.EADDRINUSE else f"{error.strerror}"
        raise ConfigError(f"--port: {port} {why}; allowed: another, or 0 for a free one") from None
    return listener
