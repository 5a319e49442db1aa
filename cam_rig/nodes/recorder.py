"""Recorder node: writes received and derived messages to an MCAP bag."""

from __future__ import annotations

import time
from contextlib import ExitStack
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from cam_rig.bag.files import require_new_bag
from cam_rig.bag.recorder import BagRecorder
from cam_rig.bag.split import Split
from cam_rig.messages import topics
from cam_rig.messages.topics import Topic
from cam_rig.nodes.base.diagnostics import OK
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.nodes.base.run_end import (
    DELIVERY_S,
    Endpoints,
    FinishedRun,
    LostDriveMonitor,
    find_endpoints,
    have_left,
)
from cam_rig.nodes.convert import message_class, to_header
from cam_rig.runner.node_table import WAIT
from cam_rig.runner.resources import reserve_recorder
from cam_rig.simulation.scene import open_scene

#: Number of nodes that may publish on /diagnostics in one run, for the depth of its queue.
MAX_NODES = 16
#: Time (s, wall clock) without a message after which the recorder of a finished run stops waiting
#: for missing messages of the last ticks (times between two cam states).
QUIET_S = 3.0
#: Period (s, wall clock) at which written messages are flushed to the file of the bag.
FLUSH_PERIOD_S = 0.25
#: Period (s, wall clock) at which `close` checks whether the drive has left.
LEAVE_POLL_S = 0.02
#: Identifier of the publisher of a message from an RMW that does not report one.
UNKNOWN_GID = b"?"


class Recorder(RigNode):
    """Writes the messages of the topics `RECEIVED`, and acknowledges written ticks.

    A tick is the time between two cam states.
    """

    needs_message_info = True

    def __init__(self) -> None:
        super().__init__("recorder")
        loaded = open_scene(Path(self.settings["scene"]))
        default = time.strftime(f"bags/{loaded.scene.name}_%Y-%m-%d_%H-%M-%S")
        self._path = choose_bag(Path(self.settings["output_uri"] or default), self.runs_before)
        namespace = self.get_namespace().rstrip("/")
        self._lock = ExitStack()
        self._lock.enter_context(reserve_recorder(self.context.get_domain_id(), namespace))
        split = Split(self.settings["max_bagfile_size"], self.settings["max_bagfile_duration"])
        require_new_bag(self._path, split.last_number)
        self._sources = topics.Publishers(self.publisher_monitor.find_publishers)
        self._bag = BagRecorder(
            self._path,
            loaded,
            self._sources,
            namespace=namespace,
            samples_per_turn=self.settings["samples_per_turn"],
            split=split,
        )
        self._ack_publisher = self.advertise(topics.RECORDER_ACK)
        self._closed_publisher = self.advertise(topics.CLOSED)
        self._newest_ns = -1  # rig time of the last written state
        self._end_ns: int | None = None  # rig time of the last state of the run, once known
        self._deadline = 0.0
        self._drives = Endpoints()
        # Diagnostics first: DDS discovers in this order, and the last state ends the drive.
        for topic in reversed(topics.RECEIVED):
            histories = MAX_NODES if topic is topics.DIAGNOSTICS else 1
            self.subscribe_raw(topic, partial(self._on_message, topic), histories)
        self.create_wall_timer(FLUSH_PERIOD_S, self._on_timer)
        self.get_logger().info(f"recording into {self._path}, waiting for the other nodes")

    def monitor_run_end(self) -> None:
        """End the node when the run is over and all messages of the run are written."""
        if self.settings["on_finish"] != WAIT:
            monitor = LostDriveMonitor(self)
            self.subscribe_raw(topics.FINISHED, self._on_finished, on_publishers=monitor.on_drives)

    def _on_message(self, topic: Topic, cdr: bytes, info: dict[str, Any]) -> None:
        number = info["publication_sequence_number"] or 0
        stamps = self._bag.take(topic, cdr, gid_of(info), number)
        for stamp in stamps:
            # Written directly, because the recorder does not receive its messages through DDS.
            if message := self.diagnostics.report(stamp, OK, "recording"):
                self._bag.take(topics.DIAGNOSTICS, serialize_message(message))
        if stamps:
            self._newest_ns = stamps[-1]
            self._ack_publisher.publish(to_header(self._newest_ns))
            self.ticks += len(stamps)
            self._deadline = time.monotonic() + QUIET_S

    def _on_finished(self, cdr: bytes, info: dict[str, Any]) -> None:
        message = deserialize_message(cdr, message_class(topics.FINISHED))
        run = FinishedRun.from_message(message)
        self._require_one_drive(gid_of(info))
        if self._end_ns is None:
            self.remember_endpoints()
            self._drives = find_endpoints(self, self.resolve_topic_name(topics.FINISHED.relative))
            self._end_ns, self._deadline = run.stamp_ns, time.monotonic() + QUIET_S
            self._finish_if_complete()

    def _require_one_drive(self, gid: bytes) -> None:
        """Raise RunError if a node other than the drive may have published the run's end.

        `gid` is the DDS identifier of the publisher of /rig/finished.
        """
        owner, topic = topics.FINISHED.owner, topics.FINISHED
        names = self.publisher_monitor.find_publishers(topic).values()
        if len(names) > 1:
            others = [name for name in names if name.split("/")[-1] != owner] or list(names)[1:]
            raise topics.second_publisher(topic, owner, ", ".join(others))
        self._sources.require(owner, topic, gid)

    def _on_timer(self) -> None:
        self._finish_if_complete()
        self._bag.idle()

    def _finish_if_complete(self) -> None:
        """End the node if all messages of a finished run are written.

        It also ends if no message has arrived for `QUIET_S`.
        """
        if self._end_ns is None:
            return
        if self._newest_ns >= self._end_ns or time.monotonic() > self._deadline:
            self.finish()

    @property
    def _is_unused(self) -> bool:
        """True if the node stayed for another run, and no run was started."""
        return self.runs_before > 0 and self._bag.count == 0

    def summary(self) -> str:
        """Return the text that is logged when the node ends without an error."""
        if self._is_unused:
            return f"no further run was recorded, {self._path} is removed"
        return f"closed {self._path}: {self.ticks} states, {self._bag.count} messages"

    def close(self) -> None:
        """Close the bag, publish its folder, and wait until the drive has left.

        A bag is removed if the node stayed for another run that was not started.
        """
        self._lock.close()
        if self._is_unused:
            self._bag.discard()
            return
        self._bag.close()
        self._closed_publisher.publish(String(data=str(self._path)))
        self.publishing_monitor.flush()
        deadline = time.monotonic() + DELIVERY_S
        while not have_left(self, self._drives) and time.monotonic() < deadline:
            time.sleep(LEAVE_POLL_S)  # the executor has stopped, so no callback is delayed


def choose_bag(bag: Path, runs_before: int) -> Path:
    """Return the folder of the next bag.

    It is `bag` in the first run of the process. After earlier runs it is the first of `bag`,
    bag_2, bag_3, ... that does not exist yet.
    """
    names = (bag.with_name(f"{bag.name}_{number}") for number in count(2))
    return next(name for name in chain([bag], names) if not (runs_before and name.exists()))


def gid_of(info: dict[str, Any]) -> bytes:
    """Return the DDS identifier of the publisher from the message info of rclpy."""
    gid = info.get("publisher_gid")
    return bytes(gid["data"]) if gid else UNKNOWN_GID
