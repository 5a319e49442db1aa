"""The panel's pages as one application, and what they send, read in one place for all of them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from cam_rig.errors import CamRigError, ConfigError, RefusedError
from cam_rig.live.sockets import LOOPBACK
from cam_rig.show import looks
from cam_rig.show.looks import web
from cam_rig.viewer.web_server import MAX_MESSAGE, Served, serve_application

#: The page takes nothing from another host, and is shown in no other's frame.
POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)

STATIC = Path(__file__).parent / "static"

# What pages send: JSON objects of a bounded size.

Answer = Callable[[dict[str, Any]], Awaitable[dict[str, Any] | Response]]


def page_file(path: str, folder: str, opened: Callable[[], None] = lambda: None) -> Route:
    """A route of a page's own file; ``opened`` is told."""

    async def answered(_: Request) -> Response:
        opened()
        return FileResponse(STATIC / folder / "index.html")

    return Route(path, answered)


def get(path: str, answer: Answer) -> Route:
    """A route that answers the names in its path; with 404 where ``answer`` raises, as `post`."""

    async def answered(request: Request) -> Response:
        return await _answered(answer, request.path_params, 404)

    return Route(path, answered)


def post(path: str, answer: Answer) -> Route:
    """A route that answers a request's object; 400 where it is none, 409 where it is refused."""

    async def answered(request: Request) -> Response:
        try:
            body = await _read_body(request)
        except ClientDisconnect:  # the request is cut off, and no one reads the response
            return Response(status_code=400)
        except RefusedError as error:
            return JSONResponse({"words": str(error)}, 400)
        return await _answered(answer, body, 409)

    return Route(path, answered, methods=["POST"])


async def _answered(answer: Answer, asked: dict[str, Any], status: int) -> Response:
    try:
        found = await answer(asked)
    except CamRigError as error:
        status = 409 if isinstance(error, RefusedError) else status
        return JSONResponse({"words": str(error)}, status)
    return found if isinstance(found, Response) else JSONResponse(found)


def csv_file(name: str, text: str) -> Response:
    """A table to be saved under a name."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(text, headers=headers, media_type="text/csv")


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


class PanelPages:
    """Some pages of the panel: what is asked of them, and what runs as long as they are served."""

    routes: Sequence[BaseRoute]

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """Entered in the server's loop before the first request, left after the last."""
        yield


def languages() -> list[str]:
    """Those that the pages have texts in, by their two letters."""
    return sorted(path.stem for path in (STATIC / "texts").glob("*.json"))


async def _looks(_: Request) -> Response:
    """Colours and sizes of every page, and the figures' colours of what is drawn, as variables."""
    names = "LIFT", "VELOCITY", "ACCELERATION", "FORCE", "GAP", "LANDING", "LIFT_OFF", "FOLLOWER"
    rows = "".join(f"--of-{n.lower().replace('_', '-')}:{web(getattr(looks, n))};" for n in names)
    return Response(f"{looks.tokens()}:root{{{rows}}}", media_type="text/css")


def application(*pages: PanelPages, language: str | None = None) -> Starlette:
    """All pages of a panel with the files that they share; ``language`` None is the browser's."""

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
    common = (
        Route("/languages", offered),
        Route("/looks.css", _looks),
        Mount("/static", StaticFiles(directory=STATIC)),
    )
    routes = [*own, *common]
    packed = Middleware(GZipMiddleware, compresslevel=5)
    return Starlette(routes=routes, lifespan=lifespan, middleware=[packed])


@contextmanager
def serve(
    *pages: PanelPages,
    port: int = 0,
    language: str | None = None,
    home: str = "/",
    host: str = LOOPBACK,
) -> Iterator[Served]:
    """Serve pages as long as the context lasts; the printed address leads to ``home``."""
    if language is not None and language not in languages():
        raise ConfigError(f"--lang: is {language!r}; allowed: {', '.join(languages())}")
    app = application(*pages, language=language)
    with serve_application(app, home, POLICY, port, host) as served:
        yield served


# A page's websocket: what it asks is done, and what is new it is told, as fast as it reads.

#: Wall time (s) between two messages of a kind, at least.
TELL_EVERY_S = 0.05
#: Wall time (s) in which a page must have room for a message, or it is dropped.
READS_WITHIN_S = 30.0
Message = dict[str, Any]


class LivePage:
    """A page that holds nobody up: of each kind of message only the newest waits for it."""

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self._newest: dict[str, Callable[[], Message]] = {}
        self._new = asyncio.Event()

    def tell(self, kind: str, message: Callable[[], Message]) -> None:
        """Have it told, in place of what still waits of a kind; made when sent, empty is none."""
        self._newest[kind] = message
        self._new.set()

    def refused(self, number: Any, words: str) -> Message:
        """The answer to a refused message of a number, None where it has none."""
        return {"type": "refused", "number": number, "words": words}

    async def serve(self, obey: Callable[[Message], Awaitable[Message]]) -> None:
        """Do what it asks, by ``obey``, and tell it what is new, until it is closed."""
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._obey(obey))
                for telling in self.telling():
                    group.create_task(telling)
        # Closed; closed while another task sends; reads nothing.
        except* (WebSocketDisconnect, RuntimeError, TimeoutError):
            pass

    def telling(self) -> list[Any]:
        """What runs beside, as long as the page is there."""
        return [self._tell()]

    async def send(self, message: Message | bytes) -> None:
        """Send a message; TimeoutError where the page reads nothing."""
        async with asyncio.timeout(READS_WITHIN_S):
            if isinstance(message, bytes):
                await self.socket.send_bytes(message)
            else:
                await self.socket.send_json(message)

    async def _obey(self, obey: Callable[[Message], Awaitable[Message]]) -> None:
        while True:
            number = None
            try:
                asked = await read_frame(self.socket)
                number = asked.get("number")
                answer = await obey(asked)
            except RefusedError as error:
                answer = self.refused(number, str(error))
            await self.send(answer)

    async def _tell(self) -> None:
        while True:
            await self._new.wait()
            self._new.clear()
            while self._newest:
                if message := self._newest.pop(next(iter(self._newest)))():
                    await self.send(message)
            await asyncio.sleep(TELL_EVERY_S)
