"""Messages that wait for their state or for each other: few, whoever sends how many."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Set
from typing import Any, NamedTuple, TypeVar

from cam_rig.bag import topics
from cam_rig.bag.topics import Topic
from cam_rig.errors import RefusedError

#: Messages kept of states that are not known yet; more than are ever in flight.
MOST_WAITING = 4 * topics.TICK_DEPTH
#: Messages dropped at once when there are more: a flood shall not cost a search for each.
DROPPED = MOST_WAITING // 8
#: The unstamped topics of each stamped one.
TWINS = {
    stamped.name: [topic for topic in topics.RECORDING if topic.twin == stamped.name]
    for stamped in topics.RECORDING
}

Key = TypeVar("Key", bound=Hashable)


class Heard(NamedTuple):
    """A serialized message and the process that it is from."""

    source: bytes
    cdr: bytes


def make_room(
    held: dict[Key, Any],
    source_of: Callable[[Key], bytes],
    is_awaited: Callable[[Key], bool] = lambda _: False,
) -> bytes | None:
    """Drop some of too many: the oldest of the process that sent most of what nobody awaits.

    So a flood sweeps out its own alone. The process it was from; None when nothing had to go.
    """
    if len(held) <= MOST_WAITING:
        return None
    spare = [(key, source_of(key)) for key in held if not is_awaited(key)]
    if not spare:
        return None
    loudest = Counter(source for _, source in spare).most_common(1)[0][0]
    for key in [key for key, source in spare if source == loudest][:DROPPED]:
        del held[key]
    return loudest


class Waiting:
    """Messages by topic and stamp (ns), each until its state is written.

    Parameters
    ----------
    known : stamps of the states that wait to be written; what belongs to one is never dropped
    """

    def __init__(self, known: Set[int]) -> None:
        self._known, self._until = known, -1
        self._held: dict[Topic, dict[int, Heard]] = {topic: {} for topic in topics.RECORDING}
        self._halves: dict[tuple[str, bytes, int], int | bytes] = {}
        self._spoken: Counter[tuple[Topic, bytes]] = Counter()

    def has(self, topic: Topic, stamp: int) -> bool:
        """Whether a topic's message of a stamp is here."""
        return stamp in self._held[topic]

    def is_past(self, topic: Topic, stamp: int) -> bool:
        """Whether a topic's message of a stamp, or of a later one, is here."""
        return any(held >= stamp for held in self._held[topic])

    def pop(self, topic: Topic, stamp: int) -> bytes | None:
        """A topic's message of a stamp, which is not kept any longer; None where there is none."""
        heard = self._held[topic].pop(stamp, None)
        return None if heard is None else heard.cdr

    def forget(self, until: int) -> None:
        """Let go of all up to a stamp: those states are written, and what remains is of none."""
        self._until = until
        for held in self._held.values():
            for stamp in [stamp for stamp in held if stamp <= until]:
                del held[stamp]

    def keep_stamped(self, topic: Topic, stamp: int, heard: Heard, number: int) -> None:
        """Keep a message by its stamp, which its twin has too.

        Parameters
        ----------
        number : its place among all that its publisher sent

        Raises
        ------
        RefusedError : it differs from one that is here, or there are too many
        """
        try:
            self._keep(topic, stamp, heard)
        finally:  # a forgery of the one must not cost the other
            for twin in TWINS.get(topic.name, ()):
                self._pair(twin, heard.source, number, stamp)

    def keep_twin(self, topic: Topic, heard: Heard, number: int) -> None:
        """Keep a message that has no stamp, for its twin tells it; as `keep_stamped`."""
        self._pair(topic, heard.source, number, heard.cdr)

    def _pair(self, topic: Topic, source: bytes, number: int, half: int | bytes) -> None:
        """Bring an unstamped message and the stamp of its twin together."""
        key = (topic.name, source, number)
        other = self._halves.pop(key, None)
        if isinstance(half, int) and isinstance(other, bytes):
            self._keep(topic, half, Heard(source, other))
        elif isinstance(half, bytes) and isinstance(other, int):
            self._keep(topic, other, Heard(source, half))
        else:
            self._halves[key] = half
            make_room(self._halves, lambda key: key[1])

    def _keep(self, topic: Topic, stamp: int, heard: Heard) -> None:
        """Keep a message for its state; of two that differ, that of who has spoken more often."""
        held = self._held[topic]
        self._spoken[topic, heard.source] += 1
        if stamp <= self._until:
            return
        before = held.setdefault(stamp, heard)
        if before.cdr != heard.cdr:
            if self._spoken[topic, heard.source] > self._spoken[topic, before.source]:
                held[stamp] = heard
            raise RefusedError(f"{topic.name} at {stamp} ns: two messages that differ")
        dropped = make_room(held, lambda key: held[key].source, self._known.__contains__)
        if dropped == heard.source and stamp not in self._known:
            raise RefusedError(f"{topic.name}: more than {MOST_WAITING} messages of no known state")
