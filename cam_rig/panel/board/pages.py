"""The drawing board's pages: its file, what a page needs once, and a websocket of changes."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from cam_rig.errors import CamRigError, OutputError, RefusedError
from cam_rig.files import require_new, write_new
from cam_rig.laws import Law
from cam_rig.panel.board.board import Board, designed_path, require_name
from cam_rig.panel.server import LivePage, PanelPages, get, page_file, post
from cam_rig.schema import CamConfig, load_cam
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


class BoardPages(PanelPages):
    """The pages of one board: files, what a page needs once, and a websocket of changes."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self._pages: set[LivePage] = set()
        self._changed = asyncio.Event()
        self._designs = Designs(board, self._tell)
        self.routes = (
            page_file("/", "board"),
            get("/board", self._board),
            get("/other/{cam}", self._other),
            post("/save", self._save),
            post("/dxf", self._dxf),
            post("/open", self._open),
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

    async def _board(self, _: dict[str, Any]) -> dict[str, Any]:
        shades = {name: colours.web(colour) for name, colour in COLOURS.items()}
        return self.board.page() | {"colours": shades}

    async def _other(self, asked: dict[str, Any]) -> dict[str, Any]:
        return self.board.other(asked["cam"])

    async def _save(self, body: dict[str, Any]) -> dict[str, Any]:
        return self.board.saved(body.get("name"), body.get("ordinates"))

    async def _open(self, body: dict[str, Any]) -> dict[str, Any]:
        await asyncio.to_thread(self.board.open, body.get("text"))
        self._tell({"type": "opened"})
        self._changed.set()
        return {"name": self.board.file.name}

    async def _dxf(self, body: dict[str, Any]) -> Response:
        text = await asyncio.to_thread(self.board.dxf, body.get("ordinates"))
        return Response(text, media_type="image/vnd.dxf")

    async def _changes(self, socket: WebSocket) -> None:
        await socket.accept()
        shown = LivePage(socket)
        shown.tell("moved", lambda: self._state() | self.board.at_once())
        self._pages.add(shown)
        self._changed.set()
        try:
            await shown.serve(partial(self._take, shown))
        finally:
            self._pages.discard(shown)

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
        for page in self._pages if pages is None else pages:
            page.tell(message["type"], lambda: message)

    async def _answer_at_rest(self) -> None:
        """What takes longer, of the last law alone, once it has rested."""
        board = self.board
        while True:
            drawn, start = board.drawn, board.drawn.start
            first: dict[str, Any] = {"cam": board.cam.model_dump(), "rig": board.rig.model_dump()}
            first["file"] = None if start.own or start.exact else board.file.model_dump()
            async with beside(first) as process:
                try:
                    while board.drawn is drawn:  # until another file is opened
                        await self._answer_once(process)
                except WorkerLostError as error:  # the next one answers the next change
                    message = {"type": "rest", "version": self.board.version, "words": str(error)}
                    self._tell(message)

    async def _answer_once(self, process: asyncio.subprocess.Process) -> None:
        drawn = self.board.drawn
        await self._rest()
        if self.board.drawn is not drawn:
            self._changed.set()
            return
        asked = {"type": "rest", "version": self.board.version, "rpm": self.board.rpm}
        found = await ask(process, self.board.law(), self.board.rpm)
        self._tell(asked | found)

    async def _rest(self) -> None:
        await self._changed.wait()
        while self._changed.is_set():
            self._changed.clear()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._changed.wait(), REST_S)


# The server's end of its worker processes: of the law that rests, and of a design.

#: Bytes of a line, at most.
MAX_LINE = 1 << 24
WORKER, DESIGN = "cam_rig.panel.board.worker", "design"
Process = asyncio.subprocess.Process


class WorkerLostError(CamRigError):
    """The process ended; another one is to be started."""


@asynccontextmanager
async def beside(first: dict[str, Any], *arguments: str) -> AsyncIterator[Process]:
    """A worker that runs beside the server for as long as the context lasts, and its first line."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", WORKER, *arguments),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        start_new_session=True,  # Ctrl-C reaches the server alone
        limit=MAX_LINE,
    )
    try:
        _send(process, first)
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


async def ask(process: Process, law: Law, rpm: float) -> dict[str, Any]:
    """What a law comes to at a speed (rpm)."""
    asked = {"breaks": law.breaks.tolist(), "ordinates": law.ordinates.tolist(), "rpm": rpm}
    assert process.stdout is not None
    try:
        _send(process, asked)
        line = await process.stdout.readline()
    except (BrokenPipeError, ConnectionResetError):
        line = b""
    if not line:
        raise WorkerLostError("the process of jump speed and level ended")
    found: dict[str, Any] = json.loads(line)
    return found


def _send(process: Process, data: dict[str, Any]) -> None:
    assert process.stdin is not None
    process.stdin.write(json.dumps(data).encode() + b"\n")


class Designs:
    """Designs from the cams that a board saved, one at a time; ``tell`` tells every page."""

    def __init__(self, board: Board, tell: Callable[[dict[str, Any]], None]) -> None:
        self._board, self._tell = board, tell
        self._running: asyncio.Task[None] | None = None
        self.routes = (
            post("/design", self._begin),
            Route("/design/stop", self._stop, methods=["POST"]),
        )

    async def end(self) -> None:
        """No design outlives the server."""
        if self._running is not None:
            self._running.cancel()
            with suppress(asyncio.CancelledError):
                await self._running
            self._running = None

    async def _begin(self, body: dict[str, Any]) -> Response:
        name = require_name(body.get("name"))
        if self._running is not None and not self._running.done():
            raise RefusedError("design: one is running; allowed: one at a time, so stop it")
        start = self._board.out / f"{name}.yaml"
        out = designed_path(start)
        require_new(out)
        self._running = asyncio.create_task(self._run(load_cam(start), out))
        return JSONResponse({"path": str(out)}, 202)

    async def _stop(self, _: Request) -> Response:
        await self.end()
        self._tell({"type": "design", "stopped": True})
        return JSONResponse({})

    async def _run(self, cam: CamConfig, out: Path) -> None:
        """Tell the pages each better law, and write the last."""
        rig, found = self._board.rig.model_dump(), dict[str, Any]()
        first = {"cam": cam.model_dump(), "rig": rig, "name": out.stem}
        async with beside(first, DESIGN) as process:
            assert process.stdout is not None
            while line := await process.stdout.readline():
                found = json.loads(line)
                if "so_far_rpm" in found:
                    self._tell({"type": "design"} | found)
        self._tell({"type": "design"} | _written(found, out))


def _written(found: dict[str, Any], out: Path) -> dict[str, Any]:
    if "words" in found:
        return found
    if "text" not in found:
        return {"words": "the design's process ended before it had a law"}
    try:
        write_new(out.parent, {out.name: found.pop("text")})
    except OutputError as error:
        return {"words": str(error)}
    return found | {"path": str(out)}
