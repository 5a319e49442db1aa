"""The recorder without ROS: the messages of each tick, brought together and in order.

The topics arrive in any order. Each message is assigned to its cam state, and a state is written
with everything that belongs to it, as soon as nothing is missing and all earlier states are
written. Therefore two recordings of one run are equal.
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

# Messages that wait for their state or for each other: a bounded number, in a flood too.

#: Messages kept of states that are not known yet; more than are ever in flight.
MAX_WAITING = 4 * HISTORY_DEPTH
#: Messages evicted at once when there are more: a flood must not cost a search for each.
EVICTED_AT_ONCE = MAX_WAITING // 8
#: The unstamped topics of each stamped one.
TWINS = {
    stamped.name: [topic for topic in topics.RECEIVED if topic.twin == stamped.name]
    for stamped in topics.RECEIVED
}
Key = TypeVar("Key", bound=Hashable)


def make_room(held: dict[Key, Any], is_awaited: Callable[[Key], bool] = lambda _: False) -> bool:
    """Evict the oldest of too many that are not awaited; whether there were too many."""
    if len(held) <= MAX_WAITING:
        return False
    for key in [key for key in held if not is_awaited(key)][:EVICTED_AT_ONCE]:
        del held[key]
    return True


class Waiting:
    """Messages by topic and stamp (ns), each until its state is written.

    ``known`` are the stamps of the states that wait to be written: what belongs to one is never
    dropped. The ``number`` of a message counts those of its topic, which has one publisher.
    """

    def __init__(self, known: Set[int]) -> None:
        self._known, self._until = known, -1
        self._held: dict[Topic, dict[int, bytes]] = {topic: {} for topic in topics.RECEIVED}
        self._halves: dict[tuple[str, int], int | bytes] = {}

    def get(self, topic: Topic, stamp: int) -> bytes | None:
        """A topic's message of a stamp; None where there is none."""
        return self._held[topic].get(stamp)

    def forget(self, until: int) -> None:
        """Drop all up to a stamp: those states are written, and the rest belongs to none."""
        self._until = until
        for held in self._held.values():
            for stamp in [stamp for stamp in held if stamp <= until]:
                del held[stamp]

    def keep_stamped(self, topic: Topic, number: int, cdr: bytes) -> None:
        """Keep a message by its stamp, which its twin has too."""
        stamp = stamp_of(cdr)
        try:
            self._keep(topic, stamp, cdr)
        finally:  # an error in the one must not cost the other
            for twin in TWINS[topic.name]:
                self.pair(twin, number, stamp)

    def pair(self, topic: Topic, number: int, half: int | bytes) -> None:
        """Bring an unstamped message and the stamp of its twin together, whichever comes first."""
        key = (topic.name, number)
        other = self._halves.pop(key, None)
        if isinstance(half, int) and isinstance(other, bytes):
            self._keep(topic, half, other)
        elif isinstance(half, bytes) and isinstance(other, int):
            self._keep(topic, other, half)
        else:
            self._halves[key] = half
            make_room(self._halves)

    def _keep(self, topic: Topic, stamp: int, cdr: bytes) -> None:
        if stamp <= self._until:
            return
        held = self._held[topic]
        if held.setdefault(stamp, cdr) != cdr:
            raise RefusedError(f"{topic.name} at {stamp} ns: two messages that differ")
        if make_room(held, self._known.__contains__) and stamp not in self._known:
            raise RefusedError(f"{topic.name}: more than {MAX_WAITING} messages of no known state")


# The /diagnostics of the rig's nodes, each message once, in the order of rig time.

#: What is said on wall time.
OF_WALL_TIME = (topics.PACE, topics.SHOWN_MOTION)


class Diagnostic(NamedTuple):
    """Rig time (ns), the node it is of, and the serialized message."""

    stamp: int
    node: str
    cdr: bytes


