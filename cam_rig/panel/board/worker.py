"""A process beside the server for what takes longer than a page may wait: `exact.at_rest`.

It reads a law a line and writes what that comes to a line, as JSON. It ends when its input does:
however the server ends, it is not left behind.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
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


class WorkerLostError(CamRigError):
    """The process ended; another one is to be started."""


@asynccontextmanager
async def beside(module: str, first: dict[str, Any]) -> AsyncIterator[asyncio.subprocess.Process]:
    """A module that runs beside the server for as long as the context lasts.

    ``first`` is the first line of its input.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", module),
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
) -> AbstractAsyncContextManager[asyncio.subprocess.Process]:
    """The process that answers for the laws of a cam.

    ``file`` is the cam whose own law is answered for beside each: see `exact.file_jump`.
    """
    own = None if file is None else file.model_dump()
    first = {"cam": cam.model_dump(), "rig": rig.model_dump(), "file": own}
    return beside("cam_rig.panel.board.worker", first)


async def ask(process: asyncio.subprocess.Process, law: Law, rpm: float) -> dict[str, Any]:
    """What a law comes to at a speed (rpm).

    Raises
    ------
    WorkerLostError : the process ended
    """
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


def _send(process: asyncio.subprocess.Process, data: dict[str, Any]) -> None:
    assert process.stdin is not None
    process.stdin.write(json.dumps(data).encode() + b"\n")


def main() -> None:
    """Answer lines of standard input until it ends."""
    from cam_rig.panel.board.drawable import at_rest, file_jump

    first = json.loads(sys.stdin.readline())
    cam, rig = CamConfig.model_validate(first["cam"]), RigConfig.model_validate(first["rig"])
    own = {}
    if first["file"] is not None:
        own = {"file_jump": file_jump(CamConfig.model_validate(first["file"]), rig)}
    for line in sys.stdin:
        asked = json.loads(line)
        law = Law(cam.name, np.array(asked["breaks"]), np.array(asked["ordinates"]))
        print(json.dumps(at_rest(cam, law, rig, asked["rpm"]) | own), flush=True)


# Designing on from a saved cam: one design at a time, in a process beside the server.

MODULE = "cam_rig.panel.board.designer"


class Designs:
    """Designs from the cams that a board saved.

    Parameters
    ----------
    tell : sends a message to every page
    """

    def __init__(self, board: Board, tell: Callable[[dict[str, Any]], None]) -> None:
        self._board, self._tell = board, tell
        self._running: asyncio.Task[None] | None = None
        self.routes = (
            post("/design", self._begin),
            Route("/design/stop", self._stop, methods=["POST"]),
        )

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """No design outlives the server."""
        try:
            yield
        finally:
            await self._end()

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
        await self._end()
        self._tell({"type": "design", "stopped": True})
        return JSONResponse({})

    async def _end(self) -> None:
        if self._running is not None:
            self._running.cancel()
            with suppress(asyncio.CancelledError):
                await self._running
            self._running = None

    async def _run(self, cam: CamConfig, out: Path) -> None:
        """Tell the pages each better law, and write the last."""
        first = {
            "cam": cam.model_dump(),
            "rig": self._board.rig.model_dump(),
            "name": out.stem,
        }
        found: dict[str, Any] = {}
        async with beside(MODULE, first) as process:
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


if __name__ == "__main__":
    main()
