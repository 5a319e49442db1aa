"""Recorder without ROS: combines the messages of each tick and writes them.

The topics arrive in any order. Each message is assigned to its cam state. A state is written
together with its messages as soon as they are complete and all earlier states are written. Two
recordings of one run are therefore equal.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator, Set
from typing import Any, NamedTuple, TypeVar

from cam_rig.bag.writer import BagWriter
from cam_rig.errors import RefusedError
from cam_rig.live.flow_control import HISTORY_DEPTH
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages import topics
from cam_rig.messages.codec import block_of, cam_state_of
from cam_rig.messages.motion import DerivedMessage, MotionMessages
from cam_rig.messages.serialization import cam_of, diagnosed_node, read_message, stamp_of
from cam_rig.messages.topics import Publishers, Topic, occasions
from cam_rig.simulation.schedule import CamState

# Storage of messages that wait for their cam state, or for the message of the topic that is
# published together with theirs (its twin). The number of messages is bounded, also if a publisher
# floods a topic.

#: Largest number of stored messages whose cam state is not known yet. Fewer are in flight in a
#: normal run.
MAX_WAITING = 4 * HISTORY_DEPTH
#: Number of stored messages that are removed together, so that a flood of messages does not cost
#: one search per message.
EVICTED_AT_ONCE = MAX_WAITING // 8
#: For each topic with a stamp, the topics without a stamp that the same node publishes with it.
#: Their messages with equal numbers have the same time.
TWINS = {
    stamped.name: [topic for topic in topics.RECEIVED if topic.twin == stamped.name]
    for stamped in topics.RECEIVED
}
Key = TypeVar("Key", bound=Hashable)


def make_room(stored: dict[Key, Any], is_awaited: Callable[[Key], bool] = lambda _: False) -> bool:
    """Remove the oldest of the stored messages if there are more than `MAX_WAITING`.

    `stored` is in the order of arrival. Messages whose key is awaited are not removed. Returns True
    if there were too many messages.
    """
    if len(stored) <= MAX_WAITING:
        return False
    for key in [key for key in stored if not is_awaited(key)][:EVICTED_AT_ONCE]:
        del stored[key]
    return True


class Waiting:
    """Messages by topic and stamp (ns) that are kept until their cam state is written.

    `awaited` contains the stamps of the states that are still to be written. The messages of such a
    state are never dropped. The `number` of a message counts the messages of its topic, which has
    one publisher.
    """

    def __init__(self, awaited: Set[int]) -> None:
        self._awaited, self._until = awaited, -1
        self._stored: dict[Topic, dict[int, bytes]] = {topic: {} for topic in topics.RECEIVED}
        self._halves: dict[tuple[str, int], int | bytes] = {}

    def get(self, topic: Topic, stamp: int) -> bytes | None:
        """Return the stored message of a topic with a stamp (ns), or None."""
        return self._stored[topic].get(stamp)

    def forget(self, until: int) -> None:
        """Drop all messages up to a stamp (ns), because their states are written."""
        self._until = until
        for stored in self._stored.values():
            for stamp in [stamp for stamp in stored if stamp <= until]:
                del stored[stamp]

    def keep_stamped(self, topic: Topic, number: int, cdr: bytes) -> None:
        """Store a message by its stamp.

        Messages with the same number on its twin topics, which have no stamp, get this stamp.
        """
        stamp = stamp_of(cdr)
        try:
            self._store(topic, stamp, cdr)
        finally:  # the twins are stored even if this message is refused
            for twin in TWINS[topic.name]:
                self.pair(twin, number, stamp)

    def pair(self, topic: Topic, number: int, half: int | bytes) -> None:
        """Combine a message without a stamp with the stamp of its twin topic.

        Twin topics are published together by one node (see `TWINS`). `half` is the serialized
        message or the stamp (ns), which may arrive in any order. `number` is the number of the
        message within its topic. The message is stored when both halves have arrived.
        """
        key = (topic.name, number)
        other = self._halves.pop(key, None)
        if isinstance(half, int) and isinstance(other, bytes):
            self._store(topic, half, other)
        elif isinstance(half, bytes) and isinstance(other, int):
            self._store(topic, other, half)
        else:
            self._halves[key] = half
            make_room(self._halves)

    def _store(self, topic: Topic, stamp: int, cdr: bytes) -> None:
        if stamp <= self._until:
            return
        stored = self._stored[topic]
        if stored.setdefault(stamp, cdr) != cdr:
            raise RefusedError(f"{topic.name} at {stamp} ns: got two different messages")
        if make_room(stored, self._awaited.__contains__) and stamp not in self._awaited:
            raise RefusedError(f"{topic.name}: more than {MAX_WAITING} messages without a state")


# Messages on /diagnostics of the rig's nodes, each once, in the order of rig time.

#: Names of the statuses on /diagnostics whose messages are stamped with wall-clock time.
WALL_TIME_DIAGNOSTICS = (topics.PACE, topics.SHOWN_MOTION)


class Diagnostic(NamedTuple):
    """Diagnostic message: rig time (ns), name of the node, and serialized message."""

    stamp: int
    node: str
    cdr: bytes


class PendingDiagnostics:
    """Diagnostic messages that wait until rig time reaches their stamps.

    Messages stamped with wall-clock time are never written.
    """

    def __init__(self) -> None:
        self._waiting: dict[Diagnostic, None] = {}
        # The recorder takes its own messages directly, and receives them through DDS as well.
        # Messages that were written are stored here, so that the second copy is ignored.
        self._written: deque[Diagnostic] = deque(maxlen=4 * MAX_WAITING)

    def take(self, stamp: int, node: str, cdr: bytes) -> None:
        """Store a diagnostic message of a node of the rig.

        Messages of other nodes are refused, and those with wall-clock time are ignored. `stamp` is
        its time in ns, `node` the name of the node, and `cdr` the serialized message.
        """
        if node in WALL_TIME_DIAGNOSTICS or node.endswith(topics.HEARTBEAT):
            return
        if node not in topics.DIAGNOSED_NODES:
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: the node must be one of "
                f"{', '.join(topics.DIAGNOSED_NODES)}, got {node[:80]!r}"
            )
        diagnostic = Diagnostic(stamp, node, cdr)
        if diagnostic in self._written or diagnostic in self._waiting:
            return
        self._waiting[diagnostic] = None
        if make_room(self._waiting):
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: more than {MAX_WAITING} messages wait for their time"
            )

    def due(self, until: int) -> Iterator[tuple[int, bytes]]:
        """Yield log time (ns) and message of all diagnostics up to a rig time (ns)."""
        for message in sorted(pending for pending in self._waiting if pending.stamp <= until):
            del self._waiting[message]
            self._written.append(message)
            # The offset of a few ns per node makes the order independent of scheduling.
            yield (message.stamp + 1 + topics.DIAGNOSED_NODES.index(message.node), message.cdr)


#: Number of bytes at the start of a serialized cam state that contain its stamp. A serialized clock
#: message consists of the same bytes.
CLOCK_BYTES = 12
#: Topics whose messages have a stamp: those with one message per tick (time between two cam
#: states), and the law of a new speed.
STAMPED = tuple(topic for topic in topics.RECEIVED if topic.per in ("speed", "tick"))
#: Topics with one message per cam.
CAM_TOPICS = tuple(topic for topic in topics.RECEIVED if topic.per == "cam")


class RecordingSession:
    """Session that writes serialized messages in the order of rig time, each once.

    `check` is called with the topic and the message of a law or contour. It raises RefusedError if
    the message differs from the cam of that name. `motion` creates the messages that the recorder
    computes itself.
    """

    def __init__(
        self,
        writer: BagWriter,
        validator: StateValidator,
        publishers: Publishers | None = None,
        check: Callable[[Topic, Any], None] = lambda _topic, _message: None,
        motion: MotionMessages | None = None,
    ) -> None:
        self.written = -1
        self._motion = motion
        self._writer = writer
        self._validator, self._check = validator, check
        self._publishers = publishers or Publishers()
        self._states: deque[tuple[CamState, bytes]] = deque()
        self._awaited: set[int] = set()
        self._before: CamState | None = None
        self._waiting, self._diagnostics = Waiting(self._awaited), PendingDiagnostics()
        self._cams: dict[Topic, dict[str, bytes]] = {topic: {} for topic in CAM_TOPICS}
        self._newest = -1

    def take(self, topic: Topic, cdr: bytes, source: bytes = b"", number: int = 0) -> list[int]:
        """Receive one serialized message, and write the cam states that it completes.

        `source` is the identifier (gid) of its publisher, empty for the recorder itself. `number`
        counts the messages of the topic. Returns the stamps (ns) of the written states. Raises
        RefusedError for a message that is not recorded.
        """
        if topic.derived:
            raise RefusedError(f"{topic.name}: is computed by the recorder, so it is not received")
        if topic.owner:
            self._publishers.require(topic.owner, topic, source)
        message, cdr = read_message(topic, cdr)
        if topic is topics.CAM_STATE:
            self._take_state(cam_state_of(message), cdr)
        elif topic in self._cams:
            self._check(topic, message)
            name = cam_of(message)
            if self._cams[topic].setdefault(name, cdr) != cdr:
                raise RefusedError(
                    f"{topic.name}: a recording has one message per cam, got a second for {name!r}"
                )
        elif topic is topics.DIAGNOSTICS:
            node = diagnosed_node(message)
            if node in topics.DIAGNOSED_NODES:
                self._publishers.require(node, topic, source)
            self._diagnostics.take(stamp_of(cdr), node, cdr)
        elif topic.twin:
            self._waiting.pair(topic, number, cdr)
        else:
            self._waiting.keep_stamped(topic, number, cdr)
        stamps = []
        while self._states and self._is_complete():
            stamps.append(self._write_state())
        self._write_diagnostics(self.written)
        return stamps

    def close(self) -> None:
        """Write the remaining cam states, even if some of their messages are missing."""
        while self._states:
            self._write_state()
        self._write_diagnostics(self._newest)

    def _take_state(self, state: CamState, cdr: bytes) -> None:
        self._validator.validate(state)
        newest = self._states[-1][0].time_ns if self._states else self.written
        if state.time_ns <= newest:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: rig time must increase within a bag, the last "
                f"was at {newest} ns; record each run into a separate bag"
            )
        self._states.append((state, cdr))
        self._awaited.add(state.time_ns)
        self._newest = max(self._newest, state.time_ns)

    def _write_diagnostics(self, until: int) -> None:
        """Write the waiting diagnostics up to a rig time (ns).

        It is the time of a state that is written, so that no file of a bag contains diagnostics
        that are later than its states.
        """
        for time_ns, diagnostic in self._diagnostics.due(until):
            self._writer.write(topics.DIAGNOSTICS, time_ns, diagnostic)

    def _is_complete(self) -> bool:
        state = self._states[0][0]
        current = occasions(self._before, state)
        stamped = (topic for topic in STAMPED if topic.per in current)
        return all(self._waiting.get(topic, state.time_ns) for topic in stamped) and (
            "cam" not in current or all(state.cam in messages for messages in self._cams.values())
        )

    def _write_state(self) -> int:
        state, cdr = self._states.popleft()
        stamp, write = state.time_ns, self._writer.write
        current = occasions(self._before, state)
        self._writer.begin_state(stamp)
        for derived in self._derived_messages(state):
            write(*derived)
        for topic, messages in self._cams.items():
            if "cam" in current and state.cam in messages:
                write(topic, stamp, messages[state.cam])
        write(topics.CLOCK, stamp, cdr[:CLOCK_BYTES])
        write(topics.CAM_STATE, stamp, cdr)
        for topic in STAMPED:
            if topic.per in current and (message := self._waiting.get(topic, stamp)):
                write(topic, stamp, message)
        if self._motion is not None and "cam" in current:
            for derived in self._motion.of_cam(state.cam, stamp):
                write(*derived)
        self._before, self.written = state, stamp
        self._awaited.discard(stamp)
        self._waiting.forget(stamp)
        return stamp

    def _derived_messages(self, state: CamState) -> list[DerivedMessage]:
        """Return the motion messages of the tick that ends at a cam state.

        The recorder computes them from the samples of the tick. The result is empty if the samples
        are missing. A tick is the time between two cam states.
        """
        before, samples = self._before, self._waiting.get(topics.FOLLOWER_SAMPLES, state.time_ns)
        if self._motion is None or before is None or samples is None:
            return []
        message, _ = read_message(topics.FOLLOWER_SAMPLES, samples)
        try:
            return self._motion.of_tick(before, state, block_of(message))
        except RefusedError:  # the microphone refuses it too and reports it
            return []
