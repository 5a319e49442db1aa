"""Reader of a recorded run: ticks, message counts, and the attached scene."""

from __future__ import annotations

import shlex
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_typestore

from cam_rig.bag.connection import CDR, Connection
from cam_rig.bag.files import (
    SQLITE,
    UNREADABLE,
    is_closed,
    read_error,
    require_a_bag,
    require_regular,
)
from cam_rig.bag.foreign.topic_line import EXAMPLE
from cam_rig.bag.listing import STORAGE, list_files, require_agreement
from cam_rig.bag.mcap_file import McapFile
from cam_rig.bag.partial_reader import recovery_notes, unpack
from cam_rig.bag.records import require_bounded, require_plain
from cam_rig.bag.sqlite_file import SqliteFile
from cam_rig.dynamics import ANGLE_TOLERANCE
from cam_rig.errors import BagError, CamRigError, RefusedError
from cam_rig.files import temporary_folder
from cam_rig.live.flow_control import HISTORY_DEPTH
from cam_rig.messages import topics
from cam_rig.messages.codec import block_of, cam_state_of, stamp_ns
from cam_rig.messages.topics import Topic, recorded_topic
from cam_rig.simulation.scene import LoadedScene, open_scene
from cam_rig.simulation.schedule import CamState, tick_count
from cam_rig.simulation.simulate import TickSamples
from cam_rig.units import NS, FloatArray

#: Reader of one file of a bag, MCAP or SQLite. Both types have `connections` and
#: `messages(connections)`.
BagReader = McapFile | SqliteFile


def messages(
    bag: Path, wanted: tuple[Topic, ...], namespace: str | None = None
) -> Iterator[tuple[Topic, int, Any]]:
    """Yield topic, rig time (ns) and message of some topics in the order of the bag.

    `namespace` chooses the rig of a bag with several rigs.
    """
    by_name = {topic.name: topic for topic in wanted}
    types = get_typestore(Stores.ROS2_KILTED)
    for connection, log_time, data in raw_messages(bag, set(by_name), namespace):
        topic = by_name[connection.topic]
        if connection.msgtype != topic.type:
            raise BagError(
                f"{bag}: the type of {topic.name} must be {topic.type}, got {connection.msgtype}"
            )
        try:
            message = types.deserialize_cdr(data, topic.type)
        except UNREADABLE as error:
            raise read_error(bag, error) from None
        yield topic, log_time, message


def decoded(
    bag: Path, decoders: Mapping[Topic, Callable[[Any], Any]], namespace: str | None = None
) -> Iterator[tuple[Topic, Any]]:
    """Yield topic and decoded message of some topics in the order of the bag.

    `decoders` contains a function per topic that converts its messages. Raises BagError if a
    function refuses a message (RefusedError).
    """
    for topic, _, message in messages(bag, tuple(decoders), namespace):
        try:
            value = decoders[topic](message)
        except RefusedError as error:
            raise BagError(f"{bag}: {error}") from None
        yield topic, value


def pressure_of(message: Any) -> tuple[int, float]:
    """Return the stamp (ns) and the r.m.s. sound pressure (Pa) of a pressure message.

    The stamp is the end of the tick for which the pressure was computed. A tick is the time between
    two cam states.
    """
    return stamp_ns(message.header.stamp), float(message.fluid_pressure)


def raw_messages(
    bag: Path, names: set[str], chosen: str | None = None
) -> Iterator[tuple[Connection, int, bytes]]:
    """Yield connection, rig time (ns) and data of serialized messages, in order.

    A connection is a topic in a file. `names` are names of topics without namespace, and `chosen`
    is the namespace of a rig. The topic of a connection is returned without the namespace.
    """
    try:
        rigs = set[str]()
        for reader in readers(bag):
            namespace = _namespace(bag, reader, rigs) if chosen is None else chosen
            topic_names = {namespace + name: name for name in names}
            connections = [c for c in reader.connections if c.topic in topic_names]
            for connection, time_ns, data in reader.messages(connections) if connections else ():
                yield connection._replace(topic=topic_names[connection.topic]), time_ns, data
    except UNREADABLE as error:
        raise read_error(bag, error) from None


def readers(bag: Path) -> Iterator[BagReader]:
    """Yield a reader of each file of a bag in turn.

    Each file is checked first, so that its reader needs no more memory than the size of the file
    allows.
    """
    try:
        for file in _sources(bag):
            with SqliteFile(file) if file.suffix == SQLITE else McapFile(file) as reader:
                yield reader
    except UNREADABLE as error:
        raise read_error(bag, error) from None


def _sources(bag: Path) -> tuple[Path, ...]:
    require_regular(bag)
    if bag.is_dir():
        require_plain(bag)
    listing = list_files(bag)
    for file in listing.files:
        if file.suffix not in STORAGE:
            require_a_bag(bag)
        elif file.suffix != SQLITE:
            if not is_closed(file):
                require_a_bag(bag)
                raise BagError(
                    f"{bag}: {file.name} was not closed; stop its recorder with Ctrl-C, or recover "
                    f"the bag with: cam-rig recover {bag}"
                )
            require_bounded(file)
    if not listing.files:
        raise ValueError("has neither an .mcap nor a .db3 file")
    require_agreement(bag, listing)
    return listing.files


