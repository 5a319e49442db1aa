"""Bags of another test bench: standard messages, written by rosbags."""

from dataclasses import replace

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag.reader import raw_messages, read_counts
from cam_rig.bag.writer import BagWriter
from cam_rig.messages.topics import recorded_topic
from cam_rig.units import NS

TYPES = get_typestore(Stores.ROS2_KILTED)
TIME, HEADER = (
    TYPES.types[name] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header")
)
#: Wall-clock time (ns since 1970) at which the run in a bag starts.
BEGIN = 1_767_225_600_000_000_000


def header(stamp):
    return HEADER(TIME(*divmod(int(stamp), NS)), "bench")


def joint(stamp, value, name="encoder"):
    kind = TYPES.types["sensor_msgs/msg/JointState"]
    return kind(header(stamp), [name], np.array([value]), np.array([]), np.array([]))


def number(_, value):
    return TYPES.types["std_msgs/msg/Float64"](float(value))


def wrench(stamp, value):
    vector = TYPES.types["geometry_msgs/msg/Vector3"]
    forces = TYPES.types["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, value), vector(0.0, 0.0, 0.0))
    return TYPES.types["geometry_msgs/msg/WrenchStamped"](header(stamp), forces)


def write_bag(path, topics, plugin=StoragePlugin.MCAP):
    """Write a bag of standard ROS messages and return its path.

    `topics` maps a name to (function of stamp and value that makes a message, times in s, values).
    Times are relative to `BEGIN`. The log time is half a millisecond after the stamp, and increases
    within a topic.
    """
    rows = [
        (BEGIN + round(time * NS), name, make, value)
        for name, (make, times, values) in topics.items()
        for time, value in zip(times, values, strict=True)
    ]
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        made, newest = {}, {}
        for stamp, name, make, value in rows:
            message = make(stamp, value)
            kind = message.__msgtype__
            if name not in made:
                made[name] = writer.add_connection(name, kind, typestore=TYPES)
            newest[name] = max(stamp + 500_000, newest.get(name, 0) + 1)
            writer.write(made[name], newest[name], TYPES.serialize_cdr(message, kind))
    return path


def write_rigs(path, bag, *namespaces):
    """Write the messages of a cam_rig bag again, once under each namespace."""
    with BagWriter(path) as writer:
        for connection, time_ns, data in raw_messages(bag, set(read_counts(bag))):
            for namespace in namespaces:
                topic = recorded_topic(connection.topic)
                writer.write(replace(topic, name=namespace + topic.name), time_ns, bytes(data))
    return path
