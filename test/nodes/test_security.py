"""No socket leaves the machine, and nothing that others say can stop a node or make it lie."""

import math
import shutil
import struct
from array import array
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PolygonStamped
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterEvent, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy._rclpy_pybind11 import RCLError
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray, Header, MultiArrayDimension, String

from cam_rig.errors import RefusedError, RunError
from cam_rig.messages import topics
from cam_rig.messages.codec import BLOCK_LABEL, PIECE_LABEL
from cam_rig.nodes.convert import require_length
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import NodeProcess, stop_all
from cam_rig.schema.load import config_root

pytestmark = pytest.mark.ros
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
    """Every node's addresses, when each has one."""
    found = {name: sockets(node.process.pid) for name, node in processes.items()}
    return found if all(found.values()) else None


def test_every_socket_is_on_the_loopback(
    ros_domain, rig, short_scene, tmp_path, wait_for, monkeypatch
):
    """Whatever the user's own settings: the loopback, and the multicast group joined on it."""
    subnet = config_root() / "fastdds_subnet.xml"
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("FASTDDS_DEFAULT_PROFILES_FILE", str(subnet))
    shutil.copy(subnet, tmp_path / "DEFAULT_FASTDDS_PROFILES.xml")
    monkeypatch.chdir(tmp_path)
    with Graph(rig.live(short_scene, tmp_path / "bag", pacing="real_time")) as graph:
        next(graph.progress())
        found = wait_for(lambda: sockets_of_all(graph.processes))
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
    """(topic, message) of everything that a hostile program could publish."""
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
    ):
        message = kind()
        stamp = message.stamp if kind is Header else message.header.stamp
        stamp.sec = 2**31 - 1
        yield topic, message
    yield "/microphone/level", Float64(data=inf)


def forge(user, topic, message):
    """Another program's publisher, which every subscriber of the topic has discovered."""
    made = user.node.create_publisher(type(message), topic, 10 if topic in OPEN else LATCHED)
    while made.get_subscription_count() == 0:
        user.spin(0.02)
    made.publish(message)
    return made


#: What is not any node's own: a command, and every node's parameter events.
OPEN = ("/cam/rpm", "/parameter_events")
HEARS = {
    "follower": ("/cam/state", "/cam/law_coefficients"),
    "microphone": ("/cam/state", "/follower/samples"),
    "law_server": ("/cam/state",),
    "cam_drive": ("/cam/law_coefficients", "/follower/state", "/microphone/pressure",
                  "/recorder/written", "/cam/rpm"),
    "recorder": ("/cam/state", "/cam/law_coefficients", "/follower/samples", "/follower/state",
                 "/microphone/pressure", "/microphone/level"),
}  # fmt: skip


def node_alone(name, scene, folder):
    """One node, with whatever comes as its only company."""
    more = {"recorder": {"bag": str(folder / "bag")}}.get(name, {})
    return NodeProcess(name, {"scene": str(scene), **more}, False, lambda _line: None)


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", HEARS)
def test_what_cannot_be_right_ends_no_node(user, short_scene, tmp_path, wait_for, name):
    """Malformed, impossible, huge, from the past: the node warns of it, goes on, ends in order."""
    node = node_alone(name, short_scene, tmp_path)
    try:
        publishers = {}
        for topic, message in hostile():
            if topic in HEARS[name]:
                publishers[topic] = publishers.get(topic) or forge(user, topic, message)
                publishers[topic].publish(message)
                publishers[topic].publish(b"\0\1\0\0\xff\xff")
        answer = user.ask(SetParameters, f"/{name}/set_parameters", impossible_parameter())
        assert not any(result.successful for result in answer.results)
        wait_for(lambda: "refused: " in "".join(node.stderr_lines))
        assert not node.has_ended, node.stderr_lines
    finally:
        stop_all([node])
    assert node.code == 0 and "Traceback" not in "".join(node.stderr_lines), node.stderr_lines
    assert "".join(node.stderr_lines).count("refused: ") < 60, "the warnings are throttled"


def impossible_parameter():
    """A value of a type that there is not."""
    value = ParameterValue(type=77)
    return SetParameters.Request(parameters=[ParameterMessage(name="rpm", value=value)])


