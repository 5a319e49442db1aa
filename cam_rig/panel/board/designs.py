"""Designing on from a saved cam: one design at a time, in a process beside the server."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from cam_rig.errors import OutputError, RefusedError
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.files import designed_path, require_name, write_new
from cam_rig.panel.board.worker import beside
from cam_rig.panel.messages import post
from cam_rig.schema import CamConfig, load_cam

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
