"""The golden bag: made once and kept; whoever changes the rig must still reproduce it.

Other programs read it by standard messages alone: `rosbags` by its own definitions of the types,
`mcap_ros2` by those that are in the file. Its frames are in one tree, and make one picture.
"""

from itertools import pairwise
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.files import mcap_file
from cam_rig.bag.reader import messages, read_recording, read_scene, read_ticks
from cam_rig.messages.codec import cam_state_of
from cam_rig.messages.markers import SPHERE
from cam_rig.messages.topics import CAM_STATE
from cam_rig.profile import contours_at
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import simulate, step_levels
from cam_rig.units import NS, TURN

from .bags import GOLDEN, LOADED


def test_the_golden_bag_is_small_and_complete():
    """Under 2 MB, with every tick of its scene by count."""
    assert sum(f.stat().st_size for f in GOLDEN.iterdir()) < 2_000_000
    recording = read_recording(GOLDEN)
    counts = require_complete(GOLDEN, recording.loaded.scene)
    assert counts["/follower/samples"] == len(recording.ticks)


def test_the_golden_bag_is_reproduced():
    """The scene attached to it, simulated now, gives the recorded levels to 1e-9 dB."""
    recording = read_recording(GOLDEN)
    settle = recording.loaded.scene.program.settle_turns.si
    recorded = step_levels(recording.ticks, settle)
    now = step_levels(simulate(recording.loaded), settle)
    assert recorded.keys() == now.keys() == {"tm21", "bezier15"}
    for cam, steps in recorded.items():
        assert steps == pytest.approx(now[cam], abs=1e-9)


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
            if topic in ("/diagnostics",):
                assert header.frame_id == ""
            elif topic.endswith("/markers") and header.frame_id == "":
                continue  # of its texture
            else:
                assert header.frame_id in links, (topic, header.frame_id)
                seen.add(topic)
    assert {"/cam/state", "/joint_states", "/follower/contact", "/tf", "/tf_static"} <= seen
    assert {"/cam/markers", "/follower/markers", "/microphone/pressure", "/cam/profile"} <= seen


def test_transforms_form_one_tree_at_every_instant(everything):
    """Each link has one parent, /tf_static and /tf together; base_link has none."""
    parents = {}
    for topic, _, message in everything:
        if topic in ("/tf", "/tf_static"):
            for one in message.transforms:
                parent = parents.setdefault(one.child_frame_id, one.header.frame_id)
                assert parent == one.header.frame_id
    assert set(parents.values()) - set(parents) == {"base_link"}


def test_tf_is_made_of_the_joints_beside_it(everything):
    """At each instant: the cam turned by the joint's θ, the follower raised by its lift; and the
    point of contact, taken into the cam's frame by /tf, is on the mounted cam's contour."""
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


# The motion in standard messages.

WANTED = ("/joint_states", "/follower/contact", "/cam/state")


class Joints(NamedTuple):
    """A row a message: rig time (s), then of both joints position, velocity and effort."""

    rows: np.ndarray

    def of(self, joint):
        return self.rows[:, (1, 3, 5) if joint == "cam" else (2, 4, 6)].T

    @property
    def time(self):
        return self.rows[:, 0]


def of_rosbags(everything):
    """Topic, log time and message, by the definitions of rosbags."""
    return (row for row in everything if row[0] in WANTED)


def of_mcap_ros2(_):
    """The same by definitions in the file."""
    with mcap_file(GOLDEN).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages(WANTED):
            yield channel.topic, record.log_time, message


def seconds(message):
    return message.header.stamp.sec + message.header.stamp.nanosec / NS


@pytest.fixture(scope="module", params=[of_rosbags, of_mcap_ros2], ids=["rosbags", "mcap_ros2"])
def found(request, everything):
    """Every message by topic, in the order of the log times."""
    by_topic = {topic: [] for topic in WANTED}
    for topic, log_time, message in request.param(everything):
        stamp = message.header.stamp
        assert log_time == stamp.sec * NS + stamp.nanosec
        by_topic[topic].append(message)
    return by_topic


