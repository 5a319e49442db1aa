"""The bench's pages: one of them holds the controls, all see the same."""

from __future__ import annotations

import asyncio
import base64
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import numpy as np
from starlette.responses import Response
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket

from cam_rig.errors import RefusedError
from cam_rig.panel.bench.controls import DONE, EMERGENCY_STOP, SETTINGS, BenchControls, NodeLink
from cam_rig.panel.bench.drawing import (
    MOTION,
    SOUND,
    Cams,
    LiveMotion,
    cam_picture,
    expected,
    jump_speeds,
)
from cam_rig.panel.bench.live_state import LiveState, to_csv
from cam_rig.panel.bench.runner import (
    MAX_ADDED_MASS,
    MAX_RPM,
    MIN_RPM,
    BenchRunner,
    Setup,
    add_cam,
    allowed_models,
    cam_names,
)
from cam_rig.panel.board.board import Board
from cam_rig.panel.server import LivePage, Message, PanelPages, csv_file, get, page_file, post
from cam_rig.schema import CamConfig
from cam_rig.show import looks as colours
from cam_rig.units import NS, FloatArray

# One page of the bench: told as every live page is, and what it watches and listens to.

#: Blocks of motion and of sound that wait for a page, at most: the oldest are dropped.
MAX_BLOCKS = 64
#: Wall time (s) between two messages of blocks: one costs more than what it holds.
STREAM_EVERY_S = 0.04
#: Wall time (s) between two messages of nothing but a level: nobody reads numbers faster.
LEVEL_EVERY_S = 0.1


class BenchPage(LivePage):
    """A page that may watch, and listen; ``shown`` is all that it may be told."""

    def __init__(self, socket: WebSocket, shown: Callable[[BenchPage], Message]) -> None:
        super().__init__(socket)
        self.listens = self.watches = False
        self._shown, self._told = shown, Message()
        self._level = asyncio.Event()
        self._blocks = {kind: deque[bytes](maxlen=MAX_BLOCKS) for kind in (MOTION, SOUND)}
        self._heard = asyncio.Event()

    def changed(self, soon: bool = True) -> None:
        """Tell it what is new, ``soon`` or as often as a level is."""
        if soon:
            self.tell("live", self._news)
        else:
            self._level.set()

    def _news(self) -> Message:
        """What is not as it was told; of readings, records until now, what they hold."""
        shown = self._shown(self)
        new = {k: v for k, v in shown.items() if k not in self._told or self._told[k] != v}
        self._told = shown
        if "readings" in new:
            new["readings"] = [vars(reading) for reading in new["readings"]]
        return new and {"type": "live"} | new

    async def _levels(self) -> None:
        while True:
            await self._level.wait()
            self._level.clear()
            self.tell("live", self._news)
            await asyncio.sleep(LEVEL_EVERY_S)

    def stream(self, kind: bytes, block: bytes) -> None:
        """Send a block of a tick, in its turn, with those of its kind that wait."""
        self._blocks[kind].append(block)
        self._heard.set()

    def refused(self, number: Any, words: str) -> dict[str, Any]:
        """As a command is answered."""
        return {"type": "answer", "success": False, "words": words, "answer": number}

    def telling(self) -> list[Any]:
        """Levels and blocks beside the rest."""
        return [*super().telling(), self._levels(), self._stream()]

    async def _stream(self) -> None:
        while True:
            await self._heard.wait()
            self._heard.clear()
            for kind, waiting in self._blocks.items():
                if blocks := b"".join(waiting):
                    waiting.clear()
                    await self.send(kind + blocks)
            await asyncio.sleep(STREAM_EVERY_S)


#: Speeds (rpm) of the knob.
KNOB = (20.0, 1000.0)
#: Cams in the chart, whose markers differ too.
CAM_COLOURS = (colours.BLUE, colours.VERMILION, colours.GREEN, colours.BLACK)
PACES = ("real_time", "0.1x", "0.25x", "0.5x", "2x", "5x", "free")


