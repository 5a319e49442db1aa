"""One page of the bench: told as every live page is, and the sound if it listens."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any

from starlette.websockets import WebSocket

from cam_rig.panel.live_page import LivePage

#: Blocks of sound that wait for a page, at most: the oldest are dropped.
MAX_BLOCKS = 64


class BenchPage(LivePage):
    """A page that may listen."""

    def __init__(self, socket: WebSocket) -> None:
        super().__init__(socket)
        self.listens = False
        self._sound: deque[bytes] = deque(maxlen=MAX_BLOCKS)
        self._heard = asyncio.Event()

    def play(self, sound: bytes) -> None:
        """Send a block of sound, if the page listens."""
        if self.listens:
            self._sound.append(sound)
            self._heard.set()

    def telling(self) -> list[Any]:
        """Its sound beside the rest."""
        return [*super().telling(), self._play()]

    async def _play(self) -> None:
        while True:
            await self._heard.wait()
            self._heard.clear()
            while self._sound:
                await self.send(self._sound.popleft())
