"""Writer of one MCAP file of a bag, as in the storage plugin of rosbag2."""

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

# Description of a bag for rosbag2: metadata.yaml, and the quality of service of each topic.

#: Duration by which rosbag2 describes a quality of service without a time limit.
FOREVER = interfaces.QosTime(2147483647, 4294967295)
#: Name of the MCAP record from which rosbag2 reads the metadata of a file.
RECORD = "rosbag2"
#: Key of rosbag2's metadata in the MCAP record `RECORD`.
RECORD_KEY = "serialized_metadata"
#: Start time (ns) that rosbag2 writes for a file without messages.
NEVER = 2**63 - 1


@dataclass
class FileContent:
    """Content of one file of a bag: messages per topic, first and last log time (ns)."""

    name: str
    counts: dict[str, int] = field(default_factory=dict)
    topics: dict[str, Topic] = field(default_factory=dict)
    first: int = NEVER
    last: int = 0

    def note(self, topic: Topic, log_time: int) -> None:
        """Count a written message of a topic.

        The first and last log time of the file's content are extended to ``log_time`` (ns).
        """
        self.counts[topic.name] = self.counts.get(topic.name, 0) + 1
        self.topics.setdefault(topic.name, topic)
        self.first = min(self.first, log_time)
        self.last = max(self.last, log_time)

    @property
    def total(self) -> int:
        """Number of messages of all topics in the file."""
        return sum(self.counts.values())

    @property
    def times(self) -> dict[str, dict[str, int]]:
        """Duration and start time (ns) of a bag's file, in the form of rosbag2's metadata."""
        return {
            "duration": {"nanoseconds": max(0, self.last - self.first)},
            "starting_time": {"nanoseconds_since_epoch": self.first},
        }


def offered_qos(topic: Topic) -> list[Any]:
    """Return the quality of service with which a topic was published.

    `ros2 bag play` offers the same again. The result contains one profile, in the form of version 9
    of rosbag2's metadata.
    """
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
    """Return the content of the metadata.yaml of a bag.

    `files` are the files of the bag. `topics` are listed even if they have no message yet.
    `namespace` is the prefix of all topic names, empty for the root.
    """
    description = information(files, topics, namespace)
    return _yaml({"rosbag2_bagfile_information": description}).encode()


def _yaml(data: dict[str, Any]) -> str:
    """Return data as YAML text.

    libyaml is used if it is available. It takes a tenth of the time of PyYAML's Python code.
    """
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return str(yaml.dump(data, Dumper=dumper, sort_keys=False))


def sum_contents(files: Iterable[FileContent]) -> FileContent:
    """Return the content of all files of a bag together, as that of one file."""
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
    """Return the description of a bag for rosbag2, in version 9 of its metadata.

    `files` are the files of the bag, and `topics` its topics, also those without a message.
    `namespace` is the prefix of all topic names, empty for the root.
    """
    files = list(files)
    whole = sum_contents(files)
    all_topics = {topic.name: topic for topic in topics} | whole.topics
    return {
        "version": 9,
        "storage_identifier": "mcap",
        **whole.times,
        "message_count": whole.total,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.within(namespace),
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": offered_qos(topic),
                    "type_description_hash": type_hash(topic),
                },
                "message_count": whole.counts.get(topic.name, 0),
            }
            for topic in all_topics.values()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [{"path": file.name, **file.times, "message_count": file.total} for file in files],
        "custom_data": None,
        "ros_distro": ros_distribution(),
    }


def ros_distribution() -> str:
    """Return the name of the ROS distribution.

    The name is that of the environment, else that of the installed wheels, else "unknown".
    """
    return os.environ.get("ROS_DISTRO") or _wheel_distribution()


@lru_cache(maxsize=1)
def _wheel_distribution() -> str:
    names = (re.fullmatch(r"ros[-_](\w+)[-_]rclpy", package.name) for package in distributions())
    return next((name[1] for name in names if name), "unknown")


def type_hash(topic: Topic) -> str:
    """Return the RIHS01 hash of a topic's type, or empty for an unknown type."""
    types = get_typestore(Stores.ROS2_KILTED)
    return str(types.hash_rihs01(topic.type)) if topic.type in types.types else ""


#: Wall-clock time (s) between flushes. A killed recorder loses at most the messages of this time.
FLUSH_PERIOD_S = 0.5
#: Wall-clock time (s) between fsyncs. A power cut loses at most the messages of this time.
SYNC_PERIOD_S = 0.5
#: Number of bytes that a message takes in the file in addition to its content: the heads of the
#: MCAP record and of the message, and 16 bytes in the index.
MESSAGE_OVERHEAD_BYTES = HEAD.size + MESSAGE_HEAD.size + 16
#: Media types of attachments by file name extension. All other attachments are YAML.
MEDIA = {".csv": "text/csv", ".txt": "text/plain", ".json": "application/json"}


