"""The recorder: every message of the rig, as received, into a rosbag2 MCAP bag."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message

from cam_rig.bag.publishers import Publishers
from cam_rig.bag.recording.recorder import open_bag
from cam_rig.errors import CamRigError
from cam_rig.messages import topics
from cam_rig.nodes.common.convert import message_class, qos, to_header
from cam_rig.nodes.common.diagnostics import OK
from cam_rig.nodes.common.rig_node import RigNode, require_length, take_rest
from cam_rig.simulation.loaded_scene import open_scene

#: Nodes that may publish on one topic (/diagnostics) at once.
MAX_NODES = 16


class Recorder(RigNode):
    """Subscribes to all of the rig's topics; /recorder/written acknowledges what is written."""

    needs_message_info = True

    def __init__(self) -> None:
        super().__init__("recorder")
        loaded = open_scene(Path(self.given["scene"]))
        default = time.strftime(f"bags/{loaded.scene.name}_%Y-%m-%d_%H-%M-%S")
        bag = Path(self.given["bag"] or default)
        publishers = Publishers(self.checkpoint.launches, self._name_of)
        self._bag = open_bag(self.checkpoint, bag, loaded, publishers)
        self._written, self._quiet = self.publisher(topics.RECORDED), True
        self._newest: int | None = None
        self._acknowledge(self._bag.resumed)
        for topic in topics.RECORDING:
            kind, take = message_class(topic), self._on(topic)
            depth = qos(topic, MAX_NODES if topic is topics.DIAGNOSTICS else 1)
            self.create_subscription(kind, topic.name, take, depth, raw=True)
        self.every(0.25, self._idle)

    def _on(self, topic: topics.Topic) -> Callable[[Any, Any], None]:
        def take(cdr: bytes, about: dict[str, Any]) -> None:
            require_length(topic, cdr)
            number = about["publication_sequence_number"] or 0
            self._acknowledge(self._bag.take(topic, cdr, process_of(about), number))

        return take

    def _name_of(self, topic: topics.Topic, process: bytes) -> str:
        """The node that publishes on a topic from a process, by discovery."""
        known = self.publishers_of(topic).items()
        return next((name for gid, name in known if gid.startswith(process)), process.hex())

    def _acknowledge(self, stamps: list[int]) -> None:
        for stamp in stamps:
            if message := self.health.report(stamp, OK, "recording"):  # needs no way through DDS
                self._bag.take(topics.DIAGNOSTICS, serialize_message(message))
        if stamps:
            self._newest, self._quiet = stamps[-1], False
            self._written.publish(to_header(self._newest, "recorder"))

    def _idle(self) -> None:
        if self._quiet and self._newest is not None:  # the drive may not have received it
            self._written.publish(to_header(self._newest, "recorder"))
        self._quiet = True
        try:
            self._bag.idle()
        except CamRigError as error:
            self.fail(error)

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Record what has arrived but was not taken yet."""
        take_rest(spin_once, lambda: self._bag.count)

    def close(self) -> None:
        """Close the bag."""
        self._bag.close()


def process_of(about: dict[str, Any]) -> bytes:
    """The process a message is from: the first 12 bytes of its writer's DDS identity."""
    gid = about.get("publisher_gid")
    return bytes(gid["data"][:12]) if gid else b"?"
