"""The recorder: every message of the rig, and those that follow from them, into an MCAP bag."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import chain, count
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from cam_rig.bag.recorder import open_bag
from cam_rig.bag.split import Split
from cam_rig.errors import CamRigError
from cam_rig.messages import topics
from cam_rig.nodes.convert import OK, message_class, qos, require_length, to_header
from cam_rig.nodes.rig_node import RigNode
from cam_rig.nodes.run_end import (
    DELIVERY_S,
    POLL_S,
    DriveAbsence,
    FinishedRun,
    Identities,
    have_left,
    publishers,
)
from cam_rig.runner.node_table import WAIT
from cam_rig.runner.resources import own_recorder
from cam_rig.simulation.scene import open_scene

#: Nodes that may publish on one topic (/diagnostics) at once.
MAX_NODES = 16
#: Wall time (s) without a message after which the rest of a run that has ended is given up.
QUIET_S = 3.0


class Recorder(RigNode):
    """Subscribes to what a bag is made of; /recorder/written acknowledges what is written."""

    needs_message_info = True

    def __init__(self) -> None:
        super().__init__("recorder")
        loaded = open_scene(Path(self.given["scene"]))
        default = time.strftime(f"bags/{loaded.scene.name}_%Y-%m-%d_%H-%M-%S")
        bag = _next_bag(Path(self.given["bag"] or default), self.runs_before)
        self._sources = topics.Publishers(self.checkpoint.starts, self._name_of)
        namespace, points = self.get_namespace().rstrip("/"), self.given["points_per_turn"]
        self._lock = ExitStack()
        self._lock.enter_context(own_recorder(self.context.get_domain_id(), namespace))
        split = Split(self.given["max_bagfile_size"], self.given["max_bagfile_duration"])
        self._bag = open_bag(self.checkpoint, bag, loaded, self._sources, namespace, points, split)
        self._written, self._quiet = self.publisher(topics.RECORDED), True
        self._path, self._newest = bag, -1
        self._end_ns: int | None = None
        self._deadline, self._drives = 0.0, Identities()
        self._closed = self.publisher(topics.CLOSED)
        self._acknowledge(self._bag.resumed)
        # diagnoses first: DDS discovers in this order, and the last state ends the drive
        for topic in reversed(topics.RECEIVED):
            kind, take = message_class(topic), self._on(topic)
            how = qos(topic, MAX_NODES if topic is topics.DIAGNOSTICS else 1)
            self.create_subscription(kind, topic.relative, take, how, raw=True)
        self.every(0.25, self._idle)
        self.get_logger().info(f"recording into {bag}, waiting for the other nodes")

    def listen_for_end(self) -> None:
        """Close the bag when the run is over."""
        if self.given["at_end"] != WAIT:
            topic = topics.FINISHED
            take = self._on_finished
            self.create_subscription(message_class(topic), topic.relative, take, qos(topic))
            self.every(POLL_S, DriveAbsence(self).poll)

    def _on_finished(self, message: Any, about: dict[str, Any]) -> None:
        run = FinishedRun.of(message)
        self._sources.require(topics.FINISHED.owner, topics.FINISHED, process_of(about))
        if self._end_ns is not None:
            return
        self.remember_publishers()
        self._drives = publishers(self, self.resolve_topic_name(topics.FINISHED.relative))
        self._end_ns, self._deadline = run.stamp_ns, time.monotonic() + QUIET_S
        self._end_if_complete()

    def _end_if_complete(self) -> None:
        """Close when the last state is written, or when nothing has come for a while."""
        if self._end_ns is None:
            return
        if self._newest >= self._end_ns or time.monotonic() > self._deadline:
            self.finish()

    def _on(self, topic: topics.Topic) -> Callable[[Any, Any], None]:
        def take(cdr: bytes, about: dict[str, Any]) -> None:
            require_length(topic, cdr)
            number = about["publication_sequence_number"] or 0
            self._acknowledge(self._bag.take(topic, cdr, process_of(about), number))
            self.taken += 1

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
            self._written.publish(to_header(self._newest))
            self.ticks += len(stamps)
            self._deadline = time.monotonic() + QUIET_S

    def _idle(self) -> None:
        if self._quiet and self._newest >= 0:  # the drive may not have received it
            self._written.publish(to_header(self._newest))
        self._quiet = True
        self._end_if_complete()
        try:
            self._bag.idle()
        except CamRigError as error:
            self.fail(error)

    def summary(self) -> str:
        """What the node has done, in words, when it ends."""
        if self._is_spare:
            return "nothing more was recorded"
        return f"closed {self._path}: {self.ticks} states, {self._bag.count} messages"

    @property
    def _is_spare(self) -> bool:
        """Whether no run has followed the one that the recorder stayed after."""
        return self.runs_before > 0 and self._bag.count == 0

    def close(self) -> None:
        """Close the bag, and say so."""
        self._lock.close()
        if self._is_spare:
            self._bag.discard()
            return
        self._bag.close()
        self._closed.publish(String(data=str(self._path)))
        deadline = time.monotonic() + DELIVERY_S
        while not have_left(self, self._drives) and time.monotonic() < deadline:
            time.sleep(0.02)


def _next_bag(wanted: Path, runs_before: int) -> Path:
    """The bag of a run: of a recorder that stays, a new one beside the one before."""
    names = (wanted.with_name(f"{wanted.name}_{number}") for number in count(2))
    return next(name for name in chain([wanted], names) if not (runs_before and name.exists()))


def process_of(about: dict[str, Any]) -> bytes:
    """The process a message is from: the first 12 bytes of its writer's DDS identity."""
    gid = about.get("publisher_gid")
    return bytes(gid["data"][:12]) if gid else b"?"
