"""The run's end, as the nodes tell each other: the drive has finished, the recorder has closed.

The drive, or the player, publishes `FINISHED` and stays until the recorder has closed its bag. The
other nodes end when it has left: until then their latched messages may be asked for. A node that
stays is made anew, in the same process, once every publisher of the old run has left.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node

from cam_rig.messages import topics
from cam_rig.runner.node_table import WAIT

if TYPE_CHECKING:
    from cam_rig.nodes.rig_node import RigNode

#: Wall time (s) that the recorder's last message may take to the drive, which then ends.
DELIVERY_S = 2.0
#: Wall time (s) between two looks at who has left.
POLL_S = 0.1
#: Wall time (s) without the drive, once it was there, after which it has left without a word. A
#: node that was suspended takes it for lost, and discovers it again by its next announcement.
ABSENT_S = 10.0
#: Topics by their names as resolved, and their publishers by DDS identity.
Identities = dict[str, set[bytes]]


def publishers(node: Node, *wanted: str) -> Identities:
    """Who publishes on topics now, by discovery."""
    return {
        name: {bytes(info.endpoint_gid) for info in node.get_publishers_info_by_topic(name)}
        for name in wanted
    }


def staying_node(name: str) -> Node:
    """A hidden node that stays from one run of a process to the next, and its participant with it.

    A DDS participant made anew in a process has the identity of the one before. To a node that has
    not noticed yet that the old one left, what the new one has to say of itself is said already:
    it never discovers it.
    """
    return rclpy.create_node(
        f"_{name}_between_runs",
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )


def wait_until_gone(node: Node, known: Identities, stopped: Callable[[], bool]) -> None:
    """Return when all publishers have left, or a signal to stop has come."""
    while not (have_left(node, known) or stopped()):
        time.sleep(POLL_S)


def have_left(node: Node, known: Identities) -> bool:
    """Whether none of some publishers is there any longer."""
    there = publishers(node, *known)
    return not any(known[name] & there[name] for name in known)


class FinishedRun(NamedTuple):
    """What the drive says at the run's end."""

    level: bytes
    words: str
    ticks: int
    stamp_ns: int

    def message(self, node: str) -> DiagnosticStatus:
        """As it is published."""
        status = DiagnosticStatus(level=self.level, name=node, message=self.words)
        values = {"ticks": self.ticks, "stamp_ns": self.stamp_ns}
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        return status

    @classmethod
    def of(cls, message: DiagnosticStatus) -> FinishedRun:
        """Read a message."""
        values = {pair.key: pair.value for pair in message.values}
        return cls(message.level, message.message, int(values["ticks"]), int(values["stamp_ns"]))


class DriveAbsence:
    """Ends a node whose drive was there, and has left without saying that the run is over."""

    def __init__(self, node: RigNode) -> None:
        self._node, self._known, self._polls = node, False, 0
        self._returns = bool(node.given["checkpoint"])

    def poll(self) -> None:
        """Look whether the drive is there; to be called every `POLL_S`."""
        is_there = self._node.count_publishers(topics.FINISHED.relative) > 0
        self._known |= is_there
        self._polls = 0 if is_there or not self._known else self._polls + 1
        if self._polls * POLL_S < ABSENT_S or self._returns or self._node.done.done():
            return
        self._node.get_logger().warning("the drive has left without saying that the run is over")
        self._node.remember_publishers()
        self._node.finish()


class EndWithTheDrive:
    """Ends a node when the drive has said that the run is over, and has left."""

    def __init__(self, node: RigNode) -> None:
        self._node, self._drives = node, Identities()
        self._absence = DriveAbsence(node)
        if node.given["at_end"] != WAIT:
            node.subscribe(topics.FINISHED, self._on_finished)
            node.every(POLL_S, self._watch)

    def _on_finished(self, message: DiagnosticStatus) -> None:
        FinishedRun.of(message)
        if self._drives:
            return
        self._node.remember_publishers()
        name = self._node.resolve_topic_name(topics.FINISHED.relative)
        self._drives = publishers(self._node, name)

    def _watch(self) -> None:
        if not self._drives:
            self._absence.poll()
        elif have_left(self._node, self._drives):
            self._node.finish()
