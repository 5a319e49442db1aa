"""Writing a rosbag2 directory: one MCAP file and metadata.yaml."""

from __future__ import annotations

import time
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from cam_rig.bag.topics import Topic
from cam_rig.errors import BagError

#: Wall time (s) between flushes: what a killed recorder can lose.
FLUSH_EVERY = 0.5


class BagWriter:
    """A rosbag2 bag being written; a context manager.

    Parameters
    ----------
    directory : the bag; it must not exist yet, its parent folders are made

    Raises
    ------
    BagError : the directory exists already, or cannot be made
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.counts: dict[str, int] = {}
        self._channels: dict[str, tuple[Topic, int]] = {}
        self._types = get_typestore(Stores.ROS2_KILTED)
        self._first = self._last = 0
        self._file = _create(directory)
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
        self._writer.add_attachment(0, 0, name, "application/yaml", data)

    def write(self, topic: Topic, log_time: int, cdr: bytes) -> None:
        """Write one serialized message at a rig time in ns."""
        if topic.name not in self._channels:
            self._channels[topic.name] = (topic, self._register(topic))
        self._first = min(self._first, log_time) if self.counts else log_time
        self._last = max(self._last, log_time)
        self.counts[topic.name] = self.counts.get(topic.name, 0) + 1
        channel = self._channels[topic.name][1]
        try:
            self._writer.add_message(channel, log_time, cdr, log_time, self.counts[topic.name])
            if time.monotonic() - self._flushed > FLUSH_EVERY:
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
            with (self.directory / "metadata.yaml").open("w", encoding="utf-8") as stream:
                YAML().dump({"rosbag2_bagfile_information": self._metadata()}, stream)
        except OSError as error:
            raise self._lost(error) from None

    def _lost(self, error: OSError) -> BagError:
        written = sum(self.counts.values())
        return BagError(
            f"{self.directory}: cannot be written ({error.strerror}) after {written} messages"
        )

    def _register(self, topic: Topic) -> int:
        text, _ = self._types.generate_msgdef(topic.type, ros_version=2)
        schema = self._writer.register_schema(topic.type, "ros2msg", text.encode())
        return self._writer.register_channel(topic.name, "cdr", schema)

    def _metadata(self) -> dict[str, Any]:
        span = {"duration": {"nanoseconds": self._last - self._first}}
        start = {"starting_time": {"nanoseconds_since_epoch": self._first}}
        path, total = Path(self._file.name).name, sum(self.counts.values())
        return {
            "version": 9,
            "storage_identifier": "mcap",
            **span,
            **start,
            "message_count": total,
            "topics_with_message_count": [
                {"topic_metadata": self._topic(topic), "message_count": self.counts[topic.name]}
                for topic, _ in self._channels.values()
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [path],
            "files": [{"path": path, **start, **span, "message_count": total}],
            "custom_data": None,
            "ros_distro": "kilted",
        }

    def _topic(self, topic: Topic) -> dict[str, Any]:
        return {
            "name": topic.name,
            "type": topic.type,
            "serialization_format": "cdr",
            "offered_qos_profiles": [],
            "type_description_hash": self._types.hash_rihs01(topic.type),
        }


def _create(directory: Path) -> BinaryIO:
    try:
        directory.mkdir(parents=True)
        return (directory / f"{directory.name}_0.mcap").open("xb")
    except FileExistsError:
        raise BagError(f"{directory}: exists already, not overwriting; name another bag") from None
    except OSError as error:
        raise BagError(f"{directory}: cannot be made ({error.strerror})") from None
