"""The description of a bag for rosbag2: metadata.yaml, and each topic's quality of service.

The same is in each MCAP file, as rosbag2's storage plugin writes it: a metadata record ``rosbag2``,
whose ``serialized_metadata`` is YAML, when it begins the file and again when it ends it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import distributions
from typing import Any

import yaml
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2.metadata import dump_qos_v9
from rosbags.typesys import Stores, get_typestore

from cam_rig.messages.topics import Topic

FOREVER = QosTime(2147483647, 4294967295)
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
        name = topic.name
        if name in self.counts:
            self.counts[name] += 1
        else:
            self.counts[name], self.topics[name] = 1, topic
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
    durability = QosDurability.TRANSIENT_LOCAL if topic.latched else QosDurability.VOLATILE
    qos = Qos(
        history=QosHistory.KEEP_LAST,
        depth=topic.depth,
        reliability=QosReliability.RELIABLE,
        durability=durability,
        deadline=FOREVER,
        lifespan=FOREVER,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=FOREVER,
        avoid_ros_namespace_conventions=False,
    )
    return list(dump_qos_v9([qos]))


def metadata(
    files: Iterable[FileContent], topics: Iterable[Topic] = (), namespace: str = ""
) -> bytes:
    """The metadata.yaml of a bag of some MCAP files.

    Parameters
    ----------
    topics : listed though they may have no message yet
    namespace : of the rig, before each topic's name
    """
    about = information(files, topics, namespace)
    return _yaml({"rosbag2_bagfile_information": about}).encode()


def metadata_record(files: Iterable[FileContent], namespace: str = "") -> dict[str, str]:
    """The content of the record that rosbag2 reads an MCAP file's metadata from."""
    return {RECORD_KEY: _yaml(information(files, (), namespace))}


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
    """The ROS distribution that is at work: the environment's, else that of the installed wheels.

    ``unknown`` where there is none.
    """
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
