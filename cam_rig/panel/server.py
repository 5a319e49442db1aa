"""Web application of the panel's pages, and the parser of the messages they send."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from inspect import isawaitable
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

#: Content-Security-Policy of every page: no content from other hosts, and no display in a frame of
#: another page.
POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)

#: Folder of the pages' static files.
STATIC = Path(__file__).parent / "static"

# Requests of pages: JSON objects of a bounded size.

#: JSON object of a request, an answer or a websocket message.
Message = dict[str, Any]
#: Function that answers the data of a request with a JSON object or a response.
Handler = Callable[[Message], Message | Response | Awaitable[Message | Response]]


def page_file(path: str, folder: str, on_open: Callable[[], None] = lambda: None) -> Route:
    """Return the route of a page's HTML file.

    `on_open` is called at each request.
    """

    async def respond(_: Request) -> Response:
        on_open()
        return FileResponse(STATIC / folder / "index.html")

    return Route(path, respond)


def get(path: str, answer: Handler) -> Route:
    """Return a GET route for a path.

    `answer` computes the response from the parameters of the path. The status is 404 if it raises
    CamRigError, and 409 for RefusedError.
    """

    async def respond(request: Request) -> Response:
        return await _respond(answer, request.path_params, 404)

    return Route(path, respond)


def post(path: str, answer: Handler) -> Route:
    """Return a POST route for a path.

    `answer` computes the response from the JSON object in the body of the request. The status is
    400 if the body is not an allowed JSON object, and 409 if `answer` raises CamRigError.
    """

    async def respond(request: Request) -> Response:
        body = b""
        try:
            async for chunk in request.stream():
                body += chunk
                if len(body) > MAX_MESSAGE:
                    raise RefusedError(f"request: must not exceed {MAX_MESSAGE} bytes")
            request_data = parse_object(body)
        except ClientDisconnect:  # the connection is closed, so the response is not read
            return Response(status_code=400)
        except RefusedError as error:
            return JSONResponse({"message": str(error)}, 400)
        return await _respond(answer, request_data, 409)

    return Route(path, respond, methods=["POST"])


async def _respond(answer: Handler, request_data: Message, status: int) -> Response:
    try:
        reply = answer(request_data)
        if isawaitable(reply):
            reply = await reply
    except CamRigError as error:
        status = 409 if isinstance(error, RefusedError) else status
        return JSONResponse({"message": str(error)}, status)
    return reply if isinstance(reply, Response) else JSONResponse(reply)


def csv_file(name: str, text: str) -> Response:
    """Return a CSV response that a browser saves under a name."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(text, headers=headers, media_type="text/csv")


