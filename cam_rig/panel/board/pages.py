"""Pages of the drawing board, and the server's side of its worker processes."""

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

#: Time (s, wall clock) without a change of the law after which the results that take longer to
#: compute are requested.
PAUSE_S = 0.15
#: Colours of the page's curves, as in the rig's other figures.
COLOURS = {
    "lift": colours.web(colours.LIFT),
    "velocity": colours.web(colours.VELOCITY),
    "acceleration": colours.web(colours.ACCELERATION),
    "jerk": colours.web(colours.BLACK),
    "force": colours.web(colours.FORCE),
    "torque": colours.web(colours.SPEED),
    "contour": colours.web(colours.BLUE),
    "pitch": colours.web(colours.GREEN),
    "ghost": colours.web(colours.GREY),
}


class BoardPages(PanelPages):
    """Pages of one drawing board: HTML file, initial data, and a websocket of changes."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self._pages: set[LivePage] = set()
        self._changed = asyncio.Event()
        self._designs = Designs(board, self._broadcast)
        self.routes = (
            page_file("/", "board"),
            get("/board", lambda _: self.board.page_data() | {"colours": COLOURS}),
            get("/other/{cam}", lambda path: self.board.second_law(path["cam"])),
            post("/save", lambda b: self.board.save_for_page(b.get("name"), *_drawing(b))),
            post("/dxf", self._dxf),
            post("/open", self._open),
            post("/choose", self._choose),
            *self._designs.routes,
            WebSocketRoute("/changes", self._changes),
        )

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """Compute the slow results for the law of the board while the context is active.

        They are computed in a worker process, after each pause in the changes.
        """
        answering = asyncio.create_task(self._answer_pauses())
        try:
            yield
        finally:
            await self._designs.stop()
            answering.cancel()
            with suppress(asyncio.CancelledError):
                await answering

    async def _open(self, body: dict[str, Any]) -> dict[str, Any]:
        await asyncio.to_thread(self.board.open, body.get("text"))
        return self._reload_pages()

    async def _choose(self, body: dict[str, Any]) -> dict[str, Any]:
        await asyncio.to_thread(self.board.choose, body.get("cam"), body.get("rig"))
        return self._reload_pages()

    def _reload_pages(self) -> dict[str, Any]:
        """Let all pages load the board again, and return the names of its cam and rig."""
        self._broadcast({"type": "opened"})
        self._changed.set()
        return {"cam": self.board.file.name, "rig": self.board.rig.name}

    async def _dxf(self, body: dict[str, Any]) -> Response:
        text = await asyncio.to_thread(self.board.dxf, *_drawing(body))
        return Response(text, media_type="image/vnd.dxf")

    async def _changes(self, socket: WebSocket) -> None:
        await socket.accept()
        page = LivePage(socket)
        page.queue("changed", lambda: self.board.evaluate_fast() | self._changed_values())
        self._pages.add(page)
        self._changed.set()
        try:
            await page.serve(partial(self._apply_change, page))
        finally:
            self._pages.discard(page)

    async def _apply_change(self, page: LivePage, change: dict[str, Any]) -> dict[str, Any]:
        ordinates, base_radius_mm = _drawing(change)
        if change.get("generation", self.board.generation) != self.board.generation:
            raise RefusedError("the board has another cam or rig now; load the page again")
        self.board.update(ordinates, change.get("rpm"), base_radius_mm)
        results = self.board.evaluate_fast()
        self._broadcast(results | self._changed_values(), self._pages - {page})
        self._changed.set()
        return {"type": "fast", "number": change.get("number")} | results

    def _changed_values(self) -> dict[str, Any]:
        """Return the board's state for a page that did not make the last change."""
        return {
            "type": "changed",
            "number": None,
            "generation": self.board.generation,
            "ordinates": self.board.ordinates.tolist(),
            "rpm": self.board.rpm,
            "base_radius_mm": self.board.base_radius_mm,
        }

    def _broadcast(self, message: dict[str, Any], pages: set[LivePage] | None = None) -> None:
        for page in self._pages if pages is None else pages:
            page.queue(message["type"], lambda: message)

    async def _answer_pauses(self) -> None:
        """Send the slow results for the latest law to the pages, after each pause.

        A pause is the time `PAUSE_S` without a change of the law.
        """
        board = self.board
        while True:
            machine = board.machine
            request = {"cam": board.cam.model_dump(), "rig": board.rig.model_dump()}
            async with worker_process(request) as process:
                try:
                    while board.machine == machine:  # a new worker follows for another machine
                        await self._answer_once(process)
                except WorkerLostError as error:  # the next worker answers the next change
                    self._broadcast(self._full_message() | {"message": str(error)})

    async def _answer_once(self, process: asyncio.subprocess.Process) -> None:
        machine = self.board.machine
        await self._changed.wait()
        while self._changed.is_set():  # until there is no change for a while
            self._changed.clear()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._changed.wait(), PAUSE_S)
        if self.board.machine != machine:
            self._changed.set()
            return
        message, board = self._full_message(), self.board
        results = await request_results(process, board.law(), board.rpm, board.base_radius_mm)
        if board.machine == machine:
            self._broadcast(message | results)

    def _full_message(self) -> dict[str, Any]:
        return {"type": "full", "version": self.board.version, "rpm": self.board.rpm}


