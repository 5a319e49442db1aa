"""Writing a rosbag2 directory: one MCAP file and metadata.yaml."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag.metadata import offered_qos, type_hash, write_metadata
from cam_rig.bag.topics import Topic
from cam_rig.errors import BagError

#: Wall time (s) between flushes: what a killed recorder can lose.
FLUSH_EVERY = 0.5


class BagWriter:
    """A rosbag2 bag being written; a context manager.

    Parameters
    ----------
    directory : the bag; it must not exist yet, its parent folders are made
    file : instead, an MCAP file in a folder that is there; the file must not exist yet

    Raises
    ------
    BagError : the directory or file exists already, or cannot be made
    """

    def __init__(self, directory: Path, file: Path | None = None) -> None:
        self.directory = directory
        self.counts: dict[str, int] = {}
        self._channels: dict[str, tuple[Topic, int]] = {}
        self._types = get_typestore(Stores.ROS2_KILTED)
        self._first = self._last = 0
        self._file = _create(directory) if file is None else _open(directory, file)
        self._writer = Writer(self._file, compression=CompressionType.NONE)
        self._writer.start(profile="ros2", library="cam_rig")
        self._flushed = time.monotonic()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def attach(self, name: str, data: bytes) -> None:
        """Put a file into the bag, so that it can be analysed alone."""
        kinds = {".csv": "text/csv", ".json": "application/json"}
        kind = kinds.get(Path(name).suffix, "application/yaml")
        try:
            self._writer.add_attachment(0, 0, name, kind, data)
        except OSError as error:
            raise self._lost(error) from None

    def write(self, topic: Topic, log_time: int, cdr: bytes, definition: bytes = b"") -> None:
        """Write one serialized message at a rig time in ns.

        Parameters
        ----------
        definition : of the message's type, where rosbags does not know it

        Raises
        ------
        BagError : the disk is full, or gone
        """
        try:
            if topic.name not in self._channels:
                self._channels[topic.name] = (topic, self._register(topic, definition))
            self._first = min(self._first, log_time) if self.counts else log_time
            self._last = max(self._last, log_time)
            number = self.counts.get(topic.name, 0) + 1
            channel = self._channels[topic.name][1]
            self._writer.add_message(channel, log_time, cdr, log_time, number)
            self.counts[topic.name] = number
            if time.monotonic() - self._flushed > FLUSH_EVERY:
                self.flush()
        except OSError as error:
            raise self._lost(error) from None

    @property
    def unflushed(self) -> float:
        """Wall time (s) since the last flush."""
        return time.monotonic() - self._flushed

    def flush(self) -> None:
        """Put everything into the file, where a killed process cannot lose it."""
        try:
            self._writer.flush()
            self._file.flush()
            self._flushed = time.monotonic()
        except OSError as error:
            raise self._lost(error) from None

    def close(self) -> None:
        """Finish the MCAP file and write metadata.yaml."""
        if self._file.closed:
            return
        try:
            self._writer.finish()
            self._file.close()
            topics = [topic for topic, _ in self._channels.values()]
            span = range(self._first, self._last)
            write_metadata(Path(self._file.name), topics, self.counts, span)
        except OSError as error:
            raise self._lost(error) from None

    def _lost(self, error: OSError) -> BagError:
        written = sum(self.counts.values())
        return BagError(
            f"{self.directory}: cannot be written ({error.strerror}) after {written} messages"
        )

    def _register(self, topic: Topic, definition: bytes) -> int:
        if not definition:
            text, _ = self._types.generate_msgdef(topic.type, ros_version=2)
            definition = text.encode()
        schema = self._writer.register_schema(topic.type, "ros2msg", definition)
        # JSON is YAML, which rosbag2 reads here.
        about = {"offered_qos_profiles": json.dumps(offered_qos(topic))}
        about["topic_type_hash"] = type_hash(topic)
        return self._writer.register_channel(topic.name, "cdr", schema, about)


def bag_file(directory: Path) -> Path:
    """Where a bag's MCAP file is written."""
    return directory / f"{directory.name}_0.mcap"


def require_new_bag(directory: Path) -> None:
    """Refuse, before anything is started, a bag that cannot be made.

    Raises
    ------
    BagError : it exists already, or its place cannot be written
    """
    try:
        there = directory.exists()
        place = next(path for path in directory.absolute().parents if path.exists())
    except OSError as error:
        raise BagError(f"{directory}: cannot be made ({error.strerror})") from None
    if there:
        raise BagError(f"{directory}: exists already, not overwriting; name another bag")
    if not (place.is_dir() and os.access(place, os.W_OK | os.X_OK)):
        raise BagError(f"{directory}: cannot be made, {place} cannot be written")


def _create(directory: Path) -> BinaryIO:
    try:
        directory.mkdir(parents=True)
    except FileExistsError:
        raise BagError(f"{directory}: exists already, not overwriting; name another bag") from None
    except OSError as error:
        raise BagError(f"{directory}: cannot be made ({error.strerror})") from None
    return _open(directory, bag_file(directory))


def _open(directory: Path, file: Path) -> BinaryIO:
    try:
        return file.open("xb")
    except FileExistsError:
        raise BagError(f"{file}: exists already, not overwriting; name another bag") from None
    except OSError as error:
        raise BagError(f"{directory}: cannot be made ({error.strerror})") from None
