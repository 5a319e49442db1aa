"""The drawing board's pages: its file, what a page needs once, and a websocket of changes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from cam_rig.drawing import colours
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.designs import Designs
from cam_rig.panel.board.worker import WorkerLostError, ask, worker
from cam_rig.panel.messages import read_body, read_object
from cam_rig.panel.server import STATIC

#: A law rests when it has not changed for so long, s.
REST_S = 0.15
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


class BoardPages:
    """The pages of one board: files, what a page needs once, and a websocket of changes."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self._pages: set[WebSocket] = set()
        self._changed = asyncio.Event()
        self._designs = Designs(board, lambda message: self._send_to(self._pages, message))
        self.routes = (
            Route("/", self._index),
            Route("/board", self._board),
            Route("/other/{cam}", self._other),
            Route("/save", self._save, methods=["POST"]),
            Route("/dxf", self._dxf, methods=["POST"]),
            *self._designs.routes,
            WebSocketRoute("/changes", self._changes),
        )

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """Answer what takes longer, as long as the pages are served."""
        resting = asyncio.create_task(self._answer_at_rest())
        try:
            async with self._designs.alive():
                yield
        finally:
            resting.cancel()
            with suppress(asyncio.CancelledError):
                await resting

    async def _index(self, _: Request) -> Response:
        return FileResponse(STATIC / "board" / "index.html")

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
            body = await read_body(request)
            found = self.board.saved(body.get("name"), body.get("ordinates"))
        except CamRigError as error:
            return JSONResponse({"words": str(error)}, 409)
        return JSONResponse(found)

    async def _dxf(self, request: Request) -> Response:
        try:
            body = await read_body(request)
            text = await asyncio.to_thread(self.board.dxf, body.get("ordinates"))
        except CamRigError as error:
            return JSONResponse({"words": str(error)}, 409)
        return Response(text, media_type="image/vnd.dxf")

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
            change = read_object(text)
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
        start = self.board.drawn.start
        file = None if start.own or start.exact else self.board.file
        while True:
            async with worker(self.board.cam, self.board.rig, file) as process:
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
