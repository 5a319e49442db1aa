"""The panel's pages on this machine: files, what a page needs once, and a websocket of changes."""

from __future__ import annotations

import asyncio
import errno
import json
import socket
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from cam_rig.drawing import colours
from cam_rig.errors import CamRigError, ConfigError, RefusedError
from cam_rig.panel.board import Board
from cam_rig.panel.guard import Guard
from cam_rig.panel.worker import WorkerLostError, ask, worker
from cam_rig.viewer.server.process import HOST

STATIC = Path(__file__).parent / "static"
#: A law rests when it has not changed for so long, s.
REST_S = 0.15
#: Bytes of a page's message, and of a request's body, at most.
MAX_MESSAGE = 1 << 16
#: Curves of the page in the colours of the rig's other pictures.
COLOURS = {
    "lift": colours.LIFT,
    "velocity": colours.VELOCITY,
    "acceleration": colours.ACCELERATION,
    "jerk": colours.BLACK,
    "force": colours.FORCE,
    "level": colours.LEVEL,
    "contour": colours.BLUE,
    "pitch": colours.GREEN,
    "fault": colours.VERMILION,
    "ghost": colours.GREY,
}


class BoardServer:
    """The application of one board, for every page that shows it."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self._pages: set[WebSocket] = set()
        self._changed = asyncio.Event()
        self.app = Starlette(
            routes=[
                Route("/", self._index),
                Route("/board", self._board),
                Route("/other/{cam}", self._other),
                Route("/save", self._save, methods=["POST"]),
                WebSocketRoute("/changes", self._changes),
                Mount("/static", StaticFiles(directory=STATIC)),
            ],
            lifespan=self._lifespan,
        )

    @asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        resting = asyncio.create_task(self._answer_at_rest())
        try:
            yield
        finally:
            resting.cancel()
            with suppress(asyncio.CancelledError):
                await resting

    async def _index(self, _: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def _board(self, _: Request) -> Response:
        shades = {name: colours.web(colour) for name, colour in COLOURS.items()}
        return JSONResponse(self.board.page() | {"colours": shades})

    async def _other(self, request: Request) -> Response:
        try:
            return JSONResponse(self.board.other(request.path_params["cam"]))
        except CamRigError as error:
            return JSONResponse({"words": str(error)}, 404)

    async def _save(self, request: Request) -> Response:
        try:
            body = await _body(request)
            path = self.board.save(body.get("name"), body.get("ordinates"))
        except CamRigError as error:
            return JSONResponse({"words": str(error)}, 409)
        return JSONResponse({"path": str(path)})

    async def _changes(self, page: WebSocket) -> None:
        """Changes of one page, each answered at once; other pages follow."""
        await page.accept()
        try:
            await page.send_json(self._state() | self.board.at_once())
            self._pages.add(page)
            self._changed.set()
            while True:
                await self._take(page, await page.receive_text())
        except WebSocketDisconnect:
            pass
        finally:
            self._pages.discard(page)

    async def _take(self, page: WebSocket, text: str) -> None:
        number: Any = None
        try:
            change = _object(text)
            number = change.get("number")
            self.board.take(change.get("ordinates"), change.get("rpm"))
        except RefusedError as error:
            await page.send_json({"type": "refused", "number": number, "words": str(error)})
            return
        answer = {"type": "exact", "number": number} | self.board.at_once()
        await page.send_json(answer)
        await self._send_to(self._pages - {page}, answer | self._state())
        self._changed.set()

    def _state(self) -> dict[str, Any]:
        """For a page that did not make the last change."""
        ordinates = self.board.ordinates.tolist()
        return {"type": "moved", "number": None, "ordinates": ordinates, "rpm": self.board.rpm}

    async def _send_to(self, pages: set[WebSocket], message: dict[str, Any]) -> None:
        for page in list(pages):
            with suppress(WebSocketDisconnect, RuntimeError):  # closed; its own task sees to it
                await page.send_json(message)

    async def _answer_at_rest(self) -> None:
        """What takes longer, of the last law alone, once it has rested."""
        while True:
            async with worker(self.board.cam, self.board.rig) as process:
                try:
                    while True:
                        await self._answer_once(process)
                except WorkerLostError as error:  # the next one answers the next change
                    message = {"type": "rest", "version": self.board.version, "words": str(error)}
                    await self._send_to(self._pages, message)

    async def _answer_once(self, process: asyncio.subprocess.Process) -> None:
        await self._rest()
        asked = {"type": "rest", "version": self.board.version, "rpm": self.board.rpm}
        found = await ask(process, self.board.law(), self.board.rpm)
        await self._send_to(self._pages, asked | found)

    async def _rest(self) -> None:
        """Wait for a change, and then for none."""
        await self._changed.wait()
        while self._changed.is_set():
            self._changed.clear()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._changed.wait(), REST_S)


async def _body(request: Request) -> dict[str, Any]:
    data = b""
    async for chunk in request.stream():
        data += chunk
        if len(data) > MAX_MESSAGE:
            raise RefusedError(f"request: allowed: {MAX_MESSAGE} bytes")
    return _object(data)


def _object(text: str | bytes) -> dict[str, Any]:
    """A JSON object.

    Raises
    ------
    RefusedError : it is none
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise RefusedError("message: allowed: a JSON object")
    return found


class ServedPanel:
    """A panel that is being served, at ``address``."""

    def __init__(self, address: str, ended: threading.Event) -> None:
        self.address, self._ended = address, ended

    def wait(self) -> None:
        """Until Ctrl-C.

        Raises
        ------
        CamRigError : the server ended of itself
        """
        # Not the thread's join: one that Ctrl-C interrupts takes the thread for ended (3.11).
        self._ended.wait()
        raise CamRigError("the panel's server ended")


@contextmanager
def serve(board: Board, port: int = 0) -> Iterator[ServedPanel]:
    """Serve a board on this machine alone, as long as the context lasts.

    Parameters
    ----------
    port : 0 takes a free one

    Raises
    ------
    ConfigError : the port is in use, or may not be taken
    """
    with _listener(port) as listener:
        guard = Guard(BoardServer(board).app, int(listener.getsockname()[1]))
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
            yield ServedPanel(guard.address, ended)
        finally:
            server.should_exit = True
            thread.join()


def _listener(port: int) -> socket.socket:
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