class PendingDiagnostics:
    """Messages that wait until rig time comes to their stamps: one of the wall clock never does."""

    def __init__(self) -> None:
        self._waiting: dict[Diagnostic, None] = {}
        # The recorder takes its own messages directly, and receives them through DDS as well.
        self._written: deque[Diagnostic] = deque(maxlen=4 * MAX_WAITING)

    def take(self, stamp: int, node: str, cdr: bytes) -> None:
        """Keep a message of the rig's nodes."""
        if node in OF_WALL_TIME or node.endswith(topics.HEARTBEAT):
            return
        if node not in topics.DIAGNOSED_NODES:
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: of {node[:80]!r}; recorded: "
                f"{', '.join(topics.DIAGNOSED_NODES)}"
            )
        found = Diagnostic(stamp, node, cdr)
        if found in self._written or found in self._waiting:
            return
        self._waiting[found] = None
        if make_room(self._waiting):
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: more than {MAX_WAITING} of no known time"
            )

    def due(self, until: int) -> Iterator[tuple[int, bytes]]:
        """Log time (ns) and message of all up to a rig time."""
        for found in sorted(one for one in self._waiting if one.stamp <= until):
            del self._waiting[found]
            self._written.append(found)
            # A few ns late, by node: the order among others of its time is not left to scheduling
            yield found.stamp + 1 + topics.DIAGNOSED_NODES.index(found.node), found.cdr


#: A state begins with its stamp; the clock's message is that and no more.
CLOCK_BYTES = 12
#: By stamp: those of a tick, and the law of a new speed.
STAMPED = tuple(topic for topic in topics.RECEIVED if topic.per in ("speed", "tick"))
CAM_TOPICS = tuple(topic for topic in topics.RECEIVED if topic.per == "cam")


class RecordingSession:
    """Writes serialized messages in the order of rig time, each once.

    ``check`` refuses a law or a contour (topic, message) that is not the cam's own; ``motion``
    makes the derived messages.
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
        self._known: set[int] = set()
        self._before: CamState | None = None
        self._waiting, self._diagnostics = Waiting(self._known), PendingDiagnostics()
        self._cams: dict[Topic, dict[str, bytes]] = {topic: {} for topic in CAM_TOPICS}
        self._newest = -1

    def take(self, topic: Topic, cdr: bytes, source: bytes = b"", number: int = 0) -> list[int]:
        """Take message ``number`` of a process; stamps of the states written with it."""
        if topic.derived:
            raise RefusedError(f"{topic.name}: a recorder makes these messages itself")
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
                    f"{topic.name}: another one of {name!r}; allowed: one a recording"
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
        while self._states and self._complete():
            stamps.append(self._write_state())
        self._write_diagnostics(self.written)
        return stamps

    def close(self) -> None:
        """Write what was received of the states that are not complete."""
        while self._states:
            self._write_state()
        self._write_diagnostics(self._newest)

    def _take_state(self, state: CamState, cdr: bytes) -> None:
        self._validator.validate(state)
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

    def _complete(self) -> bool:
        state = self._states[0][0]
        there = occasions(self._before, state)
        stamped = (topic for topic in STAMPED if topic.per in there)
        return all(self._waiting.get(topic, state.time_ns) for topic in stamped) and (
            "cam" not in there or all(state.cam in known for known in self._cams.values())
        )

    def _write_state(self) -> int:
        state, cdr = self._states.popleft()
        stamp, put = state.time_ns, self._writer.write
        there = occasions(self._before, state)
        self._writer.begin_state(stamp)
        for derived in self._moved(state):
            put(*derived)
        for topic, known in self._cams.items():
            if "cam" in there and state.cam in known:
                put(topic, stamp, known[state.cam])
        put(topics.CLOCK, stamp, cdr[:CLOCK_BYTES])
        put(topics.CAM_STATE, stamp, cdr)
        for topic in STAMPED:
            if topic.per in there and (message := self._waiting.get(topic, stamp)):
                put(topic, stamp, message)
        if self._motion is not None and "cam" in there:
            for derived in self._motion.mounted(state.cam, stamp):
                put(*derived)
        self._before, self.written = state, stamp
        self._known.discard(stamp)
        self._waiting.forget(stamp)
        return stamp

    def _moved(self, state: CamState) -> list[DerivedMessage]:
        """The derived messages of the tick that ends at a state; none without its samples."""
        before, samples = self._before, self._waiting.get(topics.FOLLOWER_SAMPLES, state.time_ns)
        if self._motion is None or before is None or samples is None:
            return []
        message, _ = read_message(topics.FOLLOWER_SAMPLES, samples)
        try:
            return self._motion.moved(before, state, block_of(message))
        except RefusedError:  # as the microphone says, which refuses it too
            return []