def _drawing(body: dict[str, Any]) -> tuple[Any, Any]:
    """Return ordinates and base radius (mm) of a request of a page."""
    return body.get("ordinates"), body.get("base_radius_mm")


# The server's end of its worker processes, for the slow results of a law and for a design.

#: Largest size of a line from a worker process, bytes.
MAX_LINE = 1 << 24
#: Name of the Python module that a worker process runs.
WORKER = "cam_rig.panel.board.worker"
#: Command-line argument with which a worker process computes a design.
DESIGN = "design"
#: Worker process.
Process = asyncio.subprocess.Process


class WorkerLostError(CamRigError):
    """Error of a worker process that has ended, so that another must be started."""


@asynccontextmanager
async def worker_process(request: dict[str, Any], *arguments: str) -> AsyncIterator[Process]:
    """Start a worker process, and end it when the context ends.

    `request` is its first line of input, and `arguments` are its command-line arguments.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", WORKER, *arguments),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        start_new_session=True,  # Ctrl-C reaches only the server
        limit=MAX_LINE,
    )
    try:
        _send(process, request)
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


async def request_results(
    process: Process, law: Law, rpm: float, base_radius_mm: float
) -> dict[str, Any]:
    """Request the slow results for a law at a speed (rpm) from a worker process.

    They are the results of `evaluation.evaluate_full` for a base radius (mm). Raises
    WorkerLostError if the process has ended.
    """
    request = {"breaks": law.breaks.tolist(), "ordinates": law.ordinates.tolist()}
    request |= {"rpm": rpm, "base_radius_mm": base_radius_mm}
    assert process.stdout is not None
    try:
        _send(process, request)
        line = await process.stdout.readline()
    except (BrokenPipeError, ConnectionResetError):
        line = b""
    if not line:
        raise WorkerLostError("the worker process of jump speed and level has ended")
    results: dict[str, Any] = json.loads(line)
    return results


def _send(process: Process, data: dict[str, Any]) -> None:
    assert process.stdin is not None
    process.stdin.write(json.dumps(data).encode() + b"\n")


class Designs:
    """Runner of optimisations (designs) of the cams that a board has saved.

    Only one of them runs at a time. `broadcast` sends a message to all pages.
    """

    def __init__(self, board: Board, broadcast: Callable[[dict[str, Any]], None]) -> None:
        self._board, self._broadcast = board, broadcast
        self._running: asyncio.Task[None] | None = None
        self.routes = (
            post("/design", self._start),
            Route("/design/stop", self._stop, methods=["POST"]),
        )

    async def stop(self) -> None:
        """Stop the running optimisation, so that it does not outlive the server."""
        if self._running is not None:
            self._running.cancel()
            with suppress(asyncio.CancelledError):
                await self._running
            self._running = None

    async def _start(self, body: dict[str, Any]) -> Response:
        name = require_name(body.get("name"))
        if self._running is not None and not self._running.done():
            raise RefusedError("design: another design is running; stop it first")
        path = self._board.out / f"{name}.yaml"
        out = designed_path(path)
        require_new(out)
        self._running = asyncio.create_task(self._run(load_cam(path), out))
        return JSONResponse({"path": str(out)}, 202)

    async def _stop(self, _: Request) -> Response:
        await self.stop()
        self._broadcast({"type": "design", "stopped": True})
        return JSONResponse({})

    async def _run(self, cam: CamConfig, out: Path) -> None:
        """Optimise a cam, send each better law to the pages, and write the last to a file.

        `out` is the path of the new cam file.
        """
        rig, result = self._board.rig.model_dump(), dict[str, Any]()
        request = {"cam": cam.model_dump(), "rig": rig, "name": out.stem}
        async with worker_process(request, DESIGN) as process:
            assert process.stdout is not None
            while line := await process.stdout.readline():
                result = json.loads(line)
                if "best_rpm" in result:
                    self._broadcast({"type": "design"} | result)
        if "text" in result:
            result["path"] = str(out)
            try:
                write_new(out.parent, {out.name: result.pop("text")})
            except OutputError as error:
                result = {"message": str(error)}
        elif "message" not in result:
            result = {"message": "the worker process ended before the design had a law"}
        self._broadcast({"type": "design"} | result)
