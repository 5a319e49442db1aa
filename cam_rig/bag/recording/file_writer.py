"""Writing one MCAP file of a bag, as rosbag2's storage plugin writes it."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from pathlib import Path

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import files
from cam_rig.bag.files import part_of
from cam_rig.bag.partial_reader import LIBRARY
from cam_rig.bag.recording.metadata import (
    RECORD,
    FileContent,
    metadata_record,
    offered_qos,
    type_hash,
)
from cam_rig.bag.records import HEAD, MESSAGE_HEAD
from cam_rig.messages.topics import Topic

#: Wall time (s) between flushes: what a killed recorder can lose.
FLUSH_PERIOD_S = 0.5
#: Wall time (s) between two fsyncs: what a power cut can take.
SYNC_PERIOD_S = 0.5
#: Bytes that a message takes beside its content: two heads, and its place in the index.
BYTES_BESIDE = HEAD.size + MESSAGE_HEAD.size + 16
#: Media types of attachments by the end of their names; others are YAML.
MEDIA = {".csv": "text/csv", ".txt": "text/plain", ".json": "application/json"}


class FileWriter:
    """An MCAP file being written; every method but `abandon` may raise an OSError.

    Parameters
    ----------
    path : the file; it must not exist yet
    replaces : instead, what is written replaces a file of this name when `replace_old` is called;
        until then that file, if there is one, stays as it is
    namespace : of the rig, "/rig1"; put before each topic's name

    Raises
    ------
    BlockingIOError : another process is writing it
    OSError : it exists already, or cannot be made
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
        if self._dirty and now - self._flushed > FLUSH_PERIOD_S:
            self.flush()
        elif self._unsynced and now - self._synced > SYNC_PERIOD_S:
            self.sync()

    def flush(self) -> None:
        """Write everything to the file, where a killed process cannot lose it.

        Every half second, fsync as well, so that a power cut cannot take it either.
        """
        self._writer.flush()
        self._stream.flush()
        self._flushed, self._dirty, self._unsynced = time.monotonic(), False, True
        if self._flushed - self._synced > SYNC_PERIOD_S:
            self._sync()

    def sync(self) -> None:
        """Write everything to the disk (fsync)."""
        self._writer.flush()
        self._sync()

    def replace_old(self) -> None:
        """Let the new file, which is on the disk, replace the old one of its name."""
        if self.part is not None:
            files.replace(self.part, self.path)
            self.part = None

    def finish(self, whole: list[FileContent]) -> None:
        """Write the file's end, by which it counts as closed; it replaces an old one last of all.

        ``whole`` is the bag so far, this file too.
        """
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
        """Write what rosbag2 knows of the bag so far."""
        self._writer.add_metadata(RECORD, metadata_record(whole, self._namespace))

    def _sync(self) -> None:
        files.sync(self._stream)
        self._flushed = self._synced = time.monotonic()
        self._dirty = self._unsynced = False
