"""The recorder without ROS: the messages of each tick, brought together and in order.

Topics come in any order, and some messages come twice when a node was started again. Here each
message is assigned to its cam state, and a state is written, with everything that belongs to it,
when nothing is missing and everything before it is written. So two recordings of one run are equal.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from cam_rig.bag.publishers import Publishers
from cam_rig.bag.recording.diagnostics import PendingDiagnostics
from cam_rig.bag.recording.pending import ReceivedMessage, Waiting
from cam_rig.errors import RefusedError
from cam_rig.live.state_validation import Admission, StateValidator
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, cam_state_of, decode_block
from cam_rig.messages.motion import DerivedMessage, MotionMessages
from cam_rig.messages.serialization import RawMessages, cam_of, diagnosed_node, stamp_of
from cam_rig.messages.topics import Topic
from cam_rig.simulation.schedule import CamState

#: Cams whose law is kept.
MAX_CAMS = 256

#: A state begins with its stamp; the clock's message is that and no more.
CLOCK_BYTES = 12

TICK_TOPICS = tuple(topic for topic in topics.RECEIVED if topic.per == "tick")
CAM_TOPICS = (topics.LAW_COEFFICIENTS, topics.PROFILE)


class Writing(Protocol):
    """Where messages go: a `BagWriter`."""

    def write(self, topic: Topic, log_time: int, cdr: bytes) -> None:
        """Write one message at a rig time in ns."""

    def begin_state(self, stamp: int) -> None:
        """Called before the messages of a state of some stamp (ns)."""


class RecordingSession:
    """Writes serialized messages in the order of rig time, each once.

    Parameters
    ----------
    writer : where they go
    validator : which states of the cam are possible
    publishers : the one publisher of each topic
    check : refuses a law or a contour (topic, message) that is not the cam's own
    motion : makes the derived messages; None: none
    """

    def __init__(
        self,
        writer: Writing,
        validator: StateValidator,
        publishers: Publishers | None = None,
        check: Callable[[Topic, Any], None] = lambda _topic, _message: None,
        motion: MotionMessages | None = None,
    ) -> None:
        self.written = -1
        self._motion = motion
        self._writer, self._raw = writer, RawMessages()
        self._validator, self._check = validator, check
        self._publishers = publishers or Publishers()
        self._states: deque[tuple[CamState, bytes]] = deque()
        self._known: set[int] = set()
        self._before: CamState | None = None
        self._waiting, self._diagnostics = Waiting(self._known), PendingDiagnostics()
        self._cams: dict[Topic, dict[str, bytes]] = {topic: {} for topic in CAM_TOPICS}
        self._newest = -1

    def take(self, topic: Topic, cdr: bytes, source: bytes = b"", number: int = 0) -> list[int]:
        """Take one message; the stamps of the states that were written with it, in order.

        Parameters
        ----------
        source : the process that published it
        number : its place among all that this process published on the topic

        Raises
        ------
        RefusedError : the message is malformed, or contradicts one received before
        RunError : it is from another process than the one that publishes on this topic
        BagError : it cannot be written
        """
        if topic.derived:
            raise RefusedError(f"{topic.name}: a recorder makes these messages itself")
        if topic.owner:
            self._publishers.require(topic.owner, topic, source)
        message, cdr = self._raw.read(topic, cdr)
        received = ReceivedMessage(source, cdr)
        if topic is topics.CAM_STATE:
            self._take_state(cam_state_of(message), cdr)
        elif topic in self._cams:
            self._check(topic, message)
            self._take_cam(topic, cam_of(message), cdr)
        elif topic is topics.DIAGNOSTICS:
            self._take_diagnostic(diagnosed_node(message), received)
        elif topic.twin:
            self._waiting.keep_twin(topic, received, number)
        else:
            self._waiting.keep_stamped(topic, stamp_of(cdr), received, number)
        stamps = []
        while self._states and self._complete():
            self._write_state()
            stamps.append(self.written)
        self._write_diagnostics(self.written)
        return stamps

    @property
    def cams(self) -> list[str]:
        """The cams whose contour the law server has published."""
        return list(self._cams[topics.PROFILE])

    def note_known(self, stamp: int) -> None:
        """Note that a predecessor had received a state of a rig time (ns)."""
        self._newest = max(self._newest, stamp)

    def close(self) -> None:
        """Write what was received of the states that are not complete."""
        while self._states:
            self._write_state()
        self._write_diagnostics(self._newest)

    def _take_state(self, state: CamState, cdr: bytes) -> None:
        if self._validator.admit(state) is Admission.SEEN:
            return
        newest = self._states[-1][0].time_ns if self._states else self.written
        if state.time_ns <= newest:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: rig time went back from {newest} ns; allowed: "
                "one that rises within a bag; record each run into a bag of its own"
            )
        self._states.append((state, cdr))
        self._known.add(state.time_ns)
        self._newest = max(self._newest, state.time_ns)

    def _write_diagnostics(self, until: int) -> None:
        """Those of states that are written, so that no file of the bag holds what comes later."""
        for time_ns, diagnostic in self._diagnostics.due(until):
            self._writer.write(topics.DIAGNOSTICS, time_ns, diagnostic)

    def _take_diagnostic(self, node: str, received: ReceivedMessage) -> None:
        if node in topics.DIAGNOSED_NODES:
            self._publishers.require(node, topics.DIAGNOSTICS, received.source)
        self._diagnostics.take(stamp_of(received.cdr), node, received.cdr)

    def _take_cam(self, topic: Topic, name: str, cdr: bytes) -> None:
        known = self._cams[topic]
        if known.setdefault(name, cdr) != cdr:
            raise RefusedError(f"{topic.name}: another one of {name!r}; allowed: one a recording")
        if len(known) > MAX_CAMS:
            del known[name]
            raise RefusedError(f"{topic.name}: more than {MAX_CAMS} cams")

    def _complete(self) -> bool:
        state = self._states[0][0]
        return all(
            self._waiting.has(topic, state.time_ns) for topic in self._belonging(state)
        ) and (
            not self._is_new_cam(state) or all(state.cam in known for known in self._cams.values())
        )

    def _belonging(self, state: CamState) -> list[Topic]:
        """Topics that have a message for a state, by its stamp."""
        before, found = self._before, list[Topic]()
        if before is None or (before.cam, before.speed) != (state.cam, state.speed):
            found += [topics.LAW] if state.speed > 0.0 else []
        if before is not None and before.turns_until(state):
            found += TICK_TOPICS
        return found

    def _is_new_cam(self, state: CamState) -> bool:
        return self._before is None or self._before.cam != state.cam

    def _write_state(self) -> None:
        state, cdr = self._states.popleft()
        stamp, put = state.time_ns, self._writer.write
        self._writer.begin_state(stamp)
        for derived in self._moved(state):
            put(*derived)
        if self._is_new_cam(state):
            for topic, known in self._cams.items():
                if state.cam in known:
                    put(topic, stamp, known[state.cam])
        put(topics.CLOCK, stamp, cdr[:CLOCK_BYTES])
        put(topics.CAM_STATE, stamp, cdr)
        for topic in self._belonging(state):
            if message := self._waiting.pop(topic, stamp):
                put(topic, stamp, message)
        if self._motion is not None and self._is_new_cam(state):
            for derived in self._motion.mounted(state):
                put(*derived)
        self._before, self.written = state, stamp
        self._known.discard(stamp)
        self._waiting.forget(stamp)

    def _moved(self, state: CamState) -> list[DerivedMessage]:
        """The derived messages of the tick that ends at a state; none without its samples."""
        before, samples = self._before, self._waiting.get(topics.FOLLOWER_SAMPLES, state.time_ns)
        if self._motion is None or before is None or samples is None:
            return []
        message, _ = self._raw.read(topics.FOLLOWER_SAMPLES, samples)
        try:
            return self._motion.moved(before, state, decode_block(*array_of(message)))
        except RefusedError:  # as the microphone says, which refuses it too
            return []
