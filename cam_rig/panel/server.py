"""Serving the panel: its pages behind one guard, on this machine alone."""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import socket
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import (
    AbstractAsyncContextManager,
    AsyncExitStack,
    asynccontextmanager,
    contextmanager,
)
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from cam_rig.errors import CamRigError, ConfigError, RefusedError
from cam_rig.live.sockets import require_loopback
from cam_rig.viewer.access import HEADERS, Access
from cam_rig.viewer.process import HOST

# Who may ask the panel: this machine's own pages that came with the token, and nobody else.

#: The page takes nothing from another host, and is shown in no other's frame; Rerun's page in one
#: of its own is this machine's.
POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    f"form-action 'none'; frame-ancestors 'none'; frame-src http://{HOST}:* http://localhost:*"
)

#: Close code of a websocket that breaks a rule (RFC 6455).
REFUSED = 1008


@dataclass
class Guard:
    """An ASGI application behind Host, Origin and token, for pages and websockets alike.

    Parameters
    ----------
    app : what is guarded
    access : who may ask for it
    home : the page that the printed address leads to
    """

    app: ASGIApp
    access: Access
    home: str = "/"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, hand on, or refuse."""
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        asked, page = HTTPConnection(scope), scope["type"] == "http"
        token = asked.query_params.get("token") if page else None
        needs_origin = not page or scope["method"] not in ("GET", "HEAD")
        if words := self.access.why_not(asked.headers, token, needs_origin):
            return await self._refuse(words, scope, receive, send)
        if token is not None:
            answer: Response = RedirectResponse(self.home, 303)
            answer.headers["Set-Cookie"] = self.access.cookie
            return await answer(scope, receive, _with_headers(send))
        await self.app(scope, receive, _with_headers(send))

    async def _refuse(self, words: str, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await receive()  # its handshake; closed before it is accepted, it is answered by 403
            return await send({"type": "websocket.close", "code": REFUSED, "reason": words})
        await PlainTextResponse(words + "\n", 403)(scope, receive, _with_headers(send))


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in (HEADERS | {"Content-Security-Policy": POLICY}).items():
                headers[name] = value
        await send(message)

    return sending


# What pages send: JSON objects of a bounded size, read in one place for all pages.

#: Bytes of a page's message, and of a request's body, at most.
MAX_MESSAGE = 1 << 16

Answer = Callable[[dict[str, Any]], Awaitable[dict[str, Any] | Response]]


def post(path: str, answer: Answer) -> Route:
    """A route that answers the object in a request's body.

    With 400 where it is none, with 409 where ``answer`` raises a CamRigError: ``words`` are why.
    """

    async def answered(request: Request) -> Response:
        try:
            body = await _read_body(request)
        except RefusedError as error:
            return JSONResponse({"words": str(error)}, 400)
        try:
            found = await answer(body)
        except CamRigError as error:
            return JSONResponse({"words": str(error)}, 409)
        return found if isinstance(found, Response) else JSONResponse(found)

    return Route(path, answered, methods=["POST"])


async def _read_body(request: Request) -> dict[str, Any]:
    data = b""
    async for chunk in request.stream():
        data += chunk
        if len(data) > MAX_MESSAGE:
            raise RefusedError(f"request: allowed: {MAX_MESSAGE} bytes")
    return read_object(data)


async def read_frame(socket: WebSocket) -> dict[str, Any]:
    """The object in a page's next message.

    Raises
    ------
    RefusedError : the message is none
    WebSocketDisconnect : the page is closed
    """
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005))
    return read_object(message.get("text") or "")


def read_object(text: str | bytes) -> dict[str, Any]:
    """A JSON object that can be answered as JSON: finite numbers, and text that is Unicode."""
    try:
        found = json.loads(text, parse_int=_number)
        # Python reads NaN, 1e999 and half a surrogate pair, and no page could be sent them back.
        json.dumps(found, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise RefusedError("message: allowed: a JSON object, of finite numbers and Unicode text")
    return found


def _number(digits: str) -> int | float:
    """A whole number; one that a double does not hold is infinite."""
    found = float(digits)
    return int(digits) if abs(found) < 2.0**53 else found


STATIC = Path(__file__).parent / "static"

#: Wall time (s) that the server has to end, once asked.
END_S = 3.0


class PanelPages(Protocol):
    """Some pages of the panel: what they answer, and what runs as long as they are served."""

    @property
    def routes(self) -> Sequence[BaseRoute]:
        """What is asked of them."""

    def alive(self) -> AbstractAsyncContextManager[None]:
        """Entered in the server's loop before the first request, left after the last."""


def languages() -> list[str]:
    """Those that the pages have texts in, by their two letters."""
    return sorted(path.stem for path in (STATIC / "texts").glob("*.json"))


def application(*pages: PanelPages, language: str | None = None) -> Starlette:
    """All pages of a panel as one application, with the files that they share.

    ``language`` is that of a page whose reader has not chosen one; None takes the browser's.
    """

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        async with AsyncExitStack() as stack:
            for part in pages:
                await stack.enter_async_context(part.alive())
            yield

    async def offered(_: Request) -> Response:
        served = [route.path for route in own if isinstance(route, Route)]
        offers = {"language": language, "languages": languages(), "pages": served}
        return JSONResponse(offers)

    own = [route for part in pages for route in part.routes]
    common = Route("/languages", offered), Mount("/static", StaticFiles(directory=STATIC))
    routes = [*own, *common]
    return Starlette(routes=routes, lifespan=lifespan)


class ServedPanel:
    """A panel that is being served, at ``address``."""

    def __init__(self, address: str, ended: threading.Event) -> None:
        self.address, self._ended = address, ended

    def alive(self) -> bool:
        """Whether its server runs."""
        return not self._ended.is_set()


@contextmanager
def serve(
    *pages: PanelPages, port: int = 0, language: str | None = None, home: str = "/"
) -> Iterator[ServedPanel]:
    """Serve pages on this machine alone, as long as the context lasts.

    Parameters
    ----------
    port : 0 takes a free one
    language : see `application`
    home : the page that the printed address leads to
    """
    if language is not None and language not in languages():
        raise ConfigError(f"--lang: is {language!r}; allowed: {', '.join(languages())}")
    with _listener(port) as listener:
        served = application(*pages, language=language)
        guard = Guard(served, Access(int(listener.getsockname()[1])), home)
        config = uvicorn.Config(
            guard,
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
        ended = threading.Event()

        def run() -> None:
            try:
                server.run(sockets=[listener])
            finally:
                ended.set()

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        try:
            yield ServedPanel(guard.access.address, ended)
        finally:
            server.should_exit = True
            thread.join(END_S)  # a request that computes does not keep the command


def _in_one_line(record: logging.LogRecord) -> bool:
    """A page's message that is no UTF-8 is not worth a traceback; a request cut off, no word."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, UnicodeDecodeError):
        record.exc_info = None
    return not isinstance(error, asyncio.CancelledError)


def _listener(port: int) -> socket.socket:
    require_loopback()
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()
    except OSError as error:
        listener.close()
        why = "is in use" if error.errno == errno.EADDRINUSE else f"{error.strerror}"
        raise ConfigError(f"--port: {port} {why}; allowed: another, or 0 for a free one") from None
    return listener
