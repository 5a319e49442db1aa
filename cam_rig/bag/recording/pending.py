"""Messages that wait for their state or for each other: a bounded number, in a flood too."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Set
from typing import Any, NamedTuple, TypeVar

from cam_rig.errors import RefusedError
from cam_rig.live.flow_control import HISTORY_DEPTH
from cam_rig.messages import topics
from cam_rig.messages.topics import Topic

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


class ReceivedMessage(NamedTuple):
    """A serialized message and the process that published it."""

    source: bytes
    cdr: bytes


def make_room(held: dict[Key, Any], is_awaited: Callable[[Key], bool] = lambda _: False) -> bool:
    """Evict the oldest of too many that are not awaited; whether there were too many."""
    if len(held) <= MAX_WAITING:
        return False
    for key in [key for key in held if not is_awaited(key)][:EVICTED_AT_ONCE]:
        del held[key]
    return True


class Waiting:
    """Messages by topic and stamp (ns), each until its state is written.

    Parameters
    ----------
    known : stamps of the states that wait to be written; what belongs to one is never dropped
    """

    def __init__(self, known: Set[int]) -> None:
        self._known, self._until = known, -1
        self._held: dict[Topic, dict[int, bytes]] = {topic: {} for topic in topics.RECEIVED}
        self._halves: dict[tuple[str, bytes, int], int | bytes] = {}

    def has(self, topic: Topic, stamp: int) -> bool:
        """Whether a topic's message of a stamp is here."""
        return stamp in self._held[topic]

    def get(self, topic: Topic, stamp: int) -> bytes | None:
        """A topic's message of a stamp; None where there is none."""
        return self._held[topic].get(stamp)

    def pop(self, topic: Topic, stamp: int) -> bytes | None:
        """A topic's message of a stamp, which is not kept any longer; None where there is none."""
        return self._held[topic].pop(stamp, None)

    def forget(self, until: int) -> None:
        """Drop all up to a stamp: those states are written, and the rest belongs to none."""
        self._until = until
        for held in self._held.values():
            for stamp in [stamp for stamp in held if stamp <= until]:
                del held[stamp]

    def keep_stamped(
        self, topic: Topic, stamp: int, received: ReceivedMessage, number: int
    ) -> None:
        """Keep a message by its stamp, which its twin has too.

        Parameters
        ----------
        number : its place among all that its process published on the topic

        Raises
        ------
        RefusedError : it differs from one of this stamp, or there are too many
        """
        try:
            self._keep(topic, stamp, received.cdr)
        finally:  # an error in the one must not cost the other
            for twin in TWINS.get(topic.name, ()):
                self._pair(twin, received.source, number, stamp)

    def keep_twin(self, topic: Topic, received: ReceivedMessage, number: int) -> None:
        """Keep a message without a stamp until its twin tells the stamp; as `keep_stamped`."""
        self._pair(topic, received.source, number, received.cdr)

    def _pair(self, topic: Topic, source: bytes, number: int, half: int | bytes) -> None:
        """Bring an unstamped message and the stamp of its twin together."""
        key = (topic.name, source, number)
        other = self._halves.pop(key, None)
        if isinstance(half, int) and isinstance(other, bytes):
            self._keep(topic, half, other)
        elif isinstance(half, bytes) and isinstance(other, int):
            self._keep(topic, other, half)
        else:
            self._halves[key] = half
            make_room(self._halves)

    def _keep(self, topic: Topic, stamp: int, cdr: bytes) -> None:
        """Keep a message for its state."""
        if stamp <= self._until:
            return
        held = self._held[topic]
        if held.setdefault(stamp, cdr) != cdr:
            raise RefusedError(f"{topic.name} at {stamp} ns: two messages that differ")
        if make_room(held, self._known.__contains__) and stamp not in self._known:
            raise RefusedError(f"{topic.name}: more than {MAX_WAITING} messages of no known state")
