"""A recorded drive's and law server's messages, to be published again."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cam_rig.bag.reader import raw_messages
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of
from cam_rig.messages.serialization import RawMessages
from cam_rig.messages.topics import Topic
from cam_rig.simulation.schedule import CamState

#: In the order in which they go out at one rig time.
PLAYED = (topics.LAW_COEFFICIENTS, topics.PROFILE, topics.LAW, topics.CLOCK, topics.CAM_STATE)
#: Decoded, not only passed on.
READ = (topics.CAM_STATE, topics.DIAGNOSTICS)
#: A level's letter symbol at the end of the microphone's diagnostics.
QUANTITY = re.compile(r"\bL[ACZ][FS]$")


@dataclass(frozen=True)
class Played:
    """A state of the cam, and the serialized messages up to it and with it.

    ``quantity`` is what the microphone read of the tick that ends here, by its diagnostics; empty
    without one.
    """

    state: CamState
    messages: tuple[tuple[Topic, bytes], ...]
    quantity: str = ""


def played(bag: Path) -> Iterator[Played]:
    """The messages state by state; what a bag holds after its last state is left out.

    Raises
    ------
    BagError : no such bag, or one that was not closed
    RefusedError : a state in it is not possible
    """
    by_name, raw = {t.name: t for t in (*PLAYED, topics.DIAGNOSTICS)}, RawMessages()
    waiting: list[tuple[Topic, bytes]] = []
    last: Played | None = None
    for connection, _, data in raw_messages(bag, set(by_name)):
        topic = by_name[connection.topic]
        message = raw.read(topic, bytes(data))[0] if topic in READ else None
        if topic is topics.DIAGNOSTICS:
            last = last and replace(last, quantity=quantity_of(message) or last.quantity)
            continue
        if topic is topics.LAW and last is not None:  # written after its state
            last = replace(last, messages=(*last.messages, (topic, bytes(data))))
            continue
        waiting.append((topic, bytes(data)))
        if topic is topics.CAM_STATE:
            if last is not None:
                yield last
            last = Played(cam_state_of(message), tuple(waiting))
            waiting.clear()
    if last is not None:
        yield last


def quantity_of(diagnostic: Any) -> str:
    """What the microphone reads, by its diagnostics; empty by another node's."""
    for status in diagnostic.status:
        if status.name == "microphone" and (found := QUANTITY.search(status.message)):
            return found.group()
    return ""