def open_to_all():
    """(topic, message) of what any program may publish, with impossible content."""
    yield "/cam/rpm", Float64(data=math.nan)
    yield "/cam/rpm", Float64(data=-1e9)
    for kind in (77, 4):
        changed = ParameterMessage(name="cam", value=ParameterValue(type=kind, string_value="x"))
        event = ParameterEvent(node="/law_server", changed_parameters=[changed])
        yield "/parameter_events", event
    yield "/diagnostics", DiagnosticArray(status=[DiagnosticStatus(name="laser")])
    yield "/rig/ready", String(data="nobody")


def test_messages_on_open_topics_change_nothing(user, rig, short_scene, undisturbed, tmp_path):
    """Impossible speeds, parameter events that the law server denies, other robots' diagnostics, a
    flood of each: the bag is the undisturbed one, byte by byte."""
    bag, publishers = tmp_path / "bag", {}
    with Graph(rig.live(short_scene, bag, pacing="2x")) as graph:
        reports = graph.progress()
        next(report for report in reports if report["tick"] == 10)
        for topic, message in open_to_all():
            publishers[topic] = publishers.get(topic) or forge(user, topic, message)
            for _ in range(200):
                with suppress(RCLError):  # a busy machine: the flood is as high as it can be
                    publishers[topic].publish(message)
        for _ in reports:
            pass
        logged = {name: "".join(node.stderr_lines) for name, node in graph.processes.items()}
    for name in ("cam_drive", "recorder"):
        assert "refused: " in logged[name], name
    assert not any("Traceback" in words for words in logged.values()), logged
    found = rig.payloads(bag)
    assert found.keys() == undisturbed.keys()
    for topic, expected in undisturbed.items():
        assert found[topic] == expected, topic


@pytest.mark.parametrize(
    ("topic", "message"),
    [
        ("/cam/law_coefficients", Float64MultiArray()),
        pytest.param("/clock", Clock(), marks=pytest.mark.long),
        pytest.param("/cam/state", JointState(), marks=pytest.mark.long),
        pytest.param("/cam/profile", PolygonStamped(), marks=pytest.mark.long),
        pytest.param("/follower/samples", Float64MultiArray(), marks=pytest.mark.long),
        pytest.param("/microphone/level", Float64(), marks=pytest.mark.long),
        pytest.param("/recorder/written", Header(), marks=pytest.mark.long),
    ],
)
def test_a_second_publisher_ends_the_run(user, rig, short_scene, tmp_path, topic, message):
    """Code 1; the error names the topic and the other node."""
    graph = Graph(rig.live(short_scene, tmp_path / "bag", pacing="2x"))
    words = rf"{topic}: has a second publisher, /user; allowed: one, this rig's "
    with pytest.raises(RunError, match=words), graph:
        reports = graph.progress()
        next(report for report in reports if report["tick"] == 4)
        forge(user, topic, message)
        for _ in reports:
            pass


def test_a_law_that_was_forged_first_ends_the_run(user, rig, short_scene, tmp_path):
    """Latched before the law server starts: the run ends, and names the other node."""
    law = [("tm21", 2), (PIECE_LABEL, 4)]
    forged = array_message(law, [0.0, 0.0, 1e-3, 0.0, 3.0, 0.0, 1e-3, 0.0])
    publisher = user.node.create_publisher(type(forged), "/cam/law_coefficients", LATCHED)
    publisher.publish(forged)
    graph = Graph(rig.live(short_scene, tmp_path / "bag"))
    with pytest.raises(RunError, match="/cam/law_coefficients: has a second publisher"), graph:
        for _ in graph.progress():
            pass


def test_a_message_beyond_its_topics_length_is_not_read():
    """A law of 64 MB is refused by its length, whatever is in it."""
    huge = bytes(64 << 20)
    with pytest.raises(RefusedError, match="67108864 bytes; allowed: 1048576"):
        require_length(topics.LAW_COEFFICIENTS, huge)
    with pytest.raises(RefusedError, match="/follower/samples: 67108864 bytes; allowed: 48001024"):
        require_length(topics.FOLLOWER_SAMPLES, huge)
