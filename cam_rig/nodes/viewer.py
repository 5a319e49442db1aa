"""The viewer node: every message of the run, as received, into Rerun."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PolygonStamped

from cam_rig.errors import CamRigError, RefusedError
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, cam_state_of, decode_block, stamp_ns
from cam_rig.nodes.common.base import RigNode
from cam_rig.nodes.common.convert import to_header
from cam_rig.simulation.scene import open_scene
from cam_rig.viewer.live import LivePicture
from cam_rig.viewer.recording import polygon
from cam_rig.viewer.server.process import require_display, window

#: Messages per topic that can wait where the drive does not wait for the viewer.
QUEUE_DEPTH = 256
#: Spins without a message before the end: one per subscription, and some more.
DRAIN_SPINS = 10
#: Wall time (s) that the level of the last tick is waited for: no drive waits until it is drawn.
LEVEL_PATIENCE_S = 2.0
#: Wall time (s) between blocks of columns.
SEND_PERIOD_S = 0.1


class Viewer(RigNode):
    """Draws into the Rerun at ``address``, or into a window of its own; acknowledges each tick."""

    def __init__(self) -> None:
        super().__init__("viewer")
        self._loaded, self._windows = open_scene(Path(self.given["scene"])), ExitStack()
        address = self.given["address"]
        if not address:
            require_display()
            _, address = self._windows.enter_context(window())
        self._picture, self._taken = LivePicture(self._loaded, address), 0
        self._shown, feed = self.publisher(topics.SHOWN), self._picture.feed
        takes: dict[topics.Topic, Callable[[Any], None]] = {
            topics.PROFILE: self._on_profile,
            topics.CAM_STATE: lambda m: feed.state(cam_state_of(m)),
            topics.FOLLOWER_SAMPLES: lambda m: feed.block(decode_block(*array_of(m))),
            topics.LEVEL: lambda m: feed.level(m.data),
            topics.PRESSURE: lambda m: feed.pressure(stamp_ns(m.header.stamp), m.fluid_pressure),
        }
        for topic, take in takes.items():
            self.subscribe(replace(topic, depth=QUEUE_DEPTH), self._on(take))
        self.every(SEND_PERIOD_S, self._picture.flush)

    def _on_profile(self, message: PolygonStamped) -> None:
        cam = message.header.frame_id
        self._loaded.mount(cam)
        self._picture.feed.profile(cam, polygon(message))

    def _on(self, take: Callable[[Any], None]) -> Callable[[Any], None]:
        def draw(message: Any) -> None:
            self._taken += 1
            try:
                take(message)
                for _, end, _ in self._picture.feed.draw():
                    self._shown.publish(to_header(end.time_ns, "viewer"))
            except CamRigError as error:
                raise RefusedError(str(error)) from None

        return draw

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Draw what has arrived but was not taken yet."""
        before, deadline = -1, time.monotonic() + LEVEL_PATIENCE_S
        while before < self._taken or (
            self._picture.feed.is_behind and time.monotonic() < deadline
        ):
            before = self._taken
            for _ in range(DRAIN_SPINS):
                spin_once(timeout_sec=0.02)

    def close(self) -> None:
        """Send the rest; a window of its own closes."""
        self._picture.close()
        self._windows.close()
