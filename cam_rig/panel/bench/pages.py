"""Pages of the bench: all display one state, and one of them has the controls."""

from __future__ import annotations

import asyncio
import base64
import math
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import numpy as np
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket

from cam_rig.errors import RefusedError
from cam_rig.panel.bench import drawing, runner
from cam_rig.panel.bench.controls import DONE, EMERGENCY_STOP, SETTINGS, BenchControls, NodeLink
from cam_rig.panel.bench.drawing import MOTION, SOUND, cam_picture
from cam_rig.panel.bench.live_state import LiveState, to_csv
from cam_rig.panel.bench.runner import BenchRunner, Setup
from cam_rig.panel.board.board import Board
from cam_rig.panel.server import LivePage, Message, PanelPages, csv_file, get, page_file, post
from cam_rig.schema import CamConfig
from cam_rig.show import looks as colours
from cam_rig.units import NS, FloatArray

# One page of the bench, with the motion that it displays and the sound that it plays.

#: Largest number of ticks whose motion, and whose sound, are queued for a page. The oldest are
#: dropped.
MAX_BLOCKS = 64
#: Period (s, wall clock) of the messages with motion or sound. The data of several ticks are
#: joined, because a message costs more than its content.
STREAM_EVERY_S = 0.04
#: Shortest time (s, wall clock) between two messages with only a new sound level. A person cannot
#: read a faster display.
LEVEL_EVERY_S = 0.2


class BenchPage(LivePage):
    """Open browser page of the bench, which may display the motion and play the sound.

    `page_data` returns all values that the page may receive. Only those that have changed are sent.
    """

    def __init__(self, socket: WebSocket, page_data: Callable[[BenchPage], Message]) -> None:
        super().__init__(socket)
        self.listens = self.watches = False
        self._page_data, self._sent = page_data, Message()
        self._queued_s = -math.inf
        self._blocks = {kind: deque[bytes](maxlen=MAX_BLOCKS) for kind in (MOTION, SOUND)}
        self._has_blocks = asyncio.Event()

    def queue_changes(self, soon: bool = True) -> None:
        """Queue the changed values for the page.

        If `soon` is False, this is done only if `LEVEL_EVERY_S` has passed since the last time. The
        values are then queued with those of a later tick.
        """
        if soon or time.monotonic() - self._queued_s >= LEVEL_EVERY_S:
            self._queued_s = time.monotonic()
            self.queue("live", self._changed_values)

    def _changed_values(self) -> Message:
        """Return the values that have changed since the last message to the page."""
        data = self._page_data(self)
        new = {k: v for k, v in data.items() if k not in self._sent or self._sent[k] != v}
        self._sent = data
        if "readings" in new:
            new["readings"] = [vars(reading) for reading in new["readings"]]
        return new and {"type": "live"} | new

    def queue_block(self, kind: bytes, block: bytes) -> None:
        """Queue the motion or the sound of one tick for the page.

        `kind` is `MOTION` or `SOUND`. Data of the same kind are sent in order.
        """
        self._blocks[kind].append(block)
        self._has_blocks.set()

    def refusal(self, number: Any, reason: str) -> Message:
        """Return the answer to a refused command of the page."""
        return {"type": "answer", "success": False, "message": reason, "answer": number}

    def sender_tasks(self) -> list[Any]:
        """Return the coroutines that send values and blocks to the page."""
        return [*super().sender_tasks(), self._send_blocks()]

    async def _send_blocks(self) -> None:
        while True:
            await self._has_blocks.wait()
            self._has_blocks.clear()
            for kind, queue in self._blocks.items():
                if blocks := b"".join(queue):
                    queue.clear()
                    await self.send(kind + blocks)
            await asyncio.sleep(STREAM_EVERY_S)


#: Lowest and highest speed of the speed knob on the page, rpm.
KNOB = (20.0, 1000.0)
#: Colours of the cams in the chart. The markers of the cams differ in shape too.
CAM_COLOURS = (colours.BLUE, colours.VERMILION, colours.GREEN, colours.BLACK)
#: Real-time factors that a page offers.
PACES = ("real_time", "0.1x", "0.25x", "0.5x", "2x", "5x", "free")


