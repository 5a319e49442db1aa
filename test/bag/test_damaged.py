"""Randomly damaged bags are read or refused within bounded time and memory.

The damage follows from fixed seeds.
"""

import math
import random
import struct
from array import array
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import read_counts, read_scene
from cam_rig.bag.records import records_of
from cam_rig.bag.recover import examine, recording_state, recover
from cam_rig.bag.replay import compare, replay_steps
from cam_rig.bag.session import RecordingSession
from cam_rig.errors import CamRigError, DynamicsError, RefusedError
from cam_rig.live.queues import FollowerQueue
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages import codec, topics
from cam_rig.messages.codec import BLOCK_LABEL, PIECE_LABEL, array_of, decode_block, decode_law
from cam_rig.simulation.simulate import FollowerSimulator, MicrophoneSimulator
from cam_rig.studies.simulate.recorded import read_recording

from ..cli.conftest import call
from .bags import GOLDEN, LOADED, Frugal

LENGTHS = (0, 1, 8, 22, 255, 2**16, 2**20, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)


def compressed(path, kind):
    """Write the golden bag with the compression `kind`, by another MCAP library."""
    with bag_file(GOLDEN).open("rb") as source, path.open("wb") as target:
        reader, writer = make_reader(source), Writer(target, compression=kind, chunk_size=20_000)
        writer.start("ros2", "other")
        for one in reader.iter_attachments():
            writer.add_attachment(0, 0, one.name, one.media_type, one.data)
        known = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic not in known:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.topic] = writer.register_channel(
                    channel.topic, "cdr", number, channel.metadata
                )
            time_ns = message.log_time
            writer.add_message(known[channel.topic], time_ns, message.data, time_ns)
        writer.finish()
    return path


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """The golden bag uncompressed, with zstd and with lz4.

    Each is (bytes of the file, byte positions of the length field of each record).
    """
    folder, found = tmp_path_factory.mktemp("originals"), []
    files = [bag_file(GOLDEN)]
    files += [
        compressed(folder / f"{k.name}.mcap", k)
        for k in (CompressionType.ZSTD, CompressionType.LZ4)
    ]
    for file in files:
        with file.open("rb") as stream:
            found.append((file.read_bytes(), [record.start - 8 for record in records_of(stream)]))
    return found


def truncate(data, _, chance):
    del data[chance.randrange(len(data)) :]


def flip(data, _, chance):
    for _ in range(chance.randint(1, 20)):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def flip_the_head(data, _, chance):
    for _ in range(chance.randint(1, 4)):
        data[chance.randrange(8, 6000)] = chance.randrange(256)


def flip_the_summary(data, _, chance):
    for _ in range(chance.randint(1, 8)):
        data[-chance.randint(1, 14_000)] = chance.randrange(256)


def splice(data, _, chance):
    begin, length = chance.randrange(len(data)), chance.randint(1, 50_000)
    part = bytes(data[begin : begin + length])
    if chance.random() < 0.5:
        del data[begin : begin + length]
    place = chance.randrange(len(data))
    data[place:place] = part


def claim(data, heads, chance):
    for _ in range(chance.randint(1, 3)):
        struct.pack_into("<Q", data, chance.choice(heads), chance.choice(LENGTHS))


def claim_inside(data, heads, chance):
    place = chance.choice(heads) + chance.randint(8, 60)
    if place + 8 < len(data):
        struct.pack_into("<Q", data, place, chance.choice(LENGTHS))


def blank(data, _, chance):
    begin = chance.randrange(len(data))
    length = min(chance.choice((512, 4096, 65536)), len(data) - begin)
    data[begin : begin + length] = bytes(length)


WAYS = (truncate, flip, flip_the_head, flip_the_summary, splice, claim, claim_inside, blank)
CASES = range(8 * 50)


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", CASES)
def test_a_damaged_bag_is_read_or_refused(tmp_path, originals, seed):
    """Each reader of a damaged bag returns a result or raises a one-line error.

    This includes the recovery. Each takes less than 500 MB and 10 s.
    """
    chance = random.Random(seed)
    original, heads = originals[seed // len(WAYS) % 3]
    data = bytearray(original)
    WAYS[seed % len(WAYS)](data, heads, chance)
    if chance.random() < 0.2:
        chance.choice(WAYS[:3])(data, heads, chance) if len(data) > 6000 else None
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "bag_0.mcap").write_bytes(data)
    readers = (
        read_counts,
        read_scene,
        read_recording,
        examine,
        lambda one: require_complete(one, LOADED.scene),
        lambda one: list(replay_steps(one)),
        lambda one: compare(one, GOLDEN),
        lambda one: recover(one, tmp_path / "recovered"),
        recording_state,
        read_recording,
    )
    for read in readers:
        with Frugal():
            try:
                read(bag)
            except CamRigError as error:
                assert "\n" not in str(error) and len(str(error)) < 2000
                assert str(error).count("cannot be read as a rosbag2 bag") < 2
    (bag / "bag_0.mcap").write_bytes(data)
    with Frugal():
        result = call("analyze", bag)
    assert result.exit_code in (0, 1, 2)
    assert isinstance(result.exception, (SystemExit, type(None)))


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", CASES)
def test_saved_messages_equal_the_recorded_messages(tmp_path, originals, seed):
    """Messages recovered from a damaged bag equal the recorded messages, in order.

    The bag was cut off, or overwritten with zeros in one place. At most as many messages may be
    wrong as the recovery reports as doubtful.
    """
    chance = random.Random(seed)
    original, heads = originals[seed % 3]
    data = bytearray(original)
    (truncate, blank)[seed % 2](data, heads, chance)
    (tmp_path / "a.mcap").write_bytes(original)
    (tmp_path / "b.mcap").write_bytes(data)
    whole = contents(tmp_path / "a.mcap")
    try:
        saved = recover(tmp_path / "b.mcap", tmp_path / "recovered")
    except CamRigError as error:
        assert (
            "nothing to recover" in str(error)
            or "is not an MCAP file" in str(error)
            or "are not those of MCAP" in str(error)
        )
        return
    found = contents(bag_file(tmp_path / "recovered"))
    wrong = 0
    for topic, part in found.items():
        true = [one for one in part if one in whole[topic]]
        rest = iter(whole[topic])
        assert all(any(one == other for other in rest) for one in true)  # in the same order
        wrong += len(part) - len(true)
    assert wrong <= saved.reports[0].doubtful_messages


