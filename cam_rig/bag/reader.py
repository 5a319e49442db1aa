"""Reading a recorded run back: ticks, counts, and the scene that was attached to it."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag2 import ReaderError
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import topics
from cam_rig.bag.topics import Topic
from cam_rig.dynamics import NS
from cam_rig.errors import BagError, ConfigError
from cam_rig.experiment.noise import HeardTick
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import Stage, open_stage

#: What a file with wrong bytes in it may raise in the readers.
DAMAGE = (McapError, OSError, struct.error, KeyError, IndexError, ValueError, EOFError)


def reason(error: Exception) -> str:
    """An error's words in one line, or its kind where it has none."""
    return " ".join(str(error).split()) or type(error).__name__


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded run: its scene, its ticks, and how many messages each topic has."""

    stage: Stage
    ticks: list[HeardTick]
    counts: dict[str, int]


def messages(bag: Path, wanted: tuple[Topic, ...]) -> Iterator[tuple[Topic, int, Any]]:
    """Topic, rig time in ns, and message, in the order of the bag.

    Raises
    ------
    BagError : no such bag, or one that was not closed
    """
    by_name = {topic.name: topic for topic in wanted}
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_KILTED)) as reader:
            connections = [c for c in reader.connections if c.topic in by_name]
            for connection, log_time, data in reader.messages(connections):
                topic = by_name[connection.topic]
                yield topic, log_time, reader.deserialize(data, connection.msgtype)
    except (AnyReaderError, ReaderError, *DAMAGE) as error:
        raise BagError(f"{bag}: cannot be read as a rosbag2 bag ({reason(error)})") from None


def stamp_ns(header_stamp: Any) -> int:
    """Nanoseconds of a builtin_interfaces/Time."""
    return int(header_stamp.sec) * NS + int(header_stamp.nanosec)


def read_recording(bag: Path) -> Recording:
    """Read what the analysis of a run needs.

    Raises
    ------
    BagError : the bag is missing, was not closed, or holds another kind of run
    """
    stage = read_stage(bag)
    states: list[CamState] = []
    pressures: dict[int, float] = {}
    for topic, _, message in messages(bag, (topics.CAM_STATE, topics.PRESSURE)):
        time_ns = stamp_ns(message.header.stamp)
        if topic is topics.CAM_STATE:
            cam = str(message.header.frame_id)
            angle, speed = float(message.position[0]), float(message.velocity[0])
            states.append(CamState(time_ns, angle, speed, cam))
        else:
            pressures[time_ns] = float(message.fluid_pressure)
    ticks = [
        HeardTick(start, end.time_ns, pressures[end.time_ns])
        for start, end in pairwise(states)
        if end.time_ns in pressures
    ]
    return Recording(stage, ticks, read_counts(bag))


def mcap_file(bag: Path) -> Path:
    """The one MCAP file of a bag."""
    if bag.suffix == ".mcap" and bag.is_file():
        return bag
    if not bag.is_dir():
        raise BagError(f"{bag}: no such bag; name a directory with metadata.yaml and an .mcap file")
    files = sorted(bag.glob("*.mcap"))
    if len(files) != 1:
        raise BagError(f"{bag}: holds {len(files)} .mcap files; allowed: one")
    return files[0]


def read_counts(bag: Path) -> dict[str, int]:
    """Messages a topic, from the bag's own statistics."""
    try:
        with mcap_file(bag).open("rb") as stream:
            summary = make_reader(stream).get_summary()
    except DAMAGE as error:
        raise BagError(f"{bag}: was not closed, or is damaged ({reason(error)})") from None
    if summary is None or summary.statistics is None:
        raise BagError(f"{bag}: has no summary: the recording was not closed")
    counts = summary.statistics.channel_message_counts
    return {summary.channels[i].topic: n for i, n in sorted(counts.items())}


def read_stage(bag: Path) -> Stage:
    """The scene with its cams, rig and published curves as they were attached."""
    with TemporaryDirectory() as folder:
        root = Path(folder)
        scene = None
        try:
            with mcap_file(bag).open("rb") as stream:
                for attachment in make_reader(stream).iter_attachments():
                    path = root / "config" / Path(attachment.name)
                    if not path.resolve().is_relative_to(root):
                        raise BagError(f"{bag}: attachment {attachment.name!r} points elsewhere")
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(attachment.data)
                    scene = path if path.parent.name == "scenes" else scene
        except DAMAGE as error:
            raise BagError(f"{bag}: was not closed, or is damaged ({reason(error)})") from None
        if scene is None:
            raise BagError(f"{bag}: has no scene attached; it was not recorded by cam_rig")
        try:
            return open_stage(scene)
        except ConfigError as error:
            inside = str(error).replace(f"{root}/config/", "")
            raise BagError(f"{bag}: its attached files do not fit: {inside}") from None
