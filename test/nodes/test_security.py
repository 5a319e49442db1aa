"""Robustness of the nodes against messages of other programs."""

import math
from array import array
from contextlib import suppress
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterEvent, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy._rclpy_pybind11 import RCLError
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray, Header, MultiArrayDimension, String

from cam_rig.errors import RefusedError, RunError
from cam_rig.messages import topics
from cam_rig.messages.codec import BLOCK_LABEL, PIECE_LABEL
from cam_rig.nodes.base import publisher_monitor
from cam_rig.nodes.convert import require_length
from cam_rig.nodes.parameters import ABOUT

from .conftest import SLOW, OneProcess, patient, payloads_of, wait_until

pytestmark = pytest.mark.ros
LATCHED = QoSProfile(depth=32, durability=DurabilityPolicy.TRANSIENT_LOCAL)


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
    """Yield topic and message of each kind of invalid message.

    The nodes must survive them.
    """
    nan, law = math.nan, [("tm21", 2), (PIECE_LABEL, 4)]
    yield "/cam/state", state(3, [nan], [1.0])
    yield "/cam/state", state(3, [], [])
    yield "/cam/state", state(-5, [0.0], [20.0])
    yield "/cam/state", state(1, [3.0], [20.0], "../../../etc/passwd")
    yield "/cam/law_coefficients", array_message(law, [0.0, 0.0, 1.0, 0.0, 3.0, 0.0, 1.0, 0.0])
    yield "/cam/law_coefficients", array_message(law, [nan] * 8)
    yield "/cam/law_coefficients", array_message([("x" * 100_000, 1), (PIECE_LABEL, 2)], [0.0, 0.0])
    yield "/cam/law_coefficients", array_message([("huge", 4_294_967_295), (PIECE_LABEL, 9)], [0.0])
    yield "/follower/samples", array_message([(BLOCK_LABEL, 6), ("sample", 100)], [1e308] * 600)
    yield "/follower/samples", array_message([("a", 1), ("b", 2_000_000)], np.zeros(2_000_000))
    yield "/follower/samples", array_message([], [])
    yield "/cam/rpm", Float64(data=nan)
    far = Header(stamp=Time(sec=2**31 - 1))
    yield "/follower/state", JointState(header=far)
    yield "/microphone/pressure", FluidPressure(header=far)
    yield "/recorder/ack", far
    yield "/microphone/level", Float64(data=math.inf)


def forge(user, topic, message):
    """Publish a message as another program, and return its publisher.

    The message is published after a subscriber of the topic has been discovered.
    """
    publisher = user.node.create_publisher(type(message), topic, 10 if topic in OPEN else LATCHED)
    while publisher.get_subscription_count() == 0:
        user.spin(0.02)
    publisher.publish(message)
    return publisher


#: Topics that any program may publish and that do not keep (latch) messages.
OPEN = ("/cam/rpm", "/parameter_events")


def test_invalid_messages_do_not_end_a_node(user, short_scene, tmp_path, capfd):
    """A node that receives an invalid message logs a warning and continues.

    The messages are malformed, impossible, huge or from the past.
    """
    for name in ("follower", "microphone", "law_server", "cam_drive", "recorder"):
        subscribed = {topic.name for topic in ABOUT[name].subscribed}
        parameters = {"scene": str(short_scene), "on_finish": "wait"}
        parameters |= {"output_uri": str(tmp_path / "bag")} if name == "recorder" else {}
        logged = ""
        with OneProcess({name: parameters}) as here:
            publishers = {}
            for topic, message in hostile():
                if topic in subscribed:
                    publishers[topic] = publishers.get(topic) or forge(user, topic, message)
                    publishers[topic].publish(message)
                    publishers[topic].publish(b"\0\1\0\0\xff\xff")
            impossible = [ParameterMessage(name="rpm", value=ParameterValue(type=77))]
            request = SetParameters.Request(parameters=impossible)
            answer = user.ask(SetParameters, f"/{name}/set_parameters", request)
            assert not any(result.successful for result in answer.results)
            while "rejected: " not in logged:
                logged += capfd.readouterr().err
            assert here.is_running(name), logged
        for publisher in publishers.values():
            user.node.destroy_publisher(publisher)
        logged += capfd.readouterr().err
        assert here.codes == {name: 0} and "Traceback" not in logged, logged
        assert logged.count("rejected: ") < 60, "the warnings are throttled"


def open_topics():
    """Yield a topic that any program may publish, with an impossible message of it."""
    yield "/cam/rpm", Float64(data=math.nan)
    yield "/cam/rpm", Float64(data=-1e9)
    for kind in (77, 4):
        changed = ParameterMessage(name="cam", value=ParameterValue(type=kind, string_value="x"))
        event = ParameterEvent(node="/law_server", changed_parameters=[changed])
        yield "/parameter_events", event
    yield "/diagnostics", DiagnosticArray(status=[DiagnosticStatus(name="laser")])
    yield "/rig/ready", String(data="nobody")


