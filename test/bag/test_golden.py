"""The golden bag: small, whole, and read by standards alone; test/report: reproduced to 1e-9 dB."""

from xml.etree import ElementTree

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import read_bag
from cam_rig.units import NS

from .bags import GOLDEN


def test_the_golden_bag_is_small_and_complete():
    """Under 2 MB, with every tick of its scene by count."""
    assert sum(f.stat().st_size for f in GOLDEN.iterdir()) < 2_000_000
    recording = read_bag(GOLDEN)
    counts = require_complete(GOLDEN, recording.loaded.scene)
    assert counts["/follower/samples"] == len(recording.ticks)


@pytest.fixture(scope="module")
def everything():
    """Topic, log time and message of all, in the order of the file."""
    with AnyReader([GOLDEN]) as reader:
        return [
            (connection.topic, time, reader.deserialize(raw, connection.msgtype))
            for connection, time, raw in reader.messages()
        ]


def headers(message):
    """Every header of a message, nested ones too."""
    if hasattr(message, "frame_id"):
        return [message]
    if isinstance(message, list):
        return [header for one in message for header in headers(one)]
    fields = getattr(message, "__dataclass_fields__", {})
    return [header for name in fields for header in headers(getattr(message, name))]


def test_every_frame_is_a_link_of_the_robot(everything):
    """Empty alone in /diagnostics, and in the picture that no marker has."""
    descriptions = [m.data for topic, _, m in everything if topic == "/robot_description"]
    links = {
        link.get("name")
        for text in descriptions
        for link in ElementTree.fromstring(text).iter("link")
    }
    seen = set()
    for topic, _, message in everything:
        for header in headers(message):
            if topic == "/diagnostics":
                assert header.frame_id == ""
            elif topic.endswith("/markers") and header.frame_id == "":
                continue  # of its texture
            else:
                assert header.frame_id in links, (topic, header.frame_id)
                seen.add(topic)
    assert {"/cam/state", "/joint_states", "/follower/contact", "/tf", "/tf_static"} <= seen
    assert {"/cam/markers", "/follower/markers", "/microphone/pressure", "/cam/profile"} <= seen


WANTED = ("/joint_states", "/follower/contact", "/cam/state")


def test_two_readers_find_the_same(everything):
    """By rosbags' own types, and by those in the file; log times are the stamps."""
    found = {topic: [] for topic in WANTED}
    for topic, log_time, message in everything:
        if topic in WANTED:
            found[topic].append(message)
            stamp = message.header.stamp
            assert log_time == stamp.sec * NS + stamp.nanosec
    others = {topic: [] for topic in WANTED}
    with bag_file(GOLDEN).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(WANTED):
            others[channel.topic].append(message)
    for topic in WANTED[::2]:
        for one, other in zip(found[topic], others[topic], strict=True):
            assert one.header.frame_id == other.header.frame_id
            for field in ("position", "velocity", "effort"):
                assert list(getattr(one, field)) == list(getattr(other, field))
    joints, contacts = found["/joint_states"], others["/follower/contact"]
    assert {tuple(message.name) for message in joints} == {("cam", "follower")}
    assert {message.header.frame_id for message in contacts} == {"follower"}
    forces = [message.effort[1] for message in joints]
    assert [message.wrench.force.y for message in contacts] == forces
