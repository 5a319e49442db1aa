"""Tests of messages: laws, samples, cam states and motion are encoded and decoded."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters
from cam_rig.errors import RefusedError
from cam_rig.messages import codec, topics
from cam_rig.messages.motion import JOINTS, MotionMessages, instants_of
from cam_rig.messages.serialization import CdrTemplate, header, new, serialize
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import NS, RPM, TURN


def test_laws_and_blocks_are_decoded_bit_for_bit(laws):
    """A law or block of samples is decoded to the encoded numbers, bit for bit."""
    for law in laws.values():
        dimensions, data = codec.encode_law(law)
        decoded = codec.decode_law(dimensions, data.ravel())
        assert decoded.name == law.name
        assert np.array_equal(decoded.breaks, law.breaks)
        assert np.array_equal(decoded.ordinates, law.ordinates)
    rows = np.random.default_rng(1).normal(size=(6, 7))
    dimensions, data = codec.encode_block(rows)
    assert np.array_equal(codec.decode_block(dimensions, data.ravel()), rows)


def test_other_arrays_are_rejected(laws):
    """An array with wrong labels, sizes or non-finite numbers is refused.

    It is neither a motion law nor a block of samples.
    """
    dimensions, data = codec.encode_law(laws["bezier15"])
    broken, zeros, block = data.ravel().copy(), np.zeros(12), codec.BLOCK_LABEL
    broken[3] = np.nan
    for decode, sizes, numbers, text in (
        (codec.decode_block, [], zeros, "must have two dimensions"),
        (codec.decode_block, [(block, 6)], zeros, "must have two dimensions"),
        (codec.decode_block, [(block, 6), ("sample", 3)], zeros, "must have two dimensions"),
        (codec.decode_block, [("other", 6), ("sample", 2)], zeros, "the rows must be"),
        (codec.decode_block, [(block, 3), ("sample", 4)], zeros, "the rows must be"),
        (codec.decode_law, dimensions, broken, "finite"),
        (codec.decode_law, [("x", 1), ("y", broken.size)], broken, "law coefficients"),
    ):
        with pytest.raises(RefusedError, match=text):
            decode(sizes, numbers)


def message(positions, velocities=None, stamp=(3, 7), frame="tm21"):
    """Return an object with the fields of a ROS JointState message.

    It replaces the message classes of rclpy and rosbags.
    """
    velocities = [50.0] * len(positions) if velocities is None else velocities
    header = SimpleNamespace(stamp=SimpleNamespace(sec=stamp[0], nanosec=stamp[1]), frame_id=frame)
    return SimpleNamespace(header=header, position=positions, velocity=velocities)


def test_a_cam_state_is_decoded_bit_for_bit():
    """A cam state is decoded bit for bit, even after ten million turns.

    The message has the whole turns separately, because a single number would lose the last digits.
    """
    for turns in (0, 1, 2_000, 10_000_000):
        rng = np.random.default_rng(turns)
        for angle in (0.0, *rng.uniform(0.0, TURN, 50), np.nextafter(TURN, 0.0)):
            state = CamState(3_000_000_007, float(angle), 50.0, "tm21", turns)
            assert codec.cam_state_of(message([state.unwrapped, state.angle])) == state


def test_a_cam_state_of_an_earlier_version_is_accepted():
    """A cam state whose angle is a single number is split into turns and angle.

    Earlier versions sent such states. The result has the precision of a float.
    """
    state = codec.cam_state_of(message([2000.0 * TURN + 1.25]))
    assert state.turns == 2000 and state.angle == pytest.approx(1.25, abs=4e-12)


@pytest.mark.parametrize(
    ("positions", "text"),
    [
        ([7.0, 0.5], r"θ 7.0 rad and 0.5 rad within the turn differ by 0.217 rad, more than 1e-06"),
        ([7.0, 7.0], r"must be from 0 to below 2π rad, got 7.0"),
        ([7.0, float("nan")], r"below 2π rad, got nan"),
        ([0.5, -1e-9], r"below 2π rad, got -1e-09"),
        ([1.0, 1.0, 1.0], r"cam and cam_in_turn, or the first alone.*3 positions, 3 velocities"),
        ([], r"0 positions, 0 velocities"),
        ([1e300], r"must be finite.*θ 1e\+300 rad"),
    ],
)
def test_an_invalid_cam_state_is_rejected(positions, text):
    """A cam state message with invalid angles raises RefusedError with the values."""
    with pytest.raises(RefusedError, match=text):
        codec.cam_state_of(message(positions))


# -- motion at selected times within a tick: extremes, order and messages

#: Model of a follower that can lift off and land.
MODEL = MODELS["one_mass"]
BOTH = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT)


def ticks_of(law, follower, rpm, ticks_per_turn, sample_rate):
    """Yield start state, end state and samples of each tick of a turn.

    The cam speed is constant. A tick is the interval between two cam states.
    """
    simulator = FollowerSimulator(MODEL, follower, sample_rate, {law.name: law})
    before, tick = None, 60.0 / rpm / ticks_per_turn
    for n in range(ticks_per_turn + 1):
        time_ns = round(n * tick * NS)
        state = CamState(time_ns, rpm * RPM * time_ns / NS, rpm * RPM, law.name)
        turned = simulator.turn_to(state)
        if turned is not None:
            yield before, state, turned[1].rows
        before = state


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", range(40))
def test_instants_are_in_order_and_contain_the_extremes_of_the_tick(laws, follower, seed):
    """The published times of a tick rise, and include its extreme lift and forces.

    A tick is the interval between two cam states. The values are those of the samples, and the
    power of the shaft equals that of the follower. Law, speed, ticks per turn, points per turn and
    sample rate are random.
    """
    chance = np.random.default_rng(seed)
    law = laws[chance.choice(sorted(set(laws) - {"worked_example_constant_velocity"}))]
    ticks, points = int(chance.choice([1, 3, 7, 72, 100])), int(chance.choice([1, 2, 36, 72, 720]))
    rate = int(chance.choice([500, 2_000, 12_000, 44_100, 48_000, 192_000]))
    rpm = float(chance.uniform(10.0, min(600.0, 0.4 * rate * 60.0 / ticks)))
    wanted, last_ns, last_angle = max(1, round(points / ticks)), -1, -1.0
    for start, end, rows in ticks_of(law, follower, rpm, ticks, rate):
        i = instants_of(law, start, end, rows, rate, wanted)
        count = min(wanted, rows.shape[1])
        assert count <= i.index.size <= count + 2
        assert start.time_ns <= i.time_ns[0] and i.time_ns[-1] < end.time_ns
        assert i.time_ns[0] > last_ns and (np.diff(i.time_ns) > 0).all()
        assert i.angle[0] > last_angle and (np.diff(i.angle) > 0.0).all()
        last_ns, last_angle = int(i.time_ns[-1]), float(i.angle[-1])
        bins = np.arange(count) * rows.shape[1] // count
        assert set(np.searchsorted(bins, i.index, "right") - 1) == set(range(count))
        extremes = {rows[1].argmax(), rows[4].argmax(), rows[4].argmin()}
        assert set(i.index) <= {*bins, *extremes}
        assert i.lift.max() == rows[1].max()
        assert (i.force.max(), i.force.min()) == (rows[4].max(), rows[4].min())
        np.testing.assert_array_equal(i.velocity, rows[2, i.index])
        np.testing.assert_allclose(i.time_ns / NS, rows[0, i.index], rtol=0, atol=1.1e-9)
        np.testing.assert_allclose(
            i.angle, start.unwrapped + start.speed * (rows[0, i.index] - start.time_ns / NS)
        )
        np.testing.assert_array_equal(i.torque, i.force * law(i.angle_in_turn, 1))
        # The shaft power equals the power of the follower, which is zero in flight.
        shaft, follower_power = i.torque * i.speed, i.force * i.velocity
        np.testing.assert_allclose(shaft, follower_power, rtol=0, atol=1e-9 * np.abs(shaft).max())


def test_angle_and_speed_on_a_ramp_are_those_of_the_instant(laws, follower):
    """On a speed ramp the published angle and speed are exact at each published time.

    The relative tolerance is 1e-12. From rest to 300 rpm in 0.2 s the cam makes half a turn, and ω
    rises linearly.
    """
    law, rate, speed = laws["tm21"], 12_000, 300.0 * RPM
    simulator = FollowerSimulator(MODEL, follower, rate, {law.name: law})
    start = CamState(0, 0.0, 0.0, law.name)
    end = CamState(NS // 5, 0.1 * speed, speed, law.name)
    simulator.turn_to(start)
    _, block = simulator.turn_to(end)
    i = instants_of(law, start, end, block.rows, rate, 72)
    times = i.index / rate
    np.testing.assert_allclose(i.speed, speed * times / 0.2, rtol=1e-12)
    np.testing.assert_allclose(i.angle, 0.5 * speed * times**2 / 0.2, rtol=1e-12)
    shaft, follower_power = i.torque * i.speed, i.force * i.velocity
    np.testing.assert_allclose(shaft, follower_power, rtol=0, atol=1e-9 * np.abs(shaft).max())


def test_a_wrong_number_of_samples_is_rejected(laws, follower):
    """A block with one sample more or less than its tick is refused.

    A tick is the interval between two cam states.
    """
    law = laws["tm21"]
    start, end, rows = next(ticks_of(law, follower, 300.0, 1, 12_000))
    for other in (rows[:, 1:], np.hstack([rows, rows[:, :1]])):
        with pytest.raises(RefusedError, match=r"tick that starts at 0.* has 2400, got"):
            instants_of(law, start, end, other, 12_000, 72)


def serialized_by_rosbags(topic, time_ns, i, n):
    """Serialize the motion message of the n-th published time by the library rosbags.

    `i` are the published times and values of a tick.
    """
    if topic is topics.JOINT_STATES:
        pairs = ((i.angle, i.lift), (i.speed, i.velocity), (i.torque, i.force))
        numbers = (np.array([cam[n], follower[n]]) for cam, follower in pairs)
        head = header(int(time_ns), "base_link")
        return serialize(new("sensor_msgs/JointState", head, list(JOINTS), *numbers))
    vectors = (new("geometry_msgs/Vector3", 0.0, y, 0.0) for y in (float(i.force[n]), 0.0))
    wrench = new("geometry_msgs/Wrench", *vectors)
    return serialize(new("geometry_msgs/WrenchStamped", header(int(time_ns), "follower"), wrench))


@pytest.mark.parametrize("ticks_per_turn", [1, 7])
def test_messages_equal_those_of_rosbags_byte_for_byte(make_loaded_scene, ticks_per_turn):
    """Motion messages of a tick equal those that rosbags serializes, byte for byte.

    A tick is the interval between two cam states. The messages are sorted by time, then by topic.
    """
    loaded = make_loaded_scene(ticks_per_turn=ticks_per_turn)
    motion, rate = MotionMessages(loaded, 72, BOTH), int(loaded.scene.sample_rate.si)
    law = next(iter(loaded.laws.values()))
    follower = FollowerParameters.from_rig(loaded.rig)
    for start, end, rows in ticks_of(law, follower, 150.0, ticks_per_turn, rate):
        derived = motion.of_tick(start, end, rows)
        i = instants_of(law, start, end, rows, rate, round(72 / ticks_per_turn))
        expected = [
            (topic, int(time_ns), serialized_by_rosbags(topic, time_ns, i, n))
            for n, time_ns in enumerate(i.time_ns)
            for topic in BOTH
        ]
        assert [tuple(message) for message in derived] == expected


def test_only_messages_of_the_wanted_topics_are_made(make_loaded_scene, follower):
    """Motion messages are made only for the requested topics, and only for known cams."""
    loaded = make_loaded_scene()
    motion, rate = MotionMessages(loaded, topics=BOTH), int(loaded.scene.sample_rate.si)
    tick = next(ticks_of(next(iter(loaded.laws.values())), follower, 150.0, 1, rate))
    all_messages = motion.of_tick(*tick)
    wanted = motion.of_tick(*tick, wanted={topics.FOLLOWER_CONTACT})
    assert wanted == [m for m in all_messages if m.topic is topics.FOLLOWER_CONTACT]
    assert len(wanted) == len(all_messages) / 2 > 0
    assert motion.of_tick(*tick, wanted=set()) == []
    loaded.laws.clear()
    assert motion.of_tick(*tick) == []


def test_the_example_of_a_template_must_contain_every_number():
    """A message template whose example lacks one of its numbers raises ValueError.

    The position of the missing number in the bytes would be unknown.
    """
    example = lambda number: new("std_msgs/Float64", number)  # noqa: E731
    template = CdrTemplate("std_msgs/msg/Float64", example, 1)
    assert template.fill(np.array([5]), np.array([math.pi])) == [serialize(example(math.pi))]
    with pytest.raises(ValueError, match="lacks one of its 2 numbers"):
        CdrTemplate("std_msgs/msg/Float64", lambda first, _second: example(first), 2)
