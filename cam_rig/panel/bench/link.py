"""The server's end of the socket to the panel's node: commands out, what the nodes say in."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from cam_rig.errors import RunError
from cam_rig.live.line_socket import MAX_LINE, line_of, read_line

#: Wall time (s) that a node may take to answer a command.
ANSWER_S = 5.0


class NodeLink:
    """Takes the one connection of the panel's node; another one takes its place.

    Parameters
    ----------
    path : of the socket, in a folder that no other user can enter
    heard : called with each line that is not an answer
    """

    def __init__(self, path: Path, heard: Callable[[dict[str, Any]], None]) -> None:
        self._path, self._heard = path, heard
        self._writer: asyncio.StreamWriter | None = None
        self._asked: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._number, self._listens = 0, False

    @asynccontextmanager
    async def listening(self) -> AsyncIterator[None]:
        """Listen as long as the context lasts."""
        server = await asyncio.start_unix_server(self._serve, self._path, limit=MAX_LINE)
        try:
            yield
        finally:
            server.close()
            if self._writer is not None:
                self._writer.close()
            self._path.unlink(missing_ok=True)

    async def ask(self, command: dict[str, Any]) -> dict[str, Any]:
        """What a node answers: ``success``, and ``words``."""
        if self._writer is None:
            return {"success": False, "words": "the nodes are not there yet"}
        self._number += 1
        number, answer = self._number, asyncio.get_running_loop().create_future()
        self._asked[number] = answer
        try:
            self._writer.write(line_of(command | {"number": number}))
            return await asyncio.wait_for(answer, ANSWER_S)
        except TimeoutError:
            return {"success": False, "words": f"no answer within {ANSWER_S:g} s"}
        finally:
            self._asked.pop(number, None)

    def listen(self, listens: bool) -> None:
        """Have the samples of every tick sent, or not."""
        self._listens = listens
        if self._writer is not None:
            self._writer.write(line_of({"listen": listens}))

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._writer is not None:
            self._writer.close()
        self._writer = writer
        self.listen(self._listens)
        try:
            with suppress(ConnectionError, RunError):
                while line := await reader.readline():
                    self._take(read_line(line))
        finally:
            writer.close()
            if self._writer is writer:
                self._lost()

    def _take(self, message: dict[str, Any]) -> None:
        if "answer" not in message:
            return self._heard(message)
        answer = self._asked.get(message["answer"])
        if answer is not None and not answer.done():
            answer.set_result(message)
        return None

    def _lost(self) -> None:
        self._writer = None
        for answer in self._asked.values():
            if not answer.done():
                answer.set_result({"success": False, "words": "the panel's node has ended"})
