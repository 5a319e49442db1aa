"""What the recorder does, without ROS: which message goes into the bag when, and how far it is."""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections import deque
from typing import Any

from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import topics
from cam_rig.bag.topics import Topic
from cam_rig.bag.writer import BagWriter
from cam_rig.dynamics import NS


class RecordingSession:
    """Writes serialized messages with rig time, and knows the newest tick that is complete.

    A stamped message carries its rig time. An unstamped one of a tick belongs to the state that
    closed the tick, and waits for it: topics come in any order, each topic in its own.
    """

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self._stamps: list[int] = []
        self._waiting: dict[Topic, deque[bytes]] = {
            topic: deque()
            for topic in topics.RECORDING
            if topic.per == "tick" and not topic.stamped
        }
        self._ticks = {topic.name: 0 for topic in topics.RECORDING if topic.per == "tick"}
        self._types = get_typestore(Stores.ROS2_KILTED)
        self._clocks = self._laws = 0
        self._step: tuple[str, float] | None = None
        self._steps: list[int] = []

    def take(self, topic: Topic, cdr: bytes) -> int | None:
        """Take one message; the stamp of the newest complete tick when that moved on."""
        before = self._complete()
        if topic in self._waiting:
            self._waiting[topic].append(cdr)
        else:
            self._write(topic, self._time(topic, cdr), cdr)
        self._clocks += topic is topics.CLOCK
        self._laws += topic is topics.LAW
        if topic is topics.CAM_STATE:
            self._stamps.append(stamp_of(cdr))
            self._steps.append(self._count_step(cdr))
        self._write_waiting()
        after = self._complete()
        return self._stamps[after] if after > before else None

    def _time(self, topic: Topic, cdr: bytes) -> int:
        if topic.stamped or topic is topics.CLOCK:
            return stamp_of(cdr)
        return self._stamps[-1] if self._stamps else 0

    def _write_waiting(self) -> None:
        for topic, queue in self._waiting.items():
            while queue and self._ticks[topic.name] + 1 < len(self._stamps):
                self._write(topic, self._stamps[self._ticks[topic.name] + 1], queue.popleft())

    def _write(self, topic: Topic, time_ns: int, cdr: bytes) -> None:
        self._writer.write(topic, time_ns, cdr)
        if topic.name in self._ticks:
            self._ticks[topic.name] += 1

    def _complete(self) -> int:
        """Ticks of which every message is written, as an index into the stamps."""
        states = min(len(self._stamps), self._clocks)
        told = bisect_right(self._steps, self._laws)
        return max(0, min(*self._ticks.values(), states - 1, told))

    def _count_step(self, cdr: bytes) -> int:
        """Steps so far, a cam at a speed each: as many laws must be in the bag."""
        state: Any = self._types.deserialize_cdr(cdr, topics.CAM_STATE.type)
        step = (str(state.header.frame_id), float(state.velocity[0]))
        before = self._steps[-1] if self._steps else 0
        known, self._step = step == self._step, step
        return before if known or step[1] == 0.0 else before + 1


def stamp_of(cdr: bytes) -> int:
    """Rig time (ns) at the head of a serialized message: a header's stamp, or a clock."""
    little = cdr[1] == 1
    seconds, nanoseconds = struct.unpack_from("<iI" if little else ">iI", cdr, 4)
    return int(seconds) * NS + int(nanoseconds)
