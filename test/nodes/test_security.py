"""No socket leaves the machine, and nothing that others say can stop a node or make it lie."""

import math
import shutil
import struct
import time
from array import array
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy._rclpy_pybind11 import RCLError
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray, Header, MultiArrayDimension

from cam_rig.bag.codec import BLOCK_LABEL, PIECE_LABEL
from cam_rig.cli.graph import Graph
from cam_rig.schema.load import config_root

pytestmark = pytest.mark.ros
#: Rounds of a flood of more than twenty messages each: a second of it where a machine is idle.
FLOODS = 400
LATCHED = QoSProfile(depth=32, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def sockets(pid):
    """Local IPv4 and IPv6 addresses of a process's UDP and TCP sockets."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed since it was listed
            target = str(link.readlink())
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found = set()
    for table in ("udp", "udp6", "tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[9] in inodes:
                host = fields[1].split(":")[0]
                found.add(".".join(str(b) for b in struct.pack("<I", int(host[:8], 16))))
    return found


def sockets_of_all(processes):
    """Every node's addresses, when each has one: some may still be starting."""
    found = {name: sockets(node.process.pid) for name, node in processes.items()}
    return found if all(found.values()) else None


def test_every_socket_is_on_the_loopback(ros_domain, rig, short_scene, tmp_path, monkeypatch):
    """Whatever the user's own settings: the loopback, and the multicast group joined on it."""
    subnet = config_root() / "fastdds_subnet.xml"
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("FASTDDS_DEFAULT_PROFILES_FILE", str(subnet))
    shutil.copy(subnet, tmp_path / "DEFAULT_FASTDDS_PROFILES.xml")
    monkeypatch.chdir(tmp_path)
    with Graph(rig.live(short_scene, tmp_path / "bag", pacing="real_time")) as graph:
        next(graph.progress())
        found = rig.wait(lambda: sockets_of_all(graph.processes))
    assert found.keys() == {"recorder", "microphone", "follower", "law_server", "cam_drive"}
    assert all("127.0.0.1" in addresses for addresses in found.values())
    assert set.union(*found.values()) <= {"127.0.0.1", "239.255.0.1"}


def state(stamp, angle, speed, frame="tm21"):
    message = JointState(name=["cam"], position=angle, velocity=speed, effort=[0.0])
    message.header.stamp.sec, message.header.frame_id = stamp, frame
    return message


def array_message(dims, data):
    message = Float64MultiArray(data=array("d", data))
    for label, size in dims:
        message.layout.dim.append(MultiArrayDimension(label=label, size=size))
    return message


def hostile():
    """(topic, message) of everything that a rig could be told by somebody who means it harm."""
    nan, inf = math.nan, math.inf
    for angle, speed in (([nan], [1.0]), ([0.0], [inf]), ([], []), ([1.0, 2.0], [3.0]),
                         ([0.0], [-5.0]), ([0.0], [1e9]), ([1e300], [1.0])):  # fmt: skip
        yield "/cam/state", state(3, angle, speed)
    yield "/cam/state", state(0, [0.0], [20.0])
    yield "/cam/state", state(2**31 - 1, [0.0], [20.0])
    yield "/cam/state", state(-5, [0.0], [20.0])
    yield "/cam/state", state(1, [3.0], [20.0], "../../../etc/passwd")
    law = [("tm21", 2), (PIECE_LABEL, 4)]
    yield "/cam/law_coefficients", array_message(law, [0.0, 0.0, 1.0, 0.0, 3.0, 0.0, 1.0, 0.0])
    yield "/cam/law_coefficients", array_message(law, [nan] * 8)
    yield "/cam/law_coefficients", array_message(law, [0.0, 1e300, -1e300, 0.0] * 2)
    yield "/cam/law_coefficients", array_message([], [1.0])
    yield "/cam/law_coefficients", array_message([("x" * 100_000, 1), (PIECE_LABEL, 2)], [0.0, 0.0])
    yield "/cam/law_coefficients", array_message([("huge", 4_294_967_295), (PIECE_LABEL, 9)], [0.0])
    block = [(BLOCK_LABEL, 6), ("sample", 100)]
    yield "/follower/samples", array_message(block, [nan] * 600)
    yield "/follower/samples", array_message(block, [1e308] * 600)
    yield "/follower/samples", array_message(block, np.repeat([1.0, 0, 0, 0, 9, 9], 100))
    yield "/follower/samples", array_message([("a", 1), ("b", 2_000_000)], np.zeros(2_000_000))
    yield "/follower/samples", array_message([], [])
    yield "/cam/rpm", Float64(data=nan)
    yield "/cam/rpm", Float64(data=-1e9)
    for kind, topic in (
        (JointState, "/follower/state"),
        (FluidPressure, "/microphone/pressure"),
        (Header, "/recorder/written"),
        (WrenchStamped, "/follower/contact"),
    ):
        message = kind()
        stamp = message.stamp if kind is Header else message.header.stamp
        stamp.sec = 2**31 - 1
        yield topic, message
    yield "/microphone/level", Float64(data=inf)


def is_small(message):
    """Whether a flood of it is one of messages, not of bytes; a speed is a user's to command."""
    return not isinstance(message, Float64) and len(getattr(message, "data", ())) <= 600


@pytest.mark.xdist_group("short")
def test_a_hostile_publisher_changes_nothing(user, rig, short_scene, undisturbed, tmp_path):
    """Malformed, impossible, huge, from the past, and a flood: every node lives on, and the bag is
    the undisturbed one, byte by byte."""
    bag = tmp_path / "bag"
    with Graph(rig.live(short_scene, bag, pacing="2x")) as graph:
        reports = graph.progress()
        next(report for report in reports if report["tick"] == 10)
        publishers = {}
        for topic, message in hostile():
            if topic not in publishers:
                qos = 10 if topic == "/cam/rpm" else LATCHED
                publishers[topic] = user.node.create_publisher(type(message), topic, qos)
                while publishers[topic].get_subscription_count() == 0:
                    user.spin(0.02)
            publishers[topic].publish(message)
            publishers[topic].publish(b"\0\1\0\0\xff\xff")
        flood = {publishers[topic]: message for topic, message in hostile() if is_small(message)}
        for _ in range(FLOODS):
            for publisher, message in flood.items():
                with suppress(RCLError):  # a busy machine: the flood is as high as it can be
                    publisher.publish(message)
            time.sleep(1e-4)
        for _ in reports:
            pass
        said = {name: "".join(node.words) for name, node in graph.processes.items()}
    for name in ("cam_drive", "follower", "microphone", "recorder", "law_server"):
        assert "refused: " in said[name], name
        assert said[name].count("refused: ") < 60, "the warnings are throttled"
        assert "Traceback" not in said[name], said[name]
    found = rig.payloads(bag)
    assert found.keys() == undisturbed.keys()
    for topic, expected in undisturbed.items():
        if topic != "/diagnostics":  # the drive may say that it lags
            assert found[topic] == expected, topic
