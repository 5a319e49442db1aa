"""Viewer node: displays the messages of the run in Rerun."""

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

#: Number of messages in the queue of each subscription, so many that a slow viewer does not block
#: the publishers.
QUEUE_DEPTH = 256
#: Number of spins of the executor between two checks for further messages at the end of a run. It
#: is larger than the number of subscriptions, because a spin handles one message.
SPINS_PER_DRAIN = 10
#: Longest time (s, wall clock) to wait at the end of a run for the last sound level, for which the
#: drive does not wait.
LEVEL_TIMEOUT_S = 2.0
#: Period (s, wall clock) at which a free run sends drawn data to Rerun.
FREE_PERIOD_S = SEND_EVERY_S
#: Period (s, wall clock) at which a paced run sends the data that are due for display.
FRAME_S = 1.0 / 60.0


class Viewer(RigNode):
    """Draws the run in a window, viewer or page, and acknowledges drawn ticks.

    A tick is the time between two cam states.
    """

    def __init__(self) -> None:
        super().__init__("viewer")
        self._loaded, self._windows = open_scene(Path(self.settings["scene"])), ExitStack()
        address = self.settings["address"]
        if not address:
            require_display()
            _, address = self._windows.enter_context(window())
        self.total_ticks = tick_count(self._loaded.scene)
        self._view, self._received = LiveView(self._loaded, address), 0
        self._ack_publisher, feed = self.advertise(topics.VIEWER_ACK), self._view.feed
        handlers = feed.handlers | {topics.PROFILE: self._on_profile}
        for topic, handle in handlers.items():
            self.subscribe(replace(topic, depth=QUEUE_DEPTH), self._drawing(handle))
        self.create_wall_timer(FREE_PERIOD_S, self._view.flush)
        self._frame_timer = self.create_wall_timer(FRAME_S, self._view.flush)
        self._frame_timer.cancel()
        self.subscribe(topics.REAL_TIME_FACTOR, self._on_factor)
        self.get_logger().info(self.activity().text)

    def _on_profile(self, message: PolygonStamped) -> None:
        cam = message.header.frame_id
        self._loaded.mount(cam)
        self._view.feed.profiles[cam] = polygon(message)

    def _on_factor(self, message: Float64) -> None:
        self._view.set_pace(real_time_factor(message.data))
        if message.data:
            self._frame_timer.reset()
        else:
            self._frame_timer.cancel()

    def _drawing(self, handle: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that passes a message to `handle` and draws complete ticks.

        A tick is the time between two cam states. Each drawn tick is acknowledged to the drive.
        """

        def draw(message: Any) -> None:
            self._received += 1
            try:
                handle(message)
                for _, end, _ in self._view.draw():
                    self.ticks += 1
                    self.diagnostics.newest_ns = end.time_ns
                    self._ack_publisher.publish(to_header(end.time_ns))
            except CamRigError as error:
                raise RefusedError(str(error)) from None

        return draw

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Draw all messages in transit, and wait for the level of the last tick.

        A tick is the time between two cam states.
        """
        before, deadline = -1, time.monotonic() + LEVEL_TIMEOUT_S
        while before < self._received or (
            self._view.feed.is_behind and time.monotonic() < deadline
        ):
            before = self._received
            for _ in range(SPINS_PER_DRAIN):
                spin_once(timeout_sec=0.02)

    def close(self) -> None:
        """Send the remaining data, and close the window if this node has opened it."""
        self._view.close()
        self._windows.close()
