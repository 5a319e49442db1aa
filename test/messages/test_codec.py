"""Laws and blocks survive the way through a labelled array bit for bit."""

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


def test_laws_and_blocks_come_back_bit_for_bit(laws):
    """What the law server publishes is the exact law, not a sampling of it; samples are the core's
    numbers, unrounded."""
    for law in laws.values():
        dimensions, data = codec.encode_law(law)
        back = codec.decode_law(dimensions, data.ravel())
        assert back.name == law.name
        assert np.array_equal(back.breaks, law.breaks)
        assert np.array_equal(back.ordinates, law.ordinates)
    rows = np.random.default_rng(1).normal(size=(6, 7))
    dimensions, data = codec.encode_block(rows)
    assert np.array_equal(codec.decode_block(dimensions, data.ravel()), rows)


def test_other_arrays_are_refused(laws):
    """Refuse a block of other labels or sizes, and a law of other labels or with a gap."""
    dimensions, data = codec.encode_law(laws["bezier15"])
    broken, zeros, block = data.ravel().copy(), np.zeros(12), codec.BLOCK_LABEL
    broken[3] = np.nan
    for decode, sizes, numbers, words in (
        (codec.decode_block, [], zeros, "allowed"),
        (codec.decode_block, [(block, 6)], zeros, "allowed"),
        (codec.decode_block, [(block, 6), ("sample", 3)], zeros, "allowed"),
        (codec.decode_block, [("other", 6), ("sample", 2)], zeros, "allowed"),
        (codec.decode_block, [(block, 3), ("sample", 4)], zeros, "allowed"),
        (codec.decode_law, dimensions, broken, "finite"),
        (codec.decode_law, [("x", 1), ("y", broken.size)], broken, "law coefficients"),
    ):
        with pytest.raises(RefusedError, match=words):
            decode(sizes, numbers)


def message(positions, velocities=None, stamp=(3, 7), frame="tm21"):
    """A JointState as rclpy and rosbags give it."""
    velocities = [50.0] * len(positions) if velocities is None else velocities
    header = SimpleNamespace(stamp=SimpleNamespace(sec=stamp[0], nanosec=stamp[1]), frame_id=frame)
    return SimpleNamespace(header=header, position=positions, velocity=velocities)


def test_a_cam_state_comes_back_bit_for_bit():
    """Its angle too, however long the cam has turned: one number would lose the last digits."""
    for turns in (0, 1, 2_000, 10_000_000):
        rng = np.random.default_rng(turns)
        for angle in (0.0, *rng.uniform(0.0, TURN, 50), np.nextafter(TURN, 0.0)):
            state = CamState(3_000_000_007, float(angle), 50.0, "tm21", turns)
            assert codec.cam_state_of(message([state.unwrapped, state.angle])) == state


def test_a_cam_state_of_before_is_taken():
    """A bag that has the angle as one number is read, to what that holds."""
    state = codec.cam_state_of(message([2000.0 * TURN + 1.25]))
    assert state.turns == 2000 and state.angle == pytest.approx(1.25, abs=4e-12)


@pytest.mark.parametrize(
    ("positions", "words"),
    [
        ([7.0, 0.5], r"θ 7.0 rad and 0.5 rad within the turn are 0.217 rad apart; allowed: 1e-06"),
        ([7.0, 7.0], r"7.0 rad within the turn; allowed: 0 to 2π"),
        ([7.0, float("nan")], r"nan rad within the turn; allowed"),
        ([0.5, -1e-9], r"allowed: 0 to 2π"),
        ([1.0, 1.0, 1.0], r"3 positions, 3 velocities.*cam and cam_in_turn, or the first alone"),
        ([], r"0 positions, 0 velocities"),
        ([1e300], r"θ 1e\+300 rad.*allowed"),
    ],
)
def test_what_is_not_a_cam_state_is_refused(positions, words):
    """By what is wrong with it."""
    with pytest.raises(RefusedError, match=words):
        codec.cam_state_of(message(positions))


# -- the motion at its instants: every peak, in order, and as the messages that others read


#: A follower that is lifted off by some cams, and comes down again.
MODEL = MODELS["one_mass"]
BOTH = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT)


def ticks_of(law, follower, rpm, ticks_per_turn, sample_rate):
    """Start, end and rows of each tick at one speed."""
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
def test_instants_are_in_order_within_their_tick_and_hold_its_peaks(laws, follower, seed):
    """Any law, speed, division, number and sample rate."""
    chance = np.random.default_rng(seed)
    law = laws[chance.choice(sorted(set(laws) - {"worked_example_constant_velocity"}))]
    ticks, points = int(chance.choice([1, 3, 7, 72, 100])), int(chance.choice([1, 2, 36, 72, 720]))
    rate = int(chance.choice([500, 2_000, 12_000, 44_100, 48_000, 192_000]))
    rpm = float(chance.uniform(10.0, min(600.0, 0.4 * rate * 60.0 / ticks)))
    wanted, last_ns, last_angle = max(1, round(points / ticks)), -1, -1.0
    for start, end, rows in ticks_of(law, follower, rpm, ticks, rate):
        found = instants_of(law, start, end, rows, rate, wanted)
        count = min(wanted, rows.shape[1])
        assert count <= found.index.size <= count + 2
        assert start.time_ns <= found.time_ns[0] and found.time_ns[-1] < end.time_ns
        assert found.time_ns[0] > last_ns and (np.diff(found.time_ns) > 0).all()
        assert found.angle[0] > last_angle and (np.diff(found.angle) > 0.0).all()
        last_ns, last_angle = int(found.time_ns[-1]), float(found.angle[-1])
        bins = np.arange(count) * rows.shape[1] // count
        assert set(np.searchsorted(bins, found.index, "right") - 1) == set(range(count))
        peaks = {rows[1].argmax(), rows[4].argmax(), rows[4].argmin()}
        assert set(found.index) <= {*bins, *peaks}
        assert found.lift.max() == rows[1].max()
        assert (found.force.max(), found.force.min()) == (rows[4].max(), rows[4].min())
        np.testing.assert_array_equal(found.velocity, rows[2, found.index])
        np.testing.assert_allclose(found.time_ns / NS, rows[0, found.index], rtol=0, atol=1.1e-9)
        np.testing.assert_allclose(
            found.angle, start.unwrapped + start.speed * (rows[0, found.index] - start.time_ns / NS)
        )
        np.testing.assert_array_equal(found.torque, found.force * law(found.angle_in_turn, 1))
        # The power of the shaft goes into the follower, and is zero in flight.
        power, into = found.torque * found.speed, found.force * found.velocity
        np.testing.assert_allclose(power, into, rtol=0, atol=1e-9 * np.abs(power).max())


