"""What a drive and a law server said, from a bag, to be said again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import topics
from cam_rig.bag.codec import cam_state_of
from cam_rig.bag.raw import RawMessages
from cam_rig.bag.reader import UNREADABLE, damaged
from cam_rig.bag.topics import Topic
from cam_rig.experiment.program import CamState

#: In the order in which they go out at one rig time.
PLAYED = (topics.LAW_COEFFICIENTS, topics.PROFILE, topics.LAW, topics.CLOCK, topics.CAM_STATE)


@dataclass(frozen=True)
class Played:
    """A state of the cam, and the serialized messages up to it and with it."""

    state: CamState
    messages: tuple[tuple[Topic, bytes], ...]


def played(bag: Path) -> Iterator[Played]:
    """What is to be said, state by state; what a bag holds after its last state is left out.

    Raises
    ------
    BagError : no such bag, or one that was not closed
    RefusedError : a state in it is none
    """
    by_name, raw = {topic.name: topic for topic in PLAYED}, RawMessages()
    waiting: list[tuple[Topic, bytes]] = []
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_KILTED)) as reader:
            connections = [c for c in reader.connections if c.topic in by_name]
            for connection, _, data in reader.messages(connections):
                topic = by_name[connection.topic]
                waiting.append((topic, bytes(data)))
                if topic is topics.CAM_STATE:
                    state = cam_state_of(raw.read(topic, bytes(data))[0])
                    yield Played(state, tuple(waiting))
                    waiting.clear()
    except UNREADABLE as error:
        raise damaged(bag, error) from None
