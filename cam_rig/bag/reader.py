"""Reading a recorded run back: ticks, counts, and the scene that was attached to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag2 import ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import topics
from cam_rig.bag.codec import cam_state_of, stamp_ns
from cam_rig.bag.salvage import DAMAGE, reason
from cam_rig.bag.temporary import no_room, temporary_folder
from cam_rig.bag.topics import Topic
from cam_rig.errors import BagError, CamRigError, RefusedError
from cam_rig.experiment.noise import HeardTick
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import Stage, open_stage

#: What rosbags raises on a bag that is none.
UNREADABLE = (
    AnyReaderError,
    ReaderError,
    SerdeError,
    AssertionError,
    TypeError,
    AttributeError,
    *DAMAGE,
)
#: What may be named instead of what is no bag.
WANTED = "name a folder with metadata.yaml and an .mcap file, or an .mcap file"


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
    except UNREADABLE as error:
        raise damaged(bag, error) from None


def read_recording(bag: Path, scene: Path | None = None) -> Recording:
    """Read what the analysis of a run needs.

    Parameters
    ----------
    scene : the scene that was run, for a bag without one attached (``ros2 bag record``)

    Raises
    ------
    BagError : the bag is missing, was not closed, or holds another kind of run
    """
    stage = read_stage(bag) if scene is None else open_stage(scene)
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
    ticks = [
        HeardTick(start, end.time_ns, pressures[end.time_ns], start.holds_until(end))
        for start, end in pairwise(states)
        if end.time_ns in pressures and start.turns_until(end)
    ]
    return Recording(stage, ticks, read_counts(bag))


def mcap_file(bag: Path) -> Path:
    """The one MCAP file of a bag."""
    if bag.suffix == ".mcap" and bag.is_file():
        return bag
    if what := no_bag(bag):
        raise BagError(f"{bag}: {what}; {WANTED}")
    files = sorted(bag.glob("*.mcap"))
    if len(files) != 1:
        raise BagError(f"{bag}: holds {len(files)} .mcap files; allowed: one")
    return files[0]


def read_counts(bag: Path) -> dict[str, int]:
    """Messages a topic, from the bag's own statistics; of every file of a bag that was split.

    Raises
    ------
    BagError : no such bag, or one that was not closed
    """
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_KILTED)) as reader:
            counts: dict[str, int] = {}
            for connection in reader.connections:
                counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    return dict(sorted(counts.items()))


def read_stage(bag: Path) -> Stage:
    """The scene with its cams, rig and published curves as they were attached.

    Raises
    ------
    BagError : nothing is attached, or it does not fit together
    """
    with temporary_folder() as folder:
        scene = unpack(bag, folder)
        try:
            stage = open_stage(scene)
            for cam in sorted((scene.parent.parent / "cams").glob("*.yaml")):
                stage.mount(cam.stem)  # by hand, while it ran
            return stage
        except CamRigError as error:
            inside = str(error).replace(f"{folder}/config/", "")
            raise BagError(f"{bag}: its attached files do not fit: {inside}") from None


def unpack(bag: Path, folder: Path) -> Path:
    """Write the files attached to a bag into ``folder/config``; the scene's path.

    Raises
    ------
    BagError : no scene is attached, or a name points out of the folder
    OutputError : the folder has no room
    """
    scene = None
    try:
        with mcap_file(bag).open("rb") as stream:
            for attachment in make_reader(stream).iter_attachments():
                path = folder / "config" / Path(attachment.name)
                if not path.resolve().is_relative_to(folder.resolve()):
                    raise BagError(f"{bag}: attachment {attachment.name!r} points elsewhere")
                _write(path, attachment.data)
                scene = path if path.parent.name == "scenes" else scene
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    if scene is None:
        raise BagError(
            f"{bag}: has no scene attached, it was not recorded by cam_rig; name the scene with "
            "--scene"
        )
    return scene


def _write(path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except OSError as error:
        raise no_room(path.parent, error) from None


def damaged(bag: Path, error: Exception) -> BagError:
    """What to say of a bag that cannot be read: what it is instead, or how to mend it."""
    if what := no_bag(bag):
        return BagError(f"{bag}: {what}; {WANTED}")
    return BagError(
        f"{bag}: cannot be read as a rosbag2 bag ({reason(error)}); if it was not closed, mend it "
        f"with: cam-rig recover {bag}"
    )


def no_bag(path: Path) -> str | None:
    """Why a path is no bag and never was one, in words; None where it is or was."""
    if not path.exists():
        return "no such bag"
    if path.is_dir():
        files = sorted(path.glob("*.mcap"))
        if not files and not (path / "metadata.yaml").exists():  # else of another kind, as SQLite
            return "has no .mcap file in it, so it is no bag"
    elif path.suffix == ".mcap":
        files = [path]
    else:
        return "is no bag"
    with suppress(OSError):
        for file in files:
            with file.open("rb") as stream:
                if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                    return f"{file.name} does not begin as an MCAP file does, so it is no bag"
    return None