def test_on_a_ramp_angle_and_speed_are_those_of_the_instant(laws, follower):
    """From rest to 300 rpm in a fifth of a second: half a turn, and ω rises evenly."""
    law, rate, speed = laws["tm21"], 12_000, 300.0 * RPM
    simulator = FollowerSimulator(MODEL, follower, rate, {law.name: law})
    start = CamState(0, 0.0, 0.0, law.name)
    end = CamState(NS // 5, 0.1 * speed, speed, law.name)
    simulator.turn_to(start)
    _, block = simulator.turn_to(end)
    found = instants_of(law, start, end, block.rows, rate, 72)
    times = found.index / rate
    np.testing.assert_allclose(found.speed, speed * times / 0.2, rtol=1e-12)
    np.testing.assert_allclose(found.angle, 0.5 * speed * times**2 / 0.2, rtol=1e-12)
    power, into = found.torque * found.speed, found.force * found.velocity
    np.testing.assert_allclose(power, into, rtol=0, atol=1e-9 * np.abs(power).max())


def test_samples_of_another_tick_are_refused(laws, follower):
    """One more or less than the tick has."""
    law = laws["tm21"]
    start, end, rows = next(ticks_of(law, follower, 300.0, 1, 12_000))
    for other in (rows[:, 1:], np.hstack([rows, rows[:, :1]])):
        with pytest.raises(RefusedError, match="allowed: the 2400 of the tick that begins at 0"):
            instants_of(law, start, end, other, 12_000, 72)


def by_rosbags(topic, time_ns, i, n):
    """A message as rosbags writes it, value by value."""
    if topic is topics.JOINT_STATES:
        pairs = ((i.angle, i.lift), (i.speed, i.velocity), (i.torque, i.force))
        numbers = (np.array([cam[n], follower[n]]) for cam, follower in pairs)
        at = header(int(time_ns), "base_link")
        return serialize(new("sensor_msgs/JointState", at, list(JOINTS), *numbers))
    vectors = (new("geometry_msgs/Vector3", 0.0, y, 0.0) for y in (float(i.force[n]), 0.0))
    wrench = new("geometry_msgs/Wrench", *vectors)
    return serialize(new("geometry_msgs/WrenchStamped", header(int(time_ns), "follower"), wrench))


@pytest.mark.parametrize("ticks_per_turn", [1, 7])
def test_messages_are_byte_for_byte_what_rosbags_writes(make_loaded_scene, ticks_per_turn):
    """Every message of a turn; they are in the order of time, and of topics at one instant."""
    loaded = make_loaded_scene(ticks_per_turn=ticks_per_turn)
    motion, rate = MotionMessages(loaded, 72, BOTH), int(loaded.scene.sample_rate.si)
    law = next(iter(loaded.laws.values()))
    follower = FollowerParameters.from_rig(loaded.rig)
    for start, end, rows in ticks_of(law, follower, 150.0, ticks_per_turn, rate):
        found = motion.moved(start, end, rows)
        i = instants_of(law, start, end, rows, rate, round(72 / ticks_per_turn))
        expected = [
            (topic, int(time_ns), by_rosbags(topic, time_ns, i, n))
            for n, time_ns in enumerate(i.time_ns)
            for topic in BOTH
        ]
        assert [tuple(message) for message in found] == expected


def test_only_what_is_wanted_is_made(make_loaded_scene, follower):
    """Of the same bytes; nothing of a cam that the scene lacks."""
    loaded = make_loaded_scene()
    motion, rate = MotionMessages(loaded, topics=BOTH), int(loaded.scene.sample_rate.si)
    tick = next(ticks_of(next(iter(loaded.laws.values())), follower, 150.0, 1, rate))
    everything = motion.moved(*tick)
    wanted = motion.moved(*tick, wanted={topics.FOLLOWER_CONTACT})
    assert wanted == [m for m in everything if m.topic is topics.FOLLOWER_CONTACT]
    assert len(wanted) == len(everything) / 2 > 0
    assert motion.moved(*tick, wanted=set()) == []
    loaded.laws.clear()
    assert motion.moved(*tick) == []


def test_a_template_needs_every_number_in_its_example():
    """One that is not there could not be put in its place."""
    example = lambda number: new("std_msgs/Float64", number)  # noqa: E731
    made = CdrTemplate("std_msgs/msg/Float64", example, 1)
    assert made.fill(np.array([5]), np.array([math.pi])) == [serialize(example(math.pi))]
    with pytest.raises(ValueError, match="lacks one of its 2 numbers"):
        CdrTemplate("std_msgs/msg/Float64", lambda one, _two: example(one), 2)
