"""The panel's pages as one application, and what they send, read in one place for all of them."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import (
    AbstractAsyncContextManager,
    AsyncExitStack,
    asynccontextmanager,
    contextmanager,
)
from pathlib import Path
from typing import Any, Protocol

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from cam_rig.errors import CamRigError, ConfigError, RefusedError
from cam_rig.live.loopback import LOOPBACK
from cam_rig.viewer.web_server import MAX_MESSAGE, Served, serve_application

#: The page takes nothing from another host, and is shown in no other's frame; Rerun's page in one
#: of its own is this machine's.
POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'; "
    f"frame-src http://{LOOPBACK}:* http://localhost:*"
)

# What pages send: JSON objects of a bounded size.

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
    """The object in a page's next message."""
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


@contextmanager
def serve(
    *pages: PanelPages, port: int = 0, language: str | None = None, home: str = "/"
) -> Iterator[Served]:
    """Serve pages on this machine alone, as long as the context lasts.

    ``port`` 0 takes a free one; the printed address leads to ``home``; see `application`.
    """
    if language is not None and language not in languages():
        raise ConfigError(f"--lang: is {language!r}; allowed: {', '.join(languages())}")
    with serve_application(application(*pages, language=language), home, POLICY, port) as served:
        yield served
