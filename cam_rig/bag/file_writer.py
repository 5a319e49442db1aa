"""Writing one MCAP file of a bag, as rosbag2's storage plugin writes it."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer
from rosbags import interfaces
from rosbags.rosbag2.metadata import dump_qos_v9
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import files
from cam_rig.bag.files import part_of
from cam_rig.bag.partial_reader import LIBRARY
from cam_rig.bag.records import HEAD, MESSAGE_HEAD
from cam_rig.messages.topics import Topic

# The description of a bag for rosbag2: metadata.yaml, and each topic's quality of service.

FOREVER = interfaces.QosTime(2147483647, 4294967295)
#: The record in an MCAP file, and the key in it, that rosbag2 reads a file's metadata from.
RECORD, RECORD_KEY = "rosbag2", "serialized_metadata"
#: The time (ns) at which a file without messages begins, as rosbag2 has it.
NEVER = 2**63 - 1


@dataclass
class FileContent:
    """What one file of a bag holds: messages a topic, first and last log time (ns)."""

    name: str
    counts: dict[str, int] = field(default_factory=dict)
    topics: dict[str, Topic] = field(default_factory=dict)
    first: int = NEVER
    last: int = 0

    def note(self, topic: Topic, log_time: int) -> None:
        """Count one message."""
        self.counts[topic.name] = self.counts.get(topic.name, 0) + 1
        self.topics.setdefault(topic.name, topic)
        self.first = min(self.first, log_time)
        self.last = max(self.last, log_time)

    @property
    def total(self) -> int:
        """Messages of all topics."""
        return sum(self.counts.values())

    @property
    def times(self) -> dict[str, dict[str, int]]:
        """Duration and start as rosbag2 names them."""
        return {
            "duration": {"nanoseconds": max(0, self.last - self.first)},
            "starting_time": {"nanoseconds_since_epoch": self.first},
        }


def offered_qos(topic: Topic) -> list[Any]:
    """What a topic was published with; `ros2 bag play` offers the same again."""
    durability = interfaces.QosDurability["TRANSIENT_LOCAL" if topic.latched else "VOLATILE"]
    qos = interfaces.Qos(
        history=interfaces.QosHistory.KEEP_LAST,
        depth=topic.depth,
        reliability=interfaces.QosReliability.RELIABLE,
        durability=durability,
        deadline=FOREVER,
        lifespan=FOREVER,
        liveliness=interfaces.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=FOREVER,
        avoid_ros_namespace_conventions=False,
    )
    return list(dump_qos_v9([qos]))


def metadata(
    files: Iterable[FileContent], topics: Iterable[Topic] = (), namespace: str = ""
) -> bytes:
    """The metadata.yaml of a bag; ``topics`` are listed though they may have no message yet."""
    about = information(files, topics, namespace)
    return _yaml({"rosbag2_bagfile_information": about}).encode()


def _yaml(data: dict[str, Any]) -> str:
    """As text; by libyaml where it is there, which takes a tenth of the time."""
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return str(yaml.dump(data, Dumper=dumper, sort_keys=False))


def together(files: Iterable[FileContent]) -> FileContent:
    """What all files of a bag hold."""
    whole = FileContent("")
    for file in files:
        whole.topics = file.topics | whole.topics
        whole.first, whole.last = min(whole.first, file.first), max(whole.last, file.last)
        for name, count in file.counts.items():
            whole.counts[name] = whole.counts.get(name, 0) + count
    return whole


def information(
    files: Iterable[FileContent], topics: Iterable[Topic], namespace: str
) -> dict[str, Any]:
    """What rosbag2 knows of a bag, version 9 of its metadata."""
    files = list(files)
    whole = together(files)
    listed = {topic.name: topic for topic in topics} | whole.topics
    return {
        "version": 9,
        "storage_identifier": "mcap",
        **whole.times,
        "message_count": whole.total,
        "topics_with_message_count": [
            {
                "topic_metadata": _of_topic(topic, namespace),
                "message_count": whole.counts.get(topic.name, 0),
            }
            for topic in listed.values()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [{"path": file.name, **file.times, "message_count": file.total} for file in files],
        "custom_data": None,
        "ros_distro": ros_distribution(),
    }


def ros_distribution() -> str:
    """The ROS distribution: the environment's, else that of the installed wheels, or unknown."""
    return os.environ.get("ROS_DISTRO") or _of_wheels()


@lru_cache(maxsize=1)
def _of_wheels() -> str:
    names = (re.fullmatch(r"ros[-_](\w+)[-_]rclpy", each.name) for each in distributions())
    return next((name[1] for name in names if name), "unknown")


def type_hash(topic: Topic) -> str:
    """The type's RIHS01 hash; empty for a type that is not known."""
    types = get_typestore(Stores.ROS2_KILTED)
    return str(types.hash_rihs01(topic.type)) if topic.type in types.types else ""


def _of_topic(topic: Topic, namespace: str) -> dict[str, Any]:
    return {
        "name": topic.within(namespace),
        "type": topic.type,
        "serialization_format": "cdr",
        "offered_qos_profiles": offered_qos(topic),
        "type_description_hash": type_hash(topic),
    }


