"""Pages for a browser, on this machine alone if not asked otherwise: who gets them, and how.

What a request must have is this server's host, no other origin than its own, and the token. The
address that is printed has the token; it becomes a cookie at once, and leaves the address.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import re
import secrets
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

import uvicorn
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
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
#: What may be asked for: a path of plain characters.
PATH = re.compile(rb"/[!-~]*")
#: Close code of a websocket that breaks a rule (RFC 6455).
REFUSED = 1008
#: Bytes of a page's message, and of a request's body, at most.
MAX_MESSAGE = 1 << 16
#: Wall time (s) that a server has to end, once asked.
END_S = 3.0


@dataclass(frozen=True)
class Access:
    """Host, origin and token that a request to a port must have."""

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    host: str = LOOPBACK

    @property
    def hosts(self) -> tuple[str, ...]:
        """The names under which a browser may ask."""
        names = (LOOPBACK, "localhost") if self.host == LOOPBACK else (self.host,)
        return tuple(f"{name}:{self.port}" for name in names)

    def address(self, path: str = "/") -> str:
        """What a browser is given."""
        return f"http://{self.hosts[0]}{path}?token={self.token}"

    @property
    def cookie_name(self) -> str:
        """A cookie is of a host, and another server has another port."""
        return f"cam_rig_{self.port}"

    @property
    def cookie(self) -> str:
        """The header that sets the cookie."""
        # Not Strict: a browser would not send it with the page that a file of ours opens.
        return f"{self.cookie_name}={self.token}; HttpOnly; Path=/; SameSite=Lax"

    def why_not(
        self, headers: Mapping[str, str], token: str | None, needs_origin: bool = False
    ) -> str:
        """Why a request is refused; empty where it is not.

        ``token`` is that of its address, None where that has none. A browser always names the
        origin of a websocket or a POST (``needs_origin``), and none of a page of its own.
        """
        if headers.get("host") not in self.hosts:
            return f"allowed hosts: {', '.join(self.hosts)}"
        own, origin = [f"http://{host}" for host in self.hosts], headers.get("origin")
        if (origin is not None or needs_origin) and origin not in own:
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
        asked, page = HTTPConnection(scope), scope["type"] == "http"
        token = asked.query_params.get("token") if page else None
        needs_origin = not page or scope["method"] not in ("GET", "HEAD")
        if words := self.access.why_not(asked.headers, token, needs_origin):
            return await _refuse(words, 403, scope, receive, send)
        if token is not None:
            path = scope["path"]
            answer: Response = RedirectResponse(self.home if path == "/" else path, 303)
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
    with _listener(host, port) as listener:
        access = Access(int(listener.getsockname()[1]), host=host)
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

        thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
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


def _listener(host: str, port: int) -> socket.socket:
    require_loopback()
    listener = socket.socket()
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