def contents(file):
    found = {}
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


# -- any message is read, or refused by RefusedError


NUMBERS = st.floats() | st.sampled_from([0.0, 1e-300, 1e300, math.inf, -math.inf, math.nan])
DIMENSIONS = st.lists(
    st.tuples(
        st.sampled_from(["tm21", PIECE_LABEL, BLOCK_LABEL, "sample", ""]) | st.text(max_size=5),
        st.integers(0, 2**32 - 1) | st.integers(0, 12),
    ),
    max_size=3,
)


def message(dimensions, data):
    dim = [SimpleNamespace(label=label, size=size) for label, size in dimensions]
    return SimpleNamespace(layout=SimpleNamespace(dim=dim), data=array("d", data))


@st.composite
def laws(draw):
    """Generate arrays with the shape of an encoded motion law and arbitrary numbers."""
    pieces, ordinates = draw(st.integers(1, 4)), draw(st.integers(1, 6))
    data = draw(
        st.lists(NUMBERS, min_size=pieces * (ordinates + 1), max_size=pieces * (ordinates + 1))
    )
    rows = np.array(data).reshape(pieces, ordinates + 1)
    if draw(st.booleans()):
        rows[:, 0] = np.linspace(0.0, 2.0 * math.pi, pieces, endpoint=False)
    if draw(st.booleans()):
        rows[:, 1:] = rows[0, 1]
    return [("tm21", pieces), (PIECE_LABEL, ordinates + 1)], rows.ravel()


def state_of(sec, nanosec, cam, position, velocity):
    stamp = SimpleNamespace(sec=sec, nanosec=nanosec)
    header = SimpleNamespace(stamp=stamp, frame_id=cam)
    return SimpleNamespace(header=header, position=position, velocity=velocity)


STATES = st.builds(
    state_of,
    st.integers(-5, 10) | st.just(2**31 - 1),
    st.integers(0, 2**32 - 1) | st.just(0),
    st.sampled_from(["tm21", "bezier15", "../x"]) | st.text(max_size=5),
    st.lists(NUMBERS, max_size=2),
    st.lists(NUMBERS, max_size=2) | st.lists(st.floats(0.0, 100.0), min_size=1, max_size=1),
)


@given(st.lists(STATES | laws(), max_size=8))
def test_a_follower_stays_finite_for_any_message(received):
    """The follower refuses any invalid law or cam state, or computes finite samples.

    A refusal is an error of one line.
    """
    bench = FollowerSimulator.of(LOADED)
    follower = FollowerQueue(bench, LOADED.scene)
    for one in received:
        try:
            if isinstance(one, tuple):
                follower.add_law(decode_law(*array_of(message(*one))))
            else:
                follower.add_state(codec.cam_state_of(one))
            for _, _, state, block in follower.complete():
                assert np.isfinite(block.rows).all() and math.isfinite(state.contact_force)
        except (RefusedError, DynamicsError) as error:
            assert "\n" not in str(error)


@given(DIMENSIONS, st.lists(NUMBERS, max_size=40))
def test_any_array_is_decoded_or_refused(dimensions, data):
    """Any array message is decoded as a law or a block of samples, or refused."""
    for decode in (decode_law, decode_block):
        try:
            decode(*array_of(message(dimensions, data)))
        except RefusedError as error:
            assert len(str(error)) < 1000


@given(st.lists(NUMBERS, min_size=1, max_size=8), st.floats(1e-3, 1e4))
def test_a_microphone_stays_finite(forces, speed):
    """The microphone refuses force samples of any value, or computes a finite level."""
    rows = np.zeros((6, len(forces)))
    rows[4], rows[5] = forces, forces[::-1]
    dimensions, data = codec.encode_block(rows)
    microphone = MicrophoneSimulator.of(LOADED)
    try:
        passed = decode_block(dimensions, data.ravel())
    except RefusedError:
        return
    assert math.isfinite(microphone.listen(passed, speed))


@given(st.lists(st.tuples(st.sampled_from(topics.RECORDING), st.binary(max_size=80)), max_size=10))
def test_a_recorder_continues_after_any_message(kept, received):
    """A recorder writes or refuses a message of random bytes, and continues."""
    session = RecordingSession(kept, StateValidator(1000.0))
    for topic, cdr in received:
        try:
            session.take(topic, b"\0\1\0\0" + cdr, b"x", 1)
        except RefusedError:
            continue
    session.close()
