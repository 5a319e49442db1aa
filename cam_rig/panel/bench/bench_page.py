"""One page of the bench: the newest state as fast as it takes it, and the sound if it listens."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

#: Wall time (s) between two messages on the state, at least.
TELL_EVERY_S = 0.05
#: Blocks of sound that wait for a page, at most: the oldest are dropped.
MAX_BLOCKS = 64


class BenchPage:
    """A page; one that takes nothing, in a tab that sleeps, holds no other one up.

    Parameters
    ----------
    shown : gives what a page is told of the bench
    """

    def __init__(self, socket: WebSocket, shown: Callable[[BenchPage], dict[str, Any]]) -> None:
        self.socket, self._shown = socket, shown
        self.listens = False
        #: To be set when there is something new.
        self.changed = asyncio.Event()
        self._sound: deque[bytes] = deque(maxlen=MAX_BLOCKS)
        self._heard = asyncio.Event()

    def play(self, sound: bytes) -> None:
        """Send a block of sound, if the page listens."""
        if self.listens:
            self._sound.append(sound)
            self._heard.set()

    @asynccontextmanager
    async def told(self) -> AsyncIterator[None]:
        """Tell the page, as long as the context lasts."""
        tasks = [asyncio.create_task(part()) for part in (self._tell, self._play)]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
                with suppress(asyncio.CancelledError):
                    await task

    async def _tell(self) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):  # closed; who receives sees to it
            while True:
                await self.changed.wait()
                self.changed.clear()
                await self.socket.send_json(self._shown(self))
                await asyncio.sleep(TELL_EVERY_S)

    async def _play(self) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await self._heard.wait()
                self._heard.clear()
                while self._sound:
                    await self.socket.send_bytes(self._sound.popleft())
