"""A process beside the server for what takes longer than a page may wait: `exact.at_rest`.

It reads a law a line and writes what that comes to a line, as JSON. It ends when its input does:
however the server ends, it is not left behind.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from typing import Any

import numpy as np

from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.schema import CamConfig, RigConfig

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
    from cam_rig.panel.board.exact import at_rest, file_jump

    first = json.loads(sys.stdin.readline())
    cam, rig = CamConfig.model_validate(first["cam"]), RigConfig.model_validate(first["rig"])
    own = {}
    if first["file"] is not None:
        own = {"file_jump": file_jump(CamConfig.model_validate(first["file"]), rig)}
    for line in sys.stdin:
        asked = json.loads(line)
        law = Law(cam.name, np.array(asked["breaks"]), np.array(asked["ordinates"]))
        print(json.dumps(at_rest(cam, law, rig, asked["rpm"]) | own), flush=True)


if __name__ == "__main__":
    main()
