"""The golden bag as another program reads it: the motion in standard messages alone.

Both readers know nothing of the rig: `rosbags` by its own definitions of the types, `mcap_ros2` by
those that are in the file.
"""

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from cam_rig.bag.files import mcap_file
from cam_rig.bag.reader import messages, read_samples, read_scene
from cam_rig.messages.codec import cam_state_of
from cam_rig.messages.topics import CAM_STATE
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import NS, TURN

GOLDEN = Path(__file__).parents[2] / "bags" / "golden"
WANTED = ("/joint_states", "/follower/contact", "/cam/state")


class Joints(NamedTuple):
    """A row a message: rig time (s), then of both joints position, velocity and effort."""

    rows: np.ndarray

    def of(self, joint):
        return self.rows[:, (1, 3, 5) if joint == "cam" else (2, 4, 6)].T

    @property
    def time(self):
        return self.rows[:, 0]


def of_rosbags():
    """Topic, log time and message."""
    with AnyReader([GOLDEN]) as reader:
        wanted = [c for c in reader.connections if c.topic in WANTED]
        for connection, log_time, data in reader.messages(wanted):
            yield connection.topic, log_time, reader.deserialize(data, connection.msgtype)


def of_mcap_ros2():
    """The same by definitions in the file."""
    with mcap_file(GOLDEN).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages(WANTED):
            yield channel.topic, record.log_time, message


def seconds(message):
    return message.header.stamp.sec + message.header.stamp.nanosec / NS


@pytest.fixture(scope="module", params=[of_rosbags, of_mcap_ros2], ids=["rosbags", "mcap_ros2"])
def found(request):
    """Every message by topic, in the order of the log times."""
    by_topic = {topic: [] for topic in WANTED}
    for topic, log_time, message in request.param():
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
    samples, scene = list(read_samples(GOLDEN)), read_scene(GOLDEN)
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
    for rows in read_samples(GOLDEN):
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