class BenchPages(PanelPages):
    """The live bench in a browser: ``cam`` is mounted first, then laws of the ``board`` may be."""

    def __init__(self, runner: BenchRunner, cam: CamConfig, board: Board) -> None:
        self._runner, self._board = runner, board
        add_cam(cam, runner.cams)
        self.live = LiveState(Setup.of(runner.rig, cam.name))
        self._link = NodeLink(runner.socket, self._heard)
        self._pages: list[BenchPage] = []  # the first one holds the controls
        self._controls = BenchControls(runner, self.live, self._link)
        self._cams = Cams(runner.folder)
        self._motion = LiveMotion(self._cams)
        self.routes = (
            page_file("/bench", "bench", self._begin),
            get("/bench/about", self._about),
            get("/bench/cam/{cam}", self._cam),
            get("/bench/readings.csv", self._csv),
            post("/bench/expected", self._expected),
            post("/bench/mount", self._mount),
            WebSocketRoute("/bench/live", self._live),
        )

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """Listen to the nodes and tell the pages, as long as they are served."""
        loop = asyncio.get_running_loop()
        self._runner.tell = lambda message: loop.call_soon_threadsafe(self._happened, message)
        try:
            async with self._link.listening():
                yield
        finally:
            self._runner.tell = lambda _message: None

    def _begin(self) -> None:
        if self.live.graph == "off":
            self._controls.set_up(self.live.setup)

    async def _about(self, _: dict[str, Any]) -> dict[str, Any]:
        rig, choices = self._runner.rig, {"cam": cam_names(self._runner.cams), "pacing": PACES}
        settings = {
            name: {"node": node, "choices": choices.get(name, spec.choices)}
            for name, (node, spec) in SETTINGS.items()
        }
        return {
            "rig": {"name": rig.name},
            "has_screen": self._runner.has_screen,
            "models": allowed_models(rig),
            "model": self.live.setup.model,
            "settings": settings,
            "knob": KNOB,
            "speeds": (MIN_RPM, MAX_RPM),
            "colours": [colours.web(colour) for colour in CAM_COLOURS],
            "max_added_mass": MAX_ADDED_MASS,
        }

    async def _cam(self, asked: dict[str, Any]) -> dict[str, Any]:
        """The picture of a cam that can be mounted."""
        return cam_picture(*self._cams(asked["cam"]))

    async def _expected(self, given: dict[str, Any]) -> dict[str, Any]:
        """What a set-up does at its speed once it has settled, and its jump speeds."""
        setup = self._controls.as_it_is(given)
        law, rig = self._cams(setup.cam)[1], setup.rig(self._runner.rig)
        jumps = {"jumps": await asyncio.to_thread(jump_speeds, law, rig, setup.model)}
        return await asyncio.to_thread(expected, setup, law, rig) | jumps

    async def _mount(self, body: dict[str, Any]) -> dict[str, Any]:
        """Put the law of some ordinates of the board on the bench; its nodes begin if need be."""
        cam = self._board.drawn_cam(self._controls.drawn_name(), body.get("ordinates"))
        await self._controls.mount(cam)
        return {"cam": cam.name}

    async def _csv(self, _: dict[str, Any]) -> Response:
        return csv_file("readings.csv", to_csv(self.live.readings))

    async def _live(self, socket: WebSocket) -> None:
        await socket.accept()
        shown = BenchPage(socket, self._shown)
        self._pages.append(shown)
        self._changed()
        try:
            await shown.serve(partial(self._obey, shown))
        finally:
            self._pages.remove(shown)  # the next one holds the controls
            self._listen()
            self._changed()

    async def _obey(self, page: BenchPage, command: dict[str, Any]) -> dict[str, Any]:
        try:
            answer = {"type": "answer"} | await self._done(page, command)
            return answer | {"answer": command.get("number")}
        finally:
            self._changed()

    async def _done(self, page: BenchPage, command: dict[str, Any]) -> dict[str, Any]:
        match command.get("do"):
            case "listen":
                page.listens = command.get("value") is True
                self._listen()
                return DONE
            case "watch":
                page.watches = command.get("value") is True
                self._listen()
                return DONE
            case "take_over":
                self._pages.remove(page)
                self._pages.insert(0, page)
                return DONE
        # An emergency stop is whoever's who sees the need.
        emergency = (command.get("do"), command.get("value")) == ("call", EMERGENCY_STOP)
        if page is not self._pages[0] and not emergency:
            raise RefusedError("another page holds the controls; allowed: after taking over")
        return await self._controls.obey(command)

    def _listen(self) -> None:
        self._link.listen(any(page.listens or page.watches for page in self._pages))

    def _heard(self, message: dict[str, Any]) -> None:
        if "samples" in message:
            data = np.frombuffer(base64.b64decode(message["samples"]), dtype="<f8")
            return self._sampled(data.reshape(message["shape"]))
        if "state" in message:
            self._runner.driven(message["state"]["time_ns"] / NS)
            self._motion.state(message["state"])
        self._changed(self.live.heard(message))

    def _sampled(self, rows: FloatArray) -> None:
        """A tick of the follower: seen where a page watches, heard where it listens."""
        watching = [page for page in self._pages if page.watches]
        listening = [page for page in self._pages if page.listens]
        if watching and (seen := self._motion.block(rows)):
            for page in watching:
                page.stream(MOTION, seen)
        if listening:
            heard = self._controls.sound.render(rows, self.live.state.get("rpm", 0.0))
            for page in listening:
                page.stream(SOUND, heard)

    def _happened(self, message: dict[str, Any]) -> None:
        self.live.happened(message)
        self._changed()

    def _changed(self, soon: bool = True) -> None:
        for page in self._pages:
            page.changed(soon)

    def _shown(self, page: BenchPage) -> Message:
        own = {"holds": page is self._pages[0], "calibrated_on": self._controls.calibrated_on}
        return own | {"sound_rate": self._controls.sound.rate} | self.live.shown()
