"""The golden bag is small, complete, and readable by other programs.

It is the reference recording in bags/golden.
"""

from xml.etree import ElementTree

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import read_ticks
from cam_rig.messages.markers import SPHERE
from cam_rig.profile import contours_at
from cam_rig.studies.simulate.recorded import read_recording
from cam_rig.units import NS, TURN

from .bags import GOLDEN, LOADED


def test_the_golden_bag_is_small_and_complete():
    """The golden bag has less than 2 MB and every tick of its scene.

    A tick is the interval between two published cam states, here one turn.
    """
    assert sum(f.stat().st_size for f in GOLDEN.iterdir()) < 2_000_000
    recording = read_recording(GOLDEN)
    counts = require_complete(GOLDEN, recording.loaded.scene)
    assert counts["/follower/samples"] == len(recording.ticks)


@pytest.fixture(scope="module")
def everything():
    """Topic, log time (ns) and message of the golden bag's messages, in file order."""
    with AnyReader([GOLDEN]) as reader:
        return [
            (connection.topic, time, reader.deserialize(raw, connection.msgtype))
            for connection, time, raw in reader.messages()
        ]


def headers(message):
    """Return all headers of a message, including nested headers."""
    if hasattr(message, "frame_id"):
        return [message]
    if isinstance(message, list):
        return [header for one in message for header in headers(one)]
    fields = getattr(message, "__dataclass_fields__", {})
    return [header for name in fields for header in headers(getattr(message, name))]


def test_every_frame_is_a_link_of_the_robot(everything):
    """Each frame_id in the golden bag is a link of the URDF or empty.

    It is empty only in /diagnostics and in the texture of a marker.
    """
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
                continue  # image of a texture
            else:
                assert header.frame_id in links, (topic, header.frame_id)
                seen.add(topic)
    assert {"/cam/state", "/joint_states", "/follower/contact", "/tf", "/tf_static"} <= seen
    assert {"/cam/markers", "/follower/markers", "/microphone/pressure", "/cam/profile"} <= seen


def test_transforms_form_one_tree_at_every_instant(everything):
    """In /tf_static and /tf each frame has one parent, and base_link is the only root."""
    parents = {}
    for topic, _, message in everything:
        if topic in ("/tf", "/tf_static"):
            for one in message.transforms:
                parent = parents.setdefault(one.child_frame_id, one.header.frame_id)
                assert parent == one.header.frame_id
    assert set(parents.values()) - set(parents) == {"base_link"}


def test_tf_agrees_with_the_joint_states(everything):
    """The transforms place the cam at its angle and the follower at its lift.

    The marker of the contact point is on the contour of the cam.
    """
    of = {
        name: {time: m for topic, time, m in everything if topic == name}
        for name in ("/joint_states", "/tf", "/follower/markers")
    }
    assert of["/joint_states"].keys() == of["/tf"].keys() == of["/follower/markers"].keys()
    cams = {time: m.header.frame_id for topic, time, m in everything if topic == "/cam/state"}
    mounted, touching = list(cams.items()), 0
    for time, joints in of["/joint_states"].items():
        theta, lift = joints.position
        transforms = {one.child_frame_id: one.transform for one in of["/tf"][time].transforms}
        r = transforms["cam"].rotation
        turn = Rotation.from_quat([r.x, r.y, r.z, r.w])
        np.testing.assert_allclose(
            turn.as_matrix(), Rotation.from_rotvec([0.0, 0.0, theta]).as_matrix(), atol=1e-11
        )
        assert transforms["follower"].translation.y == pytest.approx(lift, abs=1e-12)
        marker = of["/follower/markers"][time].markers[0]
        if marker.type != SPHERE:
            assert joints.effort[1] == 0.0
            continue
        touching += 1
        cam = [name for begin, name in mounted if begin <= time][-1]
        point = np.array([marker.pose.position.x, marker.pose.position.y, 0.0])
        of_cam = turn.inv().apply(point)[:2]
        law, follower = LOADED.laws[cam], LOADED.cams[cam].follower
        contour = contours_at(follower, law, np.array([theta]))[0].points[:, 0]
        np.testing.assert_allclose(of_cam, contour, rtol=0, atol=1e-9)
    assert touching > 1000


WANTED = ("/joint_states", "/follower/contact", "/cam/state")


def test_two_readers_find_the_motion_of_the_samples(everything):
    """Two bag readers find equal motion messages, which agree with the force samples.

    Peaks of force and lift, and the shaft power, are those of the samples.
    """
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
    time = np.array([m.header.stamp.sec + m.header.stamp.nanosec / NS for m in joints])
    angle, lift = np.array([message.position for message in joints]).T
    speed, velocity = np.array([message.velocity for message in joints]).T
    torque, force = np.array([message.effort for message in joints]).T
    np.testing.assert_array_equal([message.wrench.force.y for message in contacts], force)
    assert (np.diff(angle) > 0.0).all() and angle[-1] == pytest.approx(16 * TURN, rel=0.002)
    touching = force != 0.0
    power = force * velocity
    np.testing.assert_allclose((torque * speed)[touching], power[touching], atol=1e-9 * power.max())
    assert (torque[~touching] == 0.0).all() and 0.05 < touching.mean() < 1.0
    for rows in (tick.rows for tick in read_ticks(GOLDEN)):
        here = (time > rows[0, 0] - 1e-6) & (time < rows[0, -1] + 1e-6)
        assert (force[here].max(), force[here].min()) == (rows[4].max(), rows[4].min())
        assert lift[here].max() == rows[1].max()