@pytest.fixture(scope="module")
def joints(found):
    """What /joint_states says."""
    rows = []
    for message in found["/joint_states"]:
        assert list(message.name) == ["cam", "follower"]
        assert message.header.frame_id == "base_link"
        pairs = (message.position, message.velocity, message.effort)
        rows.append([seconds(message), *(value for pair in pairs for value in pair)])
    return Joints(np.array(rows))


def test_the_whole_lift_is_there(joints):
    """Every cam's, at every speed that it holds the follower, and the largest of the samples."""
    samples, scene = [tick.rows for tick in read_ticks(GOLDEN)], read_scene(GOLDEN)
    lift, velocity, _ = joints.of("follower")
    assert lift.max() == max(rows[1].max() for rows in samples)
    assert lift.min() == min(rows[1].min() for rows in samples)
    states = list(cam_states(scene.scene))
    for start, end in list(pairwise(states))[:2]:  # tm21 at 200 rpm, which stays on its cam
        here = (joints.time * NS >= start.time_ns) & (joints.time * NS < end.time_ns)
        whole = float(scene.laws[start.cam].lift)
        assert lift[here].max() == pytest.approx(whole, rel=2e-3)
        assert lift[here].min() == pytest.approx(0.0, abs=1e-3 * whole)
        assert velocity[here].min() < -0.1 < 0.1 < velocity[here].max()


def test_the_peak_force_of_every_turn_is_there(joints, found):
    """Exactly that of the samples, the least as well; both topics say the same."""
    _, _, force = joints.of("follower")
    contact = np.array([message.wrench.force.y for message in found["/follower/contact"]])
    stamps = np.array([seconds(message) for message in found["/follower/contact"]])
    assert {message.header.frame_id for message in found["/follower/contact"]} == {"follower"}
    np.testing.assert_array_equal(contact, force)
    np.testing.assert_array_equal(stamps, joints.time)
    count = 0
    for rows in (tick.rows for tick in read_ticks(GOLDEN)):
        here = (joints.time > rows[0, 0] - 1e-6) & (joints.time < rows[0, -1] + 1e-6)
        assert (force[here].max(), force[here].min()) == (rows[4].max(), rows[4].min())
        count += 1
    assert count == 16


def test_the_cam_turns_steadily(joints, found):
    """θ rises by what ω gives in the time between, in even steps, 16 turns in all."""
    angle, speed, _ = joints.of("cam")
    steps, times = np.diff(angle), np.diff(joints.time)
    assert (times > 0.0).all() and (steps > 0.0).all()
    least, most = np.minimum(speed[:-1], speed[1:]), np.maximum(speed[:-1], speed[1:])
    assert (steps >= (1.0 - 1e-6) * least * times).all()  # they differ where the speed steps
    assert (steps <= (1.0 + 1e-6) * most * times).all()
    assert angle[0] == 0.0 and angle[-1] == pytest.approx(16 * TURN, rel=0.002)
    assert steps.max() < 3.0 * TURN / 72 and np.median(steps) == pytest.approx(TURN / 72, rel=0.1)
    assert len(steps) / 16 == pytest.approx(72, abs=2)
    states = [cam_state_of(message) for _, _, message in messages(GOLDEN, (CAM_STATE,))]
    for state in states[:-1]:  # at each state's own time, if a sample falls on it
        at = np.flatnonzero(np.abs(joints.time - state.time_ns / NS) < 1e-12)
        assert angle[at] == pytest.approx([state.unwrapped] * at.size, rel=1e-12)


def test_the_shaft_gives_what_the_follower_takes(joints):
    """Torque times ω is force times velocity in contact; in flight it is zero."""
    _, speed, torque = joints.of("cam")
    _, velocity, force = joints.of("follower")
    touching = force != 0.0
    assert 0.05 < touching.mean() < 1.0
    largest = np.abs(force * velocity).max()
    np.testing.assert_allclose(
        (torque * speed)[touching], (force * velocity)[touching], rtol=0, atol=1e-9 * largest
    )
    assert (torque[~touching] == 0.0).all() and np.abs(torque).max() > 1.0
