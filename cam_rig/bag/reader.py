"""Reading a recorded run back: ticks, counts, and the scene that was attached to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from cam_rig.arrays import FloatArray
from cam_rig.bag.attached import unpack
from cam_rig.bag.bounds import require_bounded, require_plain
from cam_rig.bag.damage import UNREADABLE, damaged
from cam_rig.bag.files import TORN, is_closed
from cam_rig.errors import BagError, CamRigError, RefusedError
from cam_rig.files import temporary_folder
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, cam_state_of, decode_block, stamp_ns
from cam_rig.messages.topics import Topic
from cam_rig.simulation.levels import MeasuredTick
from cam_rig.simulation.loaded_scene import LoadedScene, open_scene
from cam_rig.simulation.schedule import CamState


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded run: its scene, its ticks, and how many messages each topic has."""

    loaded: LoadedScene
    ticks: list[MeasuredTick]
    counts: dict[str, int]


def messages(bag: Path, wanted: tuple[Topic, ...]) -> Iterator[tuple[Topic, int, Any]]:
    """Topic, rig time in ns, and message, in the order of the bag.

    Raises
    ------
    BagError : no such bag, or one that was not closed
    """
    by_name = {topic.name: topic for topic in wanted}
    types = get_typestore(Stores.ROS2_KILTED)
    for connection, log_time, data in raw_messages(bag, set(by_name)):
        topic = by_name[connection.topic]
        if connection.msgtype != topic.type:
            raise BagError(f"{bag}: {topic.name} is {connection.msgtype}; wanted: {topic.type}")
        try:
            message = types.deserialize_cdr(data, topic.type)
        except UNREADABLE as error:
            raise damaged(bag, error) from None
        yield topic, log_time, message


def raw_messages(bag: Path, names: set[str]) -> Iterator[tuple[Connection, int, bytes]]:
    """The serialized messages of some topics with their rig time in ns, in the order of the bag.

    Raises
    ------
    BagError : no such bag, one that was not closed, or one that claims too much
    """
    with open_readers(bag) as readers:
        for reader in readers:
            wanted = [c for c in reader.connections if c.topic in names]
            yield from reader.messages(wanted) if wanted else ()


@contextmanager
def open_readers(bag: Path) -> Iterator[list[Reader]]:
    """A reader of each file of a bag, none of which takes more memory than its size warrants.

    The content of metadata.yaml is in the files too, so it is not read.

    Raises
    ------
    BagError : no such bag, one that was not closed, or one that claims too much
    """
    try:
        with ExitStack() as stack:
            yield [stack.enter_context(Reader(file)) for file in _sources(bag)]
    except UNREADABLE as error:
        raise damaged(bag, error) from None


def _sources(bag: Path) -> list[Path]:
    """The files of a bag that can be read, in their order."""
    found = [bag]
    if bag.is_dir():
        require_plain(bag)
        files = [*bag.glob("*.mcap"), *bag.glob("*.db3"), *bag.glob(f"*{TORN}")]
        found = sorted(files, key=lambda file: (len(file.name), file.name))
    for file in found:
        if (torn := file.with_suffix(TORN)).exists():
            raise ValueError(f"{torn.name} is left by an interrupted recovery, and holds all")
        if file.suffix == ".mcap":
            if not is_closed(file):
                raise ValueError(f"{file.name} was not closed")
            require_bounded(file)
    if not found:
        raise ValueError("has neither an .mcap nor a .db3 file")
    return found


def read_recording(bag: Path, scene: Path | None = None) -> Recording:
    """Read what the analysis of a run needs.

    Parameters
    ----------
    scene : the scene that was run, for a bag without one attached (``ros2 bag record``)

    Raises
    ------
    BagError : the bag is missing, was not closed, or holds another kind of run
    """
    loaded = read_scene(bag) if scene is None else open_scene(scene)
    states: list[CamState] = []
    pressures: dict[int, float] = {}
    try:
        for topic, _, message in messages(bag, (topics.CAM_STATE, topics.PRESSURE)):
            if topic is topics.CAM_STATE:
                states.append(cam_state_of(message))
            else:
                pressures[stamp_ns(message.header.stamp)] = float(message.fluid_pressure)
    except RefusedError as error:
        raise BagError(f"{bag}: {error}") from None
    if other := {state.cam for state in states} - set(loaded.laws):
        raise BagError(
            f"{bag}: holds {', '.join(sorted(other))}; allowed: the cams of scene "
            f"{loaded.scene.name}, {', '.join(loaded.laws)}, so name the scene that was run"
        )
    ticks = [
        MeasuredTick(start, end.time_ns, pressures[end.time_ns], start.holds_until(end))
        for start, end in pairwise(states)
        if end.time_ns in pressures and start.turns_until(end)
    ]
    return Recording(loaded, ticks, read_counts(bag))


def read_samples(bag: Path) -> Iterator[FloatArray]:
    """The follower's samples tick by tick, ``(6, n)`` rows each.

    Raises
    ------
    BagError : no such bag, one that was not closed, or samples that are none
    """
    try:
        for _, _, message in messages(bag, (topics.FOLLOWER_SAMPLES,)):
            yield decode_block(*array_of(message))
    except RefusedError as error:
        raise BagError(f"{bag}: {error}") from None


def read_counts(bag: Path) -> dict[str, int]:
    """Messages a topic, from the bag's own statistics; of every file of a bag that was split.

    Raises
    ------
    BagError : no such bag, or one that was not closed
    """
    counts: dict[str, int] = {}
    with open_readers(bag) as readers:
        for connection in chain.from_iterable(reader.connections for reader in readers):
            counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
    return dict(sorted(counts.items()))


def read_scene(bag: Path) -> LoadedScene:
    """The scene with its cams, rig and published curves as they were attached.

    Raises
    ------
    BagError : nothing is attached, or it does not fit together
    """
    with temporary_folder() as folder:
        scene = unpack(bag, folder)
        try:
            loaded = open_scene(scene)
            for cam in sorted((scene.parent.parent / "cams").glob("*.yaml")):
                loaded.mount(cam.stem)  # by an operator, while it ran
            return loaded
        except CamRigError as error:
            inside = str(error).replace(f"{folder}/config/", "")
            raise BagError(f"{bag}: its attached files do not fit: {inside}") from None