def parse_object(text: str | bytes) -> Message:
    """Return the JSON object that a page has sent.

    Raises RefusedError if the text is not a JSON object, if a number is not finite, or if a text is
    not valid Unicode. The object can therefore be sent back as JSON.
    """
    try:
        # A double represents integers below 2^53 exactly.
        data = json.loads(text, parse_int=lambda d: int(d) if abs(float(d)) < 2**53 else float(d))
        # json.loads accepts NaN, 1e999 and half a surrogate pair, which a response cannot contain.
        json.dumps(data, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        data = None
    if not isinstance(data, dict):
        raise RefusedError("message: allowed: a JSON object, of finite numbers and Unicode text")
    return data


class PanelPages:
    """Pages of one part of the panel: their routes and their background tasks."""

    routes: Sequence[BaseRoute]

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """Run the background tasks while the context is active.

        The server enters the context in its event loop before the first request and leaves it after
        the last.
        """
        yield


def languages() -> list[str]:
    """Return the two-letter codes of the languages in which the pages have texts."""
    return sorted(path.stem for path in (STATIC / "texts").glob("*.json"))


def require_language(language: str | None) -> None:
    """Raise ConfigError unless the pages have texts in a language, or it is None."""
    if language is not None and language not in languages():
        raise ConfigError(f"--lang: is {language!r}; allowed: {', '.join(languages())}")


#: Names in `looks` of the colours that are sent to the pages.
COLOURS = ("LIFT", "VELOCITY", "ACCELERATION", "FORCE", "GAP", "LANDING", "LIFT_OFF", "FOLLOWER")


def style_variables() -> str:
    """Return the colours and sizes of pages and figures as CSS variables."""
    values = ((name.lower().replace("_", "-"), getattr(looks, name)) for name in COLOURS)
    colours = "".join(f"--of-{name}:{web(value)};" for name, value in values)
    return f"{looks.tokens()}:root{{{colours}}}"


def application(*pages: PanelPages, language: str | None = None) -> Starlette:
    """Return the application of all pages and of the files that they share.

    If `language` is None, each page uses the language of its browser.
    """

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        async with AsyncExitStack() as stack:
            for part in pages:
                await stack.enter_async_context(part.alive())
            yield

    page_routes = [route for part in pages for route in part.routes]
    paths = [route.path for route in page_routes if isinstance(route, Route)]
    offer = {"language": language, "languages": languages(), "pages": paths}
    routes = [
        *page_routes,
        get("/languages", lambda _: offer),
        get("/looks.css", lambda _: Response(style_variables(), media_type="text/css")),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    gzip = Middleware(GZipMiddleware, compresslevel=5)
    return Starlette(routes=routes, lifespan=lifespan, middleware=[gzip])


@contextmanager
def serve(
    *pages: PanelPages,
    port: int = 0,
    language: str | None = None,
    home: str = "/",
    host: str = LOOPBACK,
) -> Iterator[Served]:
    """Serve pages while the context is active.

    Parameters
    ----------
    pages : PanelPages
        Parts of the panel.
    port : int
        Port, or 0 for a free one (default).
    language : str or None
        Language of the pages, or None for that of the browser (default).
    home : str
        Path to which the printed address leads.
    host : str
        Address on which the pages are served (default: the loopback address).

    Yields
    ------
    Served
        The address with its token, and a check that the server is running.

    Raises
    ------
    ConfigError
        If the pages have no texts in the language.
    """
    require_language(language)
    app = application(*pages, language=language)
    with serve_application(app, home, POLICY, port, host) as served:
        yield served


# A page's websocket: commands are executed, and changes are sent as fast as the page reads.

#: Shortest time (s, wall clock) between two rounds of queued messages to a page.
MESSAGE_PERIOD_S = 0.05
#: Longest time (s, wall clock) for a page to accept a message. A page that takes longer is
#: disconnected.
SEND_TIMEOUT_S = 30.0


class LivePage:
    """Websocket of an open page, with a queue that never blocks the sender.

    Of the messages of one kind, only the newest is queued.
    """

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self._queued: dict[str, Callable[[], Message]] = {}
        self._has_queued = asyncio.Event()

    def queue(self, kind: str, message: Callable[[], Message]) -> None:
        """Queue a message for the page in place of an older message of its kind.

        `message` is called when the message is sent. An empty message is not sent.
        """
        self._queued[kind] = message
        self._has_queued.set()

    def refusal(self, number: Any, reason: str) -> Message:
        """Return the answer to a refused message of the page.

        `number` is None if the message has no number.
        """
        return {"type": "refused", "number": number, "message": reason}

    async def serve(self, obey: Callable[[Message], Awaitable[Message]]) -> None:
        """Execute the page's commands and send queued messages, until the page closes.

        `obey` executes a command and returns the answer.
        """
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._obey(obey))
                for task in self.sender_tasks():
                    group.create_task(task)
        # These errors mean, in this order: the page was closed, it was closed while another task
        # was sending, or it does not read.
        except* (WebSocketDisconnect, RuntimeError, TimeoutError):
            pass

    def sender_tasks(self) -> list[Any]:
        """Return the coroutines that send messages while the page is open."""
        return [self._send_queued()]

    async def send(self, message: Message | bytes) -> None:
        """Send a message to the page.

        Raises TimeoutError if the page does not read.
        """
        async with asyncio.timeout(SEND_TIMEOUT_S):
            if isinstance(message, bytes):
                await self.socket.send_bytes(message)
            else:
                await self.socket.send_json(message)

    async def _obey(self, obey: Callable[[Message], Awaitable[Message]]) -> None:
        while True:
            number, frame = None, await self.socket.receive()
            if frame["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(frame.get("code", 1005))
            try:
                request_data = parse_object(frame.get("text") or "")
                number = request_data.get("number")
                answer = await obey(request_data)
            except RefusedError as error:
                answer = self.refusal(number, str(error))
            await self.send(answer)

    async def _send_queued(self) -> None:
        while True:
            await self._has_queued.wait()
            self._has_queued.clear()
            while self._queued:
                if message := self._queued.pop(next(iter(self._queued)))():
                    await self.send(message)
            await asyncio.sleep(MESSAGE_PERIOD_S)
