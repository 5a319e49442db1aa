"""What the recorder does, without ROS: the messages of each tick, brought together and in order.

Topics come in any order, and some messages come twice when a node was started again. Here each
message finds its cam state, and a state is written, with everything that belongs to it, when
nothing is missing and everything before it is written. So two recordings of one run are equal.
"""

from __future__ import annotations

from collections import Counter, deque
from typing import NamedTuple, Protocol

from cam_rig.bag import topics
from cam_rig.bag.codec import cam_state_of
from cam_rig.bag.raw import RawMessages, cam_of, speaker_of, stamp_of
from cam_rig.bag.topics import Topic
from cam_rig.errors import RefusedError
from cam_rig.experiment.gate import Admission, StateGate
from cam_rig.experiment.program import CamState

#: Messages kept of states that are not known yet; more than are ever in flight.
MOST_WAITING = 4 * topics.TICK_DEPTH
#: Cams whose law is kept.
MOST_CAMS = 256

#: A state begins with its stamp; the clock's message is that and no more.
CLOCK_BYTES = 12

TICK_TOPICS = tuple(topic for topic in topics.RECORDING if topic.per == "tick")
#: The unstamped topics of each stamped one.
TWINS = {
    stamped.name: [topic for topic in topics.RECORDING if topic.twin == stamped.name]
    for stamped in topics.RECORDING
}
CAM_TOPICS = (topics.LAW_COEFFICIENTS, topics.PROFILE)


class Heard(NamedTuple):
    """A serialized message and the process that it is from."""

    source: bytes
    cdr: bytes


class Writing(Protocol):
    """Where messages go: a `BagWriter`."""

    def write(self, topic: Topic, log_time: int, cdr: bytes) -> None:
        """Write one message at a rig time in ns."""


class RecordingSession:
    """Writes serialized messages in the order of rig time, each once.

    Parameters
    ----------
    writer : where they go
    gate : which states of the cam can be true
    """

    def __init__(self, writer: Writing, gate: StateGate) -> None:
        self.written = -1
        self._writer, self._raw = writer, RawMessages()
        self._gate = gate
        self._states: deque[tuple[CamState, bytes]] = deque()
        self._before: CamState | None = None
        self._waiting: dict[Topic, dict[int, Heard]] = {t: {} for t in topics.RECORDING}
        self._twins: dict[tuple[str, bytes, int], int | bytes] = {}
        self._spoken: Counter[tuple[Topic, bytes]] = Counter()
        self._cams: dict[Topic, dict[str, bytes]] = {topic: {} for topic in CAM_TOPICS}
        self._said: deque[tuple[int, str, bytes]] = deque(maxlen=4 * MOST_WAITING)

    def take(self, topic: Topic, cdr: bytes, source: bytes = b"", number: int = 0) -> list[int]:
        """Take one message; the stamps of the states that were written with it, in order.

        Parameters
        ----------
        source : which process it is from
        number : its place among all that its publisher sent

        Raises
        ------
        RefusedError : the message is malformed, or contradicts one that was here before
        BagError : it cannot be written
        """
        message, cdr = self._raw.read(topic, cdr)
        if topic is topics.CAM_STATE:
            state = cam_state_of(message)
            if self._gate.admit(state) is not Admission.SEEN:
                self._states.append((state, cdr))
        elif topic in self._cams:
            self._take_cam(topic, cam_of(message), cdr)
        elif topic is topics.DIAGNOSTICS:
            self._take_diagnosis((stamp_of(cdr), speaker_of(message), cdr))
        elif topic.twin:
            self._pair(topic, source, number, cdr)
        else:
            stamp = stamp_of(cdr)
            self._keep(topic, stamp, Heard(source, cdr))
            for other in TWINS.get(topic.name, ()):
                self._pair(other, source, number, stamp)
        stamps = []
        while self._states and self._complete():
            self._write_state()
            stamps.append(self.written)
        return stamps

    @property
    def cams(self) -> list[str]:
        """The cams that the law server has told of."""
        return list(self._cams[topics.PROFILE])

    def close(self) -> None:
        """Write what came of the states that are not complete."""
        while self._states:
            self._write_state()

    def _take_cam(self, topic: Topic, name: str, cdr: bytes) -> None:
        known = self._cams[topic]
        if known.setdefault(name, cdr) != cdr:
            raise RefusedError(f"{topic.name}: another one of {name!r}; allowed: one a recording")
        if len(known) > MOST_CAMS:
            del known[name]
            raise RefusedError(f"{topic.name}: more than {MOST_CAMS} cams")

    def _take_diagnosis(self, diagnosis: tuple[int, str, bytes]) -> None:
        if diagnosis in self._said or diagnosis[1] == topics.PACE:
            return
        self._said.append(diagnosis)
        stamp, speaker, cdr = diagnosis
        # Some ns late, by speaker: so its place among others of its time depends on nobody's haste.
        known = speaker in topics.SPEAKERS
        rank = topics.SPEAKERS.index(speaker) if known else len(topics.SPEAKERS)
        self._writer.write(topics.DIAGNOSTICS, stamp + 1 + rank, cdr)

    def _pair(self, topic: Topic, source: bytes, number: int, half: int | bytes) -> None:
        """Bring an unstamped message and the stamp of its twin together."""
        key = (topic.name, source, number)
        other = self._twins.pop(key, None)
        if isinstance(half, int) and isinstance(other, bytes):
            self._keep(topic, half, Heard(source, other))
        elif isinstance(half, bytes) and isinstance(other, int):
            self._keep(topic, other, Heard(source, half))
        else:
            self._twins[key] = half
            if len(self._twins) > MOST_WAITING:
                del self._twins[next(iter(self._twins))]

    def _keep(self, topic: Topic, stamp: int, heard: Heard) -> None:
        """Keep a message for its state; of two that differ, that of who has spoken more often."""
        known = self._waiting[topic]
        self._spoken[topic, heard.source] += 1
        if stamp <= self.written:
            return
        before = known.setdefault(stamp, heard)
        if before.cdr != heard.cdr:
            if self._spoken[topic, heard.source] > self._spoken[topic, before.source]:
                known[stamp] = heard
            raise RefusedError(f"{topic.name} at {stamp} ns: two messages that differ")
        if len(known) > MOST_WAITING:
            del known[max(known)]
            raise RefusedError(f"{topic.name}: more than {MOST_WAITING} messages of no known state")

    def _complete(self) -> bool:
        state = self._states[0][0]
        return (
            self._is_past(state.time_ns)
            and all(state.time_ns in self._waiting[topic] for topic in self._belonging(state))
            and (
                not self._is_new_cam(state)
                or all(state.cam in known for known in self._cams.values())
            )
        )

    def _is_past(self, stamp: int) -> bool:
        """Whether /clock has come to a time; it never goes back, so a lost one is lost."""
        return any(clock >= stamp for clock in self._waiting[topics.CLOCK])

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
        if self._is_new_cam(state):
            for topic, known in self._cams.items():
                if state.cam in known:
                    put(topic, stamp, known[state.cam])
        if self._is_past(stamp):
            clock = self._waiting[topics.CLOCK].pop(stamp, None)
            put(topics.CLOCK, stamp, clock.cdr if clock else cdr[:CLOCK_BYTES])
        put(topics.CAM_STATE, stamp, cdr)
        for topic in self._belonging(state):
            if message := self._waiting[topic].pop(stamp, None):
                put(topic, stamp, message.cdr)
        self._before, self.written = state, stamp