def _namespace(bag: Path, reader: BagReader, rigs: set[str]) -> str:
    """Return the namespace of the only rig in a bag, empty for the root.

    `rigs` are the namespaces in the files before that of `reader`, to which those of this file are
    added. Raises BagError if there are several rigs.
    """
    rigs |= _rigs(reader)
    if len(rigs) > 1:
        several = ", ".join(sorted(name or "/" for name in rigs))
        raise BagError(
            f"{bag}: must contain one rig, got {several}; record each rig into a separate bag"
        )
    return next(iter(rigs), "")


def _rigs(reader: BagReader) -> set[str]:
    names = {connection.topic for connection in reader.connections}
    cams = {name for name in names if recorded_topic(name) is topics.CAM_STATE}
    return {name.removesuffix(topics.CAM_STATE.name) for name in cams}


def rigs_of(bag: Path) -> list[str]:
    """Return the namespaces of the rigs in a bag. The root namespace is an empty text."""
    return sorted(set[str]().union(*(_rigs(reader) for reader in readers(bag))))


def topics_of(bag: Path) -> dict[str, Connection]:
    """Return the topics of a bag that have messages, by name."""
    connections = {
        connection.topic: connection
        for reader in readers(bag)
        for connection in reader.connections
        if connection.msgcount
    }
    return dict(sorted(connections.items()))


def topic_list(bag: Path) -> str:
    """Return the topics of a bag with their types, for an error message."""
    entries = [
        f"{topic.topic} [{topic.msgtype}{'' if topic.encoding == CDR else f', {topic.encoding}'}]"
        for topic in topics_of(bag).values()
    ]
    return ", ".join(entries) or "no messages"


def require_rig(bag: Path) -> None:
    """Raise BagError for a bag that was not recorded by this package.

    The message names cam-rig compare, which can read such a bag.
    """
    if not rigs_of(bag) and topics_of(bag):
        raise BagError(
            f"{bag}: is not a recording of cam_rig, its topics are {topic_list(bag)}; compare it "
            f"with a scene by: cam-rig compare {shlex.quote(str(bag))} SCENE --topics '{EXAMPLE}'"
        )


def shortcomings(bag: Path, loaded: LoadedScene, ticks: int) -> tuple[str, ...]:
    """Return notes on the damage of a recording.

    They are the reports of recoveries, and a line if the bag has fewer ticks (times between two cam
    states) than its scene. `ticks` is the number of recorded ticks.
    """
    planned = tick_count(loaded.scene)
    notes = [f"not complete: {ticks} of {planned} ticks"] if ticks < planned else []
    return *recovery_notes(bag), *notes


def read_ticks(bag: Path, namespace: str | None = None) -> Iterator[TickSamples]:
    """Yield the follower's samples per tick, with the cam states before and after it.

    A tick is the time between two cam states. It is left out if its states are missing, because the
    cam angle is then unknown. States and samples are stored only until they are combined.
    `namespace` chooses the rig of a bag with several rigs.
    """
    states: deque[CamState] = deque()
    waiting: deque[FloatArray] = deque(maxlen=4 * HISTORY_DEPTH)
    decoders = {topics.CAM_STATE: cam_state_of, topics.FOLLOWER_SAMPLES: block_of}
    for topic, value in decoded(bag, decoders, namespace):
        (states if topic is topics.CAM_STATE else waiting).append(value)
        while states and waiting and states[-1].time_ns / NS > waiting[0][0, -1]:
            tick = _join_tick(states, waiting.popleft())
            if tick is not None:
                yield tick


def _join_tick(states: deque[CamState], rows: FloatArray) -> TickSamples | None:
    """Return the samples of a tick together with the cam's motion.

    `states` contains the cam states from before the tick on. States that are no longer needed are
    removed from it. `rows` contains the samples, with the times (s) in the first row. Returns None
    if the states before or after the tick are missing. A tick is the time between two cam states.
    """
    middle = 0.5 * (rows[0, 0] + rows[0, -1])
    while len(states) > 1 and states[1].time_ns / NS <= middle:
        states.popleft()
    if len(states) == 1 or states[0].time_ns / NS > middle:
        return None
    start, end = states[0], states[1]
    if not start.turns_until(end):
        return None
    interval = start.until(end)
    deviation = interval.angle_at(interval.duration) - interval.angle - end.since(start)
    # The angle does not fit if the speed changed between the two states: then states between them
    # are missing.
    return None if abs(deviation) > ANGLE_TOLERANCE else TickSamples(start, interval, rows)


def read_counts(bag: Path) -> dict[str, int]:
    """Return the number of messages per topic, from the statistics of all files."""
    counts: dict[str, int] = {}
    rigs = set[str]()
    for reader in readers(bag):
        namespace = _namespace(bag, reader, rigs)
        for connection in reader.connections:
            name = connection.topic.removeprefix(namespace)
            counts[name] = counts.get(name, 0) + connection.msgcount
    return dict(sorted(counts.items()))


def scene_of(bag: Path, scene: Path | None = None) -> LoadedScene:
    """Return the scene of a recording of the rig.

    `scene` is a file that replaces the attached scene.
    """
    require_rig(bag)
    return read_scene(bag) if scene is None else open_scene(scene)


def read_scene(bag: Path) -> LoadedScene:
    """Return the scene that is attached to a bag, with cams, rig and published curves."""
    with temporary_folder() as folder:
        scene = unpack(bag, folder)
        try:
            loaded = open_scene(scene)
            for cam in sorted((scene.parent.parent / "cams").glob("*.yaml")):
                loaded.mount(cam.stem)  # mounted by an operator during the run
            return loaded
        except CamRigError as error:
            text = str(error).replace(f"{folder}/config/", "")
            raise BagError(f"{bag}: the attached scene is invalid: {text}") from None
