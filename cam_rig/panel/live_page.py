"""A page's websocket: what it asks is done, and what is new it is told, as fast as it reads."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from cam_rig.errors import RefusedError
from cam_rig.panel.server import read_frame

#: Wall time (s) between two messages of a kind, at least.
TELL_EVERY_S = 0.05
#: Wall time (s) in which a page must have room for a message, or it is dropped.
READS_WITHIN_S = 30.0
Message = dict[str, Any]


class LivePage:
    """A page that waits for nobody and is waited for by nobody.

    Of each kind of message only the newest waits for it. One that reads nothing, of a browser that
    is suspended, is dropped alone.
    """

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self._newest: dict[str, Callable[[], Message]] = {}
        self._new = asyncio.Event()

    def tell(self, kind: str, message: Callable[[], Message]) -> None:
        """Have it told, in place of what still waits of a kind; made when it is sent."""
        self._newest[kind] = message
        self._new.set()

    async def serve(
        self,
        obey: Callable[[Message], Awaitable[Message]],
        refused: Callable[[Any, str], Message],
    ) -> None:
        """Do what it asks and tell it what is new, until it is closed.

        ``obey`` gives what came of a message; where it raises a RefusedError, ``refused`` gives
        the answer to the message of a number (None where it has none), with words.
        """
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._obey(obey, refused))
                for telling in self.telling():
                    group.create_task(telling)
        # Closed; closed while another task sends; reads nothing.
        except* (WebSocketDisconnect, RuntimeError, TimeoutError):
            pass

    def telling(self) -> list[Any]:
        """What runs beside, as long as the page is there."""
        return [self._tell()]

    async def send(self, message: Message | bytes) -> None:
        """Send a message; TimeoutError where the page reads nothing."""
        async with asyncio.timeout(READS_WITHIN_S):
            if isinstance(message, bytes):
                await self.socket.send_bytes(message)
            else:
                await self.socket.send_json(message)

    async def _obey(
        self,
        obey: Callable[[Message], Awaitable[Message]],
        refused: Callable[[Any, str], Message],
    ) -> None:
        while True:
            number = None
            try:
                asked = await read_frame(self.socket)
                number = asked.get("number")
                answer = await obey(asked)
            except RefusedError as error:
                answer = refused(number, str(error))
            await self.send(answer)

    async def _tell(self) -> None:
        while True:
            await self._new.wait()
            self._new.clear()
            while self._newest:
                message = self._newest.pop(next(iter(self._newest)))
                await self.send(message())
            await asyncio.sleep(TELL_EVERY_S)
