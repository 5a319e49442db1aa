"""Reading a recorded run back: ticks, counts, and the scene that was attached to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Attachment
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import topics
from cam_rig.bag.bounds import require_bounded, require_plain
from cam_rig.bag.codec import cam_state_of, stamp_ns
from cam_rig.bag.files import TORN, WANTED, is_closed, mcap_file, no_bag
from cam_rig.bag.pieces import MIB, content, pieces
from cam_rig.bag.salvage import DAMAGE, attachment_of, reason
from cam_rig.bag.temporary import no_room, temporary_folder
from cam_rig.bag.topics import Topic
from cam_rig.errors import BagError, CamRigError, RefusedError
from cam_rig.experiment.noise import HeardTick
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import Stage, open_stage

#: What rosbags raises on a bag that is none.
UNREADABLE = (
    ReaderError,
    SerdeError,
    AssertionError,
    TypeError,
    AttributeError,
    *DAMAGE,
)
#: Attached to a bag that was recovered and lacks something: what.
RECOVERED = "recovered.txt"
#: Files attached to a bag, and their bytes; a scene with a hundred cams and their tables has less.
MOST_ATTACHED, MOST_ATTACHED_BYTES = 1000, 64 * MIB
#: Bytes of a path of an attached file, and of one name in it.
MOST_PATH, MOST_NAME = 1000, 255


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
    """A reader of each file of a bag, none of which asks for more memory than its size warrants.

    What metadata.yaml says is in the files too, so that it is not asked.

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
            raise ValueError(f"{torn.name} is left by a mending that was cut off, and holds all")
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
        for attachment in attachments(mcap_file(bag)):
            path = folder / "config" / _safe(bag, attachment.name)
            _write(bag, path, attachment.data)
            scene = path if path.parent.name == "scenes" else scene
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    if scene is None:
        raise BagError(
            f"{bag}: has no scene attached, it was not recorded by cam_rig; name the scene with "
            "--scene"
        )
    return scene


def recovered_words(bag: Path) -> list[str]:
    """What was said of a bag each time it was recovered: what it lacks, what may be wrong in it.

    Raises
    ------
    BagError : no such bag, or it is damaged
    """
    found = bag.glob("*.mcap") if bag.is_dir() else [bag] if bag.suffix == ".mcap" else []
    try:
        return [
            " ".join(one.data.decode(errors="replace").split())
            for file in sorted(found)
            for one in attachments(file)
            if one.name == RECOVERED
        ]
    except UNREADABLE as error:
        raise damaged(bag, error) from None


def attachments(file: Path) -> Iterator[Attachment]:
    """What is attached to an MCAP file, of one that was not closed too.

    Raises
    ------
    BagError : too much is attached
    ValueError, McapError, struct.error : one is not what was written
    """
    number = size = 0
    with file.open("rb") as stream:
        for piece in pieces(stream):
            if piece.opcode != Opcode.ATTACHMENT or not piece.whole:
                continue
            number, size = number + 1, size + piece.length
            if number > MOST_ATTACHED or size > MOST_ATTACHED_BYTES:
                raise BagError(
                    f"{file}: {number} attachments of {size} bytes; allowed: {MOST_ATTACHED} of "
                    f"{MOST_ATTACHED_BYTES}"
                )
            yield attachment_of(content(stream, piece))


def _safe(bag: Path, name: str) -> Path:
    """The path of an attached file in its folder.

    Raises
    ------
    BagError : it points out of the folder, or no file can have this name
    """
    parts = name.split("/")
    if name.startswith("/") or ".." in parts or "\0" in name:
        raise BagError(f"{bag}: attachment {name[:80]!r} points elsewhere")
    longest = max(len(part.encode()) for part in parts)
    if longest > MOST_NAME or len(name.encode()) > MOST_PATH or not Path(name).name:
        raise BagError(
            f"{bag}: attachment {name[:80]!r} has a name of {longest} bytes; allowed: 1 to "
            f"{MOST_NAME}, and {MOST_PATH} with its folders"
        )
    return Path(name)


def _write(bag: Path, path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except (FileExistsError, IsADirectoryError, NotADirectoryError):
        raise BagError(
            f"{bag}: attachment {path.name[:80]!r} is a file here and a folder there"
        ) from None
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
