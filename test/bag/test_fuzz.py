"""Whatever is in a message, it is read, or refused by one error; nothing else."""

import math
from array import array
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.bag.session import RecordingSession
from cam_rig.errors import DynamicsError, RefusedError
from cam_rig.live.queues import FollowerQueue
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages import topics
from cam_rig.messages.codec import (
    BLOCK_LABEL,
    PIECE_LABEL,
    array_of,
    cam_state_of,
    decode_block,
    decode_law,
    encode_block,
)
from cam_rig.simulation.simulate import FollowerSimulator, MicrophoneSimulator

from .bags import LOADED

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
    """Something that has at least the shape of a law."""
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
def test_a_follower_stays_finite_whatever_is_published(received):
    """What it refuses is refused by name; what it publishes of the rest is finite."""
    bench = FollowerSimulator.of(LOADED)
    follower = FollowerQueue(bench, LOADED.scene)
    for one in received:
        try:
            if isinstance(one, tuple):
                follower.add_law(decode_law(*array_of(message(*one))))
            else:
                follower.add_state(cam_state_of(one))
            for _, _, state, block in follower.complete():
                assert np.isfinite(block.rows).all()
                assert math.isfinite(state.contact_force)
        except (RefusedError, DynamicsError) as error:
            assert "\n" not in str(error)


@given(DIMENSIONS, st.lists(NUMBERS, max_size=40))
def test_any_array_is_decoded_or_refused(dimensions, data):
    """As a law and as a block."""
    for decode in (decode_law, decode_block):
        try:
            decode(*array_of(message(dimensions, data)))
        except RefusedError as error:
            assert len(str(error)) < 1000


@given(st.lists(NUMBERS, min_size=1, max_size=8), st.floats(1e-3, 1e4))
def test_a_microphone_stays_finite(forces, speed):
    """Every block that passes gives a level."""
    rows = np.zeros((6, len(forces)))
    rows[4], rows[5] = forces, forces[::-1]
    dimensions, data = encode_block(rows)
    microphone = MicrophoneSimulator.of(LOADED)
    try:
        passed = decode_block(dimensions, data.ravel())
    except RefusedError:
        return
    assert math.isfinite(microphone.listen(passed, speed))


@given(st.lists(st.tuples(st.sampled_from(topics.RECORDING), st.binary(max_size=80)), max_size=10))
def test_a_recorder_goes_on_whatever_is_published(kept, received):
    """Raw bytes are a message, or refused."""
    session = RecordingSession(kept, StateValidator(1000.0))
    for topic, cdr in received:
        try:
            session.take(topic, b"\0\1\0\0" + cdr, b"x", 1)
        except RefusedError:
            continue
    session.close()