class FileWriter:
    """Writer of an MCAP file.

    If `replaces` is False, the file must not exist yet. If it is True, the content is written to a
    temporary file next to the file, which replaces it when `replace_old` is called. Until then an
    old file of that name is not changed. Every method except `abandon` may raise OSError.
    BlockingIOError means that another process is writing the file.
    """

    def __init__(self, path: Path, replaces: bool = False, namespace: str = "") -> None:
        self.path, self._namespace = path, namespace
        self.part: Path | None = part_of(path) if replaces else None
        self.content = FileContent(path.name)
        #: Number of bytes of the messages that are written to the file so far.
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
        """True if the MCAP file is closed, so that nothing can be written any longer."""
        return self._stream.closed

    def start(self, before: list[FileContent]) -> None:
        """Write the header of the file, and the description of the bag for rosbag2.

        `before` is the content of the other files of the bag, which the description contains too.
        """
        self._writer.start(profile="ros2", library=LIBRARY)
        self._describe([*before, self.content])
        self._stream.flush()

    def attach(self, name: str, data: bytes) -> None:
        """Write a file into the MCAP file as an attachment.

        `name` is the name of the attachment, and `data` its content.
        """
        self._dirty = True
        kind = MEDIA.get(Path(name).suffix, "application/yaml")
        self._writer.add_attachment(0, 0, name, kind, data)

    def register(self, topic: Topic, definition: bytes | None = None) -> int:
        """Register a topic in the file, and return the id of its channel.

        A topic that is registered already keeps its channel. `definition` is the definition of its
        message type (default: the definition that rosbags has).
        """
        if topic.name in self._channels:
            return self._channels[topic.name]
        if definition is None:
            text, _ = self._types.generate_msgdef(topic.type, ros_version=2)
            definition = text.encode()
        if (schema := self._schemas.get((topic.type, definition))) is None:
            schema = self._writer.register_schema(topic.type, "ros2msg", definition)
            self._schemas[topic.type, definition] = schema
        # The text is JSON, which rosbag2 reads as YAML.
        properties = {"offered_qos_profiles": json.dumps(offered_qos(topic))}
        properties["topic_type_hash"] = type_hash(topic)
        channel = self._writer.register_channel(
            topic.within(self._namespace), "cdr", schema, properties
        )
        self._channels[topic.name] = channel
        return channel

    def write(self, topic: Topic, log_time: int, cdr: bytes, number: int) -> None:
        """Write one message of a registered topic, and flush the file if due.

        `log_time` is in ns, and `number` is the number of the message within its topic.
        """
        channel = self._channels[topic.name]
        self._dirty = True
        self._writer.add_message(channel, log_time, cdr, log_time, number)
        self.content.note(topic, log_time)
        self.size += MESSAGE_OVERHEAD_BYTES + len(cdr)
        if time.monotonic() - self._flushed > FLUSH_PERIOD_S:
            self.flush()

    def flush_if_due(self) -> None:
        """Flush the file if `FLUSH_PERIOD_S` has passed since the last flush.

        The method must be called a few times per second.
        """
        now = time.monotonic()
        is_due = self._dirty and now - self._flushed > FLUSH_PERIOD_S
        if is_due or (self._unsynced and now - self._synced > SYNC_PERIOD_S):
            self.flush()

    def flush(self, to_disk: bool = False) -> None:
        """Flush all messages to the file, so that they survive the end of the process.

        Every `SYNC_PERIOD_S`, or if `to_disk` is True, the file is also written to the disk
        (fsync).
        """
        self._writer.flush()
        self._stream.flush()
        self._flushed, self._dirty, self._unsynced = time.monotonic(), False, True
        if to_disk or self._flushed - self._synced > SYNC_PERIOD_S:
            self._sync()

    def replace_old(self) -> None:
        """Give the temporary file the name of the file that it replaces.

        Its content must be on the disk (fsync) already. The method does nothing without a temporary
        file.
        """
        if self.part is not None:
            files.replace(self.part, self.path)
            self.part = None

    def finish(self, whole: list[FileContent]) -> None:
        """Write the end of the file, after which it counts as closed.

        `whole` is the content of all files of the bag, for the description that rosbag2 reads.
        """
        self._writer.flush()
        self._describe(whole)
        self._writer.finish()
        self._sync()
        self._stream.close()
        self.replace_old()

    def abandon(self) -> None:
        """Leave the file as it is, so that it does not count as closed.

        A file that should have replaced another file is removed.
        """
        self.close_stream()
        if self.part is not None:
            with suppress(OSError):
                self.part.unlink()

    def close_stream(self) -> None:
        """Close the stream of an MCAP file without writing the end of the file."""
        with suppress(OSError):
            self._stream.close()

    def _describe(self, whole: list[FileContent]) -> None:
        properties = {RECORD_KEY: _yaml(information(whole, (), self._namespace))}
        self._writer.add_metadata(RECORD, properties)

    def _sync(self) -> None:
        files.sync(self._stream)
        self._flushed = self._synced = time.monotonic()
        self._dirty = self._unsynced = False
