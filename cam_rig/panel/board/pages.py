"""The drawing board's pages: its file, what a page needs once, and a websocket of changes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from cam_rig.errors import CamRigError
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.processes import Designs, WorkerLostError, ask, worker
from cam_rig.panel.live_page import LivePage
from cam_rig.panel.server import STATIC, post
from cam_rig.show import looks as colours

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
        self._pages: set[LivePage] = set()
        self._changed = asyncio.Event()
        self._designs = Designs(board, self._tell)
        self.routes = (
            Route("/", self._index),
            Route("/board", self._board),
            Route("/other/{cam}", self._other),
            post("/save", self._save),
            post("/dxf", self._dxf),
            *self._designs.routes,
            WebSocketRoute("/changes", self._changes),
        )

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """Answer what takes longer, as long as the pages are served."""
        resting = asyncio.create_task(self._answer_at_rest())
        try:
            yield
        finally:
            await self._designs.end()
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

    async def _save(self, body: dict[str, Any]) -> dict[str, Any]:
        return self.board.saved(body.get("name"), body.get("ordinates"))

    async def _dxf(self, body: dict[str, Any]) -> Response:
        text = await asyncio.to_thread(self.board.dxf, body.get("ordinates"))
        return Response(text, media_type="image/vnd.dxf")

    async def _changes(self, socket: WebSocket) -> None:
        """Changes of one page, each answered at once; other pages follow."""
        await socket.accept()
        page = LivePage(socket)
        page.tell("moved", lambda: self._state() | self.board.at_once())
        self._pages.add(page)
        self._changed.set()
        try:
            await page.serve(partial(self._take, page), _refused)
        finally:
            self._pages.discard(page)

    async def _take(self, page: LivePage, change: dict[str, Any]) -> dict[str, Any]:
        self.board.take(change.get("ordinates"), change.get("rpm"))
        answer = {"type": "exact", "number": change.get("number")} | self.board.at_once()
        self._tell(answer | self._state(), self._pages - {page})
        self._changed.set()
        return answer

    def _state(self) -> dict[str, Any]:
        """For a page that did not make the last change."""
        ordinates = self.board.ordinates.tolist()
        return {"type": "moved", "number": None, "ordinates": ordinates, "rpm": self.board.rpm}

    def _tell(self, message: dict[str, Any], pages: set[LivePage] | None = None) -> None:
        """Tell pages, all unless some are named."""
        for page in self._pages if pages is None else pages:
            page.tell(message["type"], lambda: message)

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
                    self._tell(message)

    async def _answer_once(self, process: asyncio.subprocess.Process) -> None:
        await self._rest()
        asked = {"type": "rest", "version": self.board.version, "rpm": self.board.rpm}
        found = await ask(process, self.board.law(), self.board.rpm)
        self._tell(asked | found)

    async def _rest(self) -> None:
        """Wait for a change, and then for none."""
        await self._changed.wait()
        while self._changed.is_set():
            self._changed.clear()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._changed.wait(), REST_S)


def _refused(number: Any, words: str) -> dict[str, Any]:
    return {"type": "refused", "number": number, "words": words}