def test_impossible_messages_on_open_topics_do_not_affect_the_run(
    user, short_scene, undisturbed, tmp_path, capfd
):
    """Impossible messages on open topics do not change the bag of a run.

    Any program may publish on these topics. The messages are impossible speeds, parameter
    events that the law server does not confirm and diagnostics of other robots. Each is
    published 100 times.
    """
    bag, publishers = tmp_path / "bag", {}
    with OneProcess(patient(short_scene, bag, pacing=SLOW)) as here:
        reports = here.progress()
        next(report for report in reports if report["tick"] == 2)
        for topic, message in open_topics():
            publishers[topic] = publishers.get(topic) or forge(user, topic, message)
            for _ in range(100):
                with suppress(RCLError):  # a writer may be blocked on a busy machine
                    publishers[topic].publish(message)
        user.set("cam_drive", "pacing", "free")
        for _ in reports:
            pass
    logged = capfd.readouterr().err
    for name in ("cam_drive", "recorder"):
        assert f"[{name}]: rejected: " in logged, name
    assert "Traceback" not in logged
    assert payloads_of(bag) == undisturbed


@pytest.mark.parametrize(
    ("topic", "message"), [("/cam/state", JointState()), ("/recorder/ack", Header())]
)
def test_a_second_publisher_ends_the_run(user, short_scene, tmp_path, topic, message):
    """A second publisher of a topic ends the run with an error.

    It contains the topic, which belongs to the rig, and the second publisher's node.
    """
    text = rf"{topic}: has a second publisher, /user; only this rig's "
    here = OneProcess(patient(short_scene, tmp_path / "bag", pacing=SLOW))
    with pytest.raises(RunError, match=text), here:
        reports = here.progress()
        next(report for report in reports if report["tick"] == 2)
        forge(user, topic, message)
        for _ in reports:
            pass


@pytest.mark.parametrize(("patience", "name"), [(300.0, "/user"), (0.0, "a program that is not")])
def test_a_second_publisher_is_named_when_its_name_is_discovered(
    make, user, monkeypatch, patience, name
):
    """A message of a publisher without a name is held back until the name is known.

    DDS can announce an endpoint before the name of its node. After a limited time the error reports
    a program without a name.
    """
    monkeypatch.setattr(publisher_monitor, "MAX_NAME_WAIT_S", patience)
    recorder = make("recorder")
    drive = rclpy.create_node("cam_drive", context=user.context)
    for node in (drive, user.node):
        node.create_publisher(JointState, "/cam/state", 10)
    found = recorder.get_publishers_info_by_topic
    wait_until(lambda: len(found("/cam/state")) == 2)
    infos = found("/cam/state")
    fields = ("node_namespace", "topic_type", "endpoint_gid")
    unnamed = [
        SimpleNamespace(node_name="_NODE_NAME_UNKNOWN_", **{k: getattr(i, k) for k in fields})
        for i in infos
    ]
    monkeypatch.setattr(recorder, "get_publishers_info_by_topic", lambda _topic: unnamed)
    monitor, topic = recorder.publisher_monitor, topics.CAM_STATE
    receive = recorder._guard(topic.relative, partial(recorder._on_message, topic))
    cdr = serialize_message(JointState())
    for gid in (bytes(info.endpoint_gid) for info in infos):
        receive(cdr, {"publication_sequence_number": 1, "publisher_gid": {"data": gid}})
    monitor._check()
    assert (recorder.failure is None) == (patience > 0.0)
    monkeypatch.setattr(recorder, "get_publishers_info_by_topic", found)
    wait_until(lambda: monitor._check() or recorder.failure is not None)
    assert f"/cam/state: has a second publisher, {name}" in str(recorder.failure)
    drive.destroy_node()


def test_a_law_that_was_forged_before_the_start_ends_the_run(user, short_scene, tmp_path):
    """A motion law that another program latched before the start ends the run.

    The error has the topic of the law.
    """
    law = [("tm21", 2), (PIECE_LABEL, 4)]
    forged = array_message(law, [0.0, 0.0, 1e-3, 0.0, 3.0, 0.0, 1e-3, 0.0])
    publisher = user.node.create_publisher(type(forged), "/cam/law_coefficients", LATCHED)
    publisher.publish(forged)
    here = OneProcess(patient(short_scene, tmp_path / "bag"))
    with pytest.raises(RunError, match="/cam/law_coefficients: has a second publisher"), here:
        for _ in here.progress():
            pass


def test_a_message_that_is_too_long_for_its_topic_is_rejected():
    """A message that is too long for its topic is refused by its length, unread.

    Here it is a law of 64 MB.
    """
    huge = bytes(64 << 20)
    with pytest.raises(RefusedError, match="at most 1048576 bytes, got 67108864"):
        require_length(topics.LAW_COEFFICIENTS, huge)
    with pytest.raises(RefusedError, match=r"/follower/samples: .*48001024 bytes, got 67108864"):
        require_length(topics.FOLLOWER_SAMPLES, huge)
