"""The description of a bag for rosbag2: metadata.yaml, and each topic's quality of service."""

from __future__ import annotations

import os
import re
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


def metadata(file: str, topics: list[Topic], counts: dict[str, int], span: range) -> bytes:
    """The metadata.yaml of an MCAP file of a name that holds ``span`` ns of rig time."""
    times: dict[str, Any] = {
        "duration": {"nanoseconds": span.stop - span.start},
        "starting_time": {"nanoseconds_since_epoch": span.start},
    }
    total = sum(counts.values())
    information = {
        "version": 9,
        "storage_identifier": "mcap",
        **times,
        "message_count": total,
        "topics_with_message_count": [
            {"topic_metadata": _of_topic(topic), "message_count": counts.get(topic.name, 0)}
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **times, "message_count": total}],
        "custom_data": None,
        "ros_distro": ros_distribution(),
    }
    text = yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False)
    return text.encode()


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


def _of_topic(topic: Topic) -> dict[str, Any]:
    return {
        "name": topic.name,
        "type": topic.type,
        "serialization_format": "cdr",
        "offered_qos_profiles": offered_qos(topic),
        "type_description_hash": type_hash(topic),
    }