#: Wall time (s) between flushes: what a killed recorder can lose; and between two fsyncs: what a
#: power cut can take.
FLUSH_PERIOD_S = SYNC_PERIOD_S = 0.5
#: Bytes that a message takes beside its content: two heads, and its place in the index.
BYTES_BESIDE = HEAD.size + MESSAGE_HEAD.size + 16
#: Media types of attachments by the end of their names; others are YAML.
MEDIA = {".csv": "text/csv", ".txt": "text/plain", ".json": "application/json"}


class FileWriter:
    """An MCAP file being written; every method but `abandon` may raise an OSError.

    It must not exist yet. What ``replaces`` a file is written beside it, and takes its place when
    `replace_old` is called; until then that file, if there is one, stays as it is. BlockingIOError:
    another process is writing it.
    """

    def __init__(self, path: Path, replaces: bool = False, namespace: str = "") -> None:
        self.path, self._namespace = path, namespace
        self.part: Path | None = part_of(path) if replaces else None
        self.content = FileContent(path.name)
        #: Bytes of its messages so far.
        self.size = 0
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._types = get_typestore(Stores.ROS2_KILTED)
        self._dirty = self._unsynced = True
        self._stream = files.create(self.part or path)
        self._writer = Writer(self._stream, compression=CompressionType.NONE)
        self._flushed = self._synced = time.monotonic()

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any longer."""
        return self._stream.closed

    def start(self, before: list[FileContent]) -> None:
        """Write the file's head; ``before`` are the bag's other files."""
        self._writer.start(profile="ros2", library=LIBRARY)
        self._describe([*before, self.content])
        self._stream.flush()

    def attach(self, name: str, data: bytes) -> None:
        """Put a file into it."""
        self._dirty = True
        kind = MEDIA.get(Path(name).suffix, "application/yaml")
        self._writer.add_attachment(0, 0, name, kind, data)

    def register(self, topic: Topic, definition: bytes | None = None) -> int:
        """A topic's channel; ``definition`` is its type's, by default what rosbags knows of it."""
        if topic.name in self._channels:
            return self._channels[topic.name]
        if definition is None:
            text, _ = self._types.generate_msgdef(topic.type, ros_version=2)
            definition = text.encode()
        if (schema := self._schemas.get((topic.type, definition))) is None:
            schema = self._writer.register_schema(topic.type, "ros2msg", definition)
            self._schemas[topic.type, definition] = schema
        # JSON is YAML, which rosbag2 reads here.
        about = {"offered_qos_profiles": json.dumps(offered_qos(topic))}
        about["topic_type_hash"] = type_hash(topic)
        channel = self._writer.register_channel(topic.within(self._namespace), "cdr", schema, about)
        self._channels[topic.name] = channel
        return channel

    def write(self, topic: Topic, log_time: int, cdr: bytes, number: int) -> None:
        """Write one message of a registered topic; flush when that is due."""
        channel = self._channels[topic.name]
        self._dirty = True
        self._writer.add_message(channel, log_time, cdr, log_time, number)
        self.content.note(topic, log_time)
        self.size += BYTES_BESIDE + len(cdr)
        if time.monotonic() - self._flushed > FLUSH_PERIOD_S:
            self.flush()

    def flush_if_due(self) -> None:
        """Flush what was written a while ago; to be called a few times a second."""
        now = time.monotonic()
        is_due = self._dirty and now - self._flushed > FLUSH_PERIOD_S
        if is_due or (self._unsynced and now - self._synced > SYNC_PERIOD_S):
            self.flush()

    def flush(self, to_disk: bool = False) -> None:
        """Write everything to the file, safe from a kill; every half second fsync as well."""
        self._writer.flush()
        self._stream.flush()
        self._flushed, self._dirty, self._unsynced = time.monotonic(), False, True
        if to_disk or self._flushed - self._synced > SYNC_PERIOD_S:
            self._sync()

    def replace_old(self) -> None:
        """Let the new file, which is on the disk, replace the old one of its name."""
        if self.part is not None:
            files.replace(self.part, self.path)
            self.part = None

    def finish(self, whole: list[FileContent]) -> None:
        """Write the end of the file and of the bag (``whole``), by which it counts as closed."""
        self._writer.flush()
        self._describe(whole)
        self._writer.finish()
        self._sync()
        self._stream.close()
        self.replace_old()

    def abandon(self) -> None:
        """Leave the file as it is, not closed; one that was to replace another is removed."""
        self.close_stream()
        if self.part is not None:
            with suppress(OSError):
                self.part.unlink()

    def close_stream(self) -> None:
        """Write nothing more."""
        with suppress(OSError):
            self._stream.close()

    def _describe(self, whole: list[FileContent]) -> None:
        about = {RECORD_KEY: _yaml(information(whole, (), self._namespace))}
        self._writer.add_metadata(RECORD, about)

    def _sync(self) -> None:
        files.sync(self._stream)
        self._flushed = self._synced = time.monotonic()
        self._dirty = self._unsynced = False
