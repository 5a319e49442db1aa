"""The viewer node: every message of the run, as it comes, into Rerun."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PolygonStamped
from std_msgs.msg import Float64

from cam_rig.errors import CamRigError, RefusedError
from cam_rig.messages import topics
from cam_rig.messages.codec import real_time_factor
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.nodes.convert import to_header
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import tick_count
from cam_rig.viewer.process import require_display, window
from cam_rig.viewer.recording import SEND_EVERY_S, LiveView, polygon

#: Messages that may wait per topic: a drive need not wait for the viewer.
QUEUE_DEPTH = 256
#: Spins without a message that mean the end: one per subscription and some more.
SPINS_PER_DRAIN = 10
#: Wall time (s) to wait for the level of the last tick: no drive waits until it is drawn.
LEVEL_TIMEOUT_S = 2.0
#: Wall time (s) between two looks at whether there is something to send; of a run whose pictures
#: are sent when their time has come.
LOOK_EVERY_S, FRAME_S = SEND_EVERY_S, 1.0 / 60.0


class Viewer(RigNode):
    """Draws to ``address``, a viewer or a page's folder, or a window; publishes how far it has."""

    def __init__(self) -> None:
        super().__init__("viewer")
        self._loaded, self._windows = open_scene(Path(self.settings["scene"])), ExitStack()
        address = self.settings["address"]
        if not address:
            require_display()
            _, address = self._windows.enter_context(window())
        self.total_ticks = tick_count(self._loaded.scene)
        self._view, self._received = LiveView(self._loaded, address), 0
        self._shown, feed = self.advertise(topics.SHOWN), self._view.feed
        handlers = feed.handlers | {topics.PROFILE: self._on_profile}
        for topic, handle in handlers.items():
            self.subscribe(replace(topic, depth=QUEUE_DEPTH), self._on(handle))
        self.create_wall_timer(LOOK_EVERY_S, self._view.flush)
        self._frames = self.create_wall_timer(FRAME_S, self._view.flush)
        self._frames.cancel()
        self.subscribe(topics.REAL_TIME_FACTOR, self._on_factor)
        self.get_logger().info(self.activity().text)

    def _on_profile(self, message: PolygonStamped) -> None:
        cam = message.header.frame_id
        self._loaded.mount(cam)
        self._view.feed.profile(cam, polygon(message))

    def _on_factor(self, message: Float64) -> None:
        self._view.set_pace(real_time_factor(message.data))
        if message.data:
            self._frames.reset()
        else:
            self._frames.cancel()

    def _on(self, handle: Callable[[Any], None]) -> Callable[[Any], None]:
        def draw(message: Any) -> None:
            self._received += 1
            try:
                handle(message)
                for _, end, _ in self._view.draw():
                    self.ticks += 1
                    self.diagnostics.newest_ns = end.time_ns
                    self._shown.publish(to_header(end.time_ns))
            except CamRigError as error:
                raise RefusedError(str(error)) from None

        return draw

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Draw what was received but not handled yet."""
        before, deadline = -1, time.monotonic() + LEVEL_TIMEOUT_S
        while before < self._received or (
            self._view.feed.is_behind and time.monotonic() < deadline
        ):
            before = self._received
            for _ in range(SPINS_PER_DRAIN):
                spin_once(timeout_sec=0.02)

    def close(self) -> None:
        """Send the rest; a window of our own closes."""
        self._view.close()
        self._windows.close()