class BenchPages(PanelPages):
    """Pages of the live bench in a browser.

    `cam` is mounted first. Laws drawn on the `board` can be mounted later.
    """

    def __init__(self, bench: BenchRunner, cam: CamConfig, board: Board) -> None:
        self._runner, self._board = bench, board
        runner.add_cam(cam, bench.cams)
        self.live = LiveState(Setup.of(bench.rig, cam.name))
        self._link = NodeLink(bench.socket, self._on_node_message)
        self._pages: list[BenchPage] = []  # the first page has the controls
        self._controls = BenchControls(bench, self.live, self._link)
        self._cams = drawing.Cams(bench.folder)
        self._motion = drawing.LiveMotion(self._cams)
        self.routes = (
            page_file("/bench", "bench", self._start_graph),
            get("/bench/about", self._about),
            get("/bench/cam/{cam}", lambda path: cam_picture(*self._cams(path["cam"]))),
            get(
                "/bench/readings.csv",
                lambda _: csv_file("readings.csv", to_csv(self.live.readings)),
            ),
            post("/bench/expected", self._expected),
            post("/bench/mount", self._mount),
            WebSocketRoute("/bench/live", self._live),
        )

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        """Receive the messages of the nodes and the runner while the context is active."""
        loop = asyncio.get_running_loop()
        self._runner.on_event = lambda event: loop.call_soon_threadsafe(
            self._on_runner_event, event
        )
        try:
            async with self._link.listening():
                yield
        finally:
            self._runner.on_event = lambda _event: None

    def _start_graph(self) -> None:
        if self.live.graph == "off":
            self._controls.set_up(self.live.setup)

    def _about(self, _: Message) -> Message:
        rig = self._runner.rig
        choices = {"cam": runner.cam_names(self._runner.cams), "pacing": PACES}
        settings = {
            name: {"node": node, "choices": choices.get(name, spec.choices)}
            for name, (node, spec) in SETTINGS.items()
        }
        return {
            "rig": {"name": rig.name},
            "has_rerun": self._runner.has_rerun,
            "models": runner.available_models(rig),
            "model": self.live.setup.model,
            "settings": settings,
            "knob": KNOB,
            "speeds": (runner.MIN_RPM, runner.MAX_RPM),
            "colours": [colours.web(colour) for colour in CAM_COLOURS],
            "max_added_mass": runner.MAX_ADDED_MASS,
        }

    async def _expected(self, changes: Message) -> Message:
        """Return the predicted steady turn of a set-up at its speed, and its jump speeds.

        The set-up is the current one with the changes that the page has sent.
        """
        setup = self._controls.current_setup(changes)
        law, rig = self._cams(setup.cam)[1], setup.rig(self._runner.rig)
        jumps = await asyncio.to_thread(drawing.jump_speeds, law, rig, setup.model)
        return await asyncio.to_thread(drawing.predict_turn, setup, law, rig) | {"jumps": jumps}

    async def _mount(self, body: Message) -> Message:
        """Mount the law whose ordinates were drawn on the board.

        If the nodes are not running, they are started with this cam.
        """
        name, base = self._controls.next_drawn_name(), body.get("base_radius_mm")
        cam = self._board.cam_of(name, body.get("ordinates"), base)
        await self._controls.mount(cam)
        return {"cam": cam.name}

    async def _live(self, socket: WebSocket) -> None:
        await socket.accept()
        page = BenchPage(socket, self._page_data)
        self._pages.append(page)
        self._queue_changes()
        try:
            await page.serve(partial(self._obey, page))
        finally:
            self._pages.remove(page)  # the next page gets the controls
            self._update_listening()
            self._queue_changes()

    async def _obey(self, page: BenchPage, command: Message) -> Message:
        try:
            reply = await self._execute(page, command.get("do"), command)
            return reply | {"type": "answer", "answer": command.get("number")}
        finally:
            self._queue_changes()

    async def _execute(self, page: BenchPage, name: Any, command: Message) -> Message:
        value = command.get("value")
        match name:
            case "listen":
                page.listens = value is True
                self._update_listening()
            case "watch":
                page.watches = value is True
                self._update_listening()
            case "take_over":
                self._pages.remove(page)
                self._pages.insert(0, page)
            # Every page may call an emergency stop.
            case _ if page is self._pages[0] or (name, value) == ("call", EMERGENCY_STOP):
                return await self._controls.obey(command)
            case _:
                raise RefusedError("another page has the controls; take over first")
        return DONE

    def _update_listening(self) -> None:
        self._link.set_listening(any(page.listens or page.watches for page in self._pages))

    def _on_node_message(self, message: Message) -> None:
        if "samples" in message:
            data = np.frombuffer(base64.b64decode(message["samples"]), dtype="<f8")
            return self._send_samples(data.reshape(message["shape"]))
        if "state" in message:
            self._runner.on_drive_time(message["state"]["time_ns"] / NS)
            self._motion.add_state(message["state"])
        self._queue_changes(self.live.on_node_message(message))

    def _send_samples(self, rows: FloatArray) -> None:
        """Send a tick's samples to pages that display motion, and its sound to listeners."""
        watching = [page for page in self._pages if page.watches]
        listening = [page for page in self._pages if page.listens]
        if watching and (motion := self._motion.block(rows)):
            for page in watching:
                page.queue_block(MOTION, motion)
        if listening:
            sound = self._controls.sound.render(rows, self.live.state.get("rpm", 0.0))
            for page in listening:
                page.queue_block(SOUND, sound)

    def _on_runner_event(self, event: Message) -> None:
        self.live.on_runner_event(event)
        self._queue_changes()

    def _queue_changes(self, soon: bool = True) -> None:
        for page in self._pages:
            page.queue_changes(soon)

    def _page_data(self, page: BenchPage) -> Message:
        return self.live.page_data() | {
            "has_controls": page is self._pages[0],
            "calibrated_on": self._controls.calibrated_on,
            "sound_rate": self._controls.sound.rate,
        }
