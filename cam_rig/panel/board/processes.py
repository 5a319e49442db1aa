"""The server's end of its `worker` processes: of the law that rests, and of a design."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from cam_rig.errors import CamRigError, OutputError, RefusedError
from cam_rig.laws import Law
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.files import designed_path, require_name, write_new
from cam_rig.panel.server import post
from cam_rig.schema import CamConfig, RigConfig, load_cam

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


def worker(
    cam: CamConfig, rig: RigConfig, file: CamConfig | None
) -> AbstractAsyncContextManager[Process]:
    """The process that answers for laws of a cam; beside each for that of a ``file``, if any."""
    own = None if file is None else file.model_dump()
    return beside({"cam": cam.model_dump(), "rig": rig.model_dump(), "file": own})


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
        if out.exists():
            raise OutputError(f"{out}: exists already, not overwriting; move it")
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
    """The design's end for the pages, its file written."""
    if "words" in found:
        return found
    if "text" not in found:
        return {"words": "the design's process ended before it had a law"}
    try:
        write_new(out, found.pop("text"))
    except OutputError as error:
        return {"words": str(error)}
    return found | {"path": str(out)}
