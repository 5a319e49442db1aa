"""Recording session: it writes received messages at the time of their cam state.

A cam state starts each tick (time step) of the drive. Equal runs give equal bags.
"""

import random
import struct
from contextlib import suppress

import pytest

from cam_rig.bag.replay import quantity_of, replay_steps
from cam_rig.bag.session import RecordingSession
from cam_rig.errors import RefusedError, RunError
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages import topics
from cam_rig.messages.serialization import header, new, read_message, serialize, stamp_of
from cam_rig.messages.topics import QUANTITY, Publishers

from .bags import GOLDEN

RATE = 1000.0
LIVE, AGAIN = b"first process", b"second process"


def shuffled(messages, seed):
    """Return the messages shuffled across topics. The order within each topic is kept."""
    queues, chance, order = {}, random.Random(seed), []
    for message in messages:
        queues.setdefault(message[0], []).append(message)
    while queues:
        topic = chance.choice(list(queues))
        order.append(queues[topic].pop(0))
        if not queues[topic]:
            del queues[topic]
    return order


def record(messages, kept):
    session = RecordingSession(kept, StateValidator(RATE), Publishers())
    written = []
    for topic, number, cdr, *source in messages:
        written += session.take(topic, cdr, *(source or [LIVE]), number)
    session.close()
    return written


def by_topic(kept):
    """Return the written messages as a dict from topic to (log time, bytes).

    They are in the order of log times.
    """
    found = {}
    for topic, time, cdr in sorted(kept.messages, key=lambda message: message[1]):
        found.setdefault(topic, []).append((time, cdr))
    return found


@pytest.fixture
def session(kept):
    """Recording session that writes into the fake bag writer of the fixture `kept`."""
    return RecordingSession(kept, StateValidator(RATE))


@pytest.fixture(scope="module")
def states(golden):
    """Stamps (ns) of the cam states in the golden bag."""
    return [stamp_of(cdr) for topic, _, cdr in golden if topic is topics.CAM_STATE]


def test_every_message_is_written_once_with_its_states_time(golden, kept, states):
    """Each message is written once, at the time of its cam state.

    A /clock message is added per state. Log times rise except for diagnostics. A message without a
    stamp has the time of the stamped message that is published with it (its twin).
    """
    written = record(golden, kept)
    assert written == states and len(kept.messages) == len(golden) + len(states)
    found = by_topic(kept)
    for topic in topics.RECEIVED:
        if topic.per == "tick":
            assert [time for time, _ in found[topic.name]] == states[1:]
    clock = found[topics.CLOCK.name]
    assert [time for time, _ in clock] == states
    assert [(len(cdr), stamp_of(cdr)) for _, cdr in clock] == [(12, stamp) for stamp in states]
    times = [time for topic, time, _ in kept.messages if topic != "/diagnostics"]
    assert times == sorted(times)


@pytest.mark.variants(2)
@pytest.mark.parametrize("seed", range(8))
def test_any_order_of_topics_gives_the_same_bag(golden, kept, seed):
    """The bag does not depend on the order in which topics arrive.

    DDS keeps the order only within a topic.
    """
    record(golden, kept)
    straight, kept.messages = by_topic(kept), []
    record(shuffled(golden, seed), kept)
    assert by_topic(kept) == straight


@pytest.mark.variants(3)
@pytest.mark.parametrize("missing", [t for t in topics.RECEIVED if t.per in ("tick", "state")])
def test_a_state_waits_for_every_message_of_its_tick(golden, kept, states, missing):
    """A cam state is not written while a message of its tick is missing.

    A tick is the interval between two cam states, and each topic has its messages of a tick. At the
    end the messages that have arrived are written.
    """
    last = max(n for topic, n, _ in golden if topic is missing)
    written = record([m for m in golden if m[:2] != (missing, last)], kept)
    assert written == states[:-1] and len(by_topic(kept)[missing.name]) == last - 1
    if missing is not topics.CAM_STATE:  # an unstamped message needs its twin
        twins = sum(topic.twin == missing.name for topic in topics.RECEIVED)
        assert len(kept.messages) == len(golden) + len(states) - 1 - twins


def test_a_step_waits_for_its_law(golden, kept, states):
    """Cam states are not written before the motion law for them has arrived.

    Here the second law message is missing, so only the states before its time are written.
    """
    laws = [stamp_of(cdr) for topic, _, cdr in golden if topic is topics.LAW]
    written = record([m for m in golden if m[:2] != (topics.LAW, 2)], kept)
    assert written == [stamp for stamp in states if stamp < laws[1]]


def test_a_clock_that_jumps_back_is_refused(golden, kept, states, session):
    """A second run in the same bag is refused, and the first run stays complete."""
    for topic, number, cdr in golden:
        session.take(topic, cdr, LIVE, number)
    whole = by_topic(kept)
    first = next(cdr for topic, _, cdr in golden if topic is topics.CAM_STATE)
    again = first[:4] + struct.pack("<iI", 0, 1) + first[12:]
    with pytest.raises(
        RefusedError, match=rf"rig time must increase within a bag, the last was at {states[-1]} ns"
    ):
        session.take(topics.CAM_STATE, again, LIVE, len(states) + 1)
    session.close()
    assert by_topic(kept) == whole


def test_a_different_second_message_of_a_stamp_is_refused(golden, kept):
    """Two different messages of one topic and stamp raise RefusedError."""
    session = RecordingSession(kept, StateValidator(RATE), Publishers())
    state, pressure = (
        next(m for m in golden if m[0] is topic) for topic in (topics.CAM_STATE, topics.PRESSURE)
    )
    for topic, number, cdr in (state, pressure):
        session.take(topic, cdr, LIVE, number)
    other = bytearray(pressure[2])
    other[-10] ^= 1
    with pytest.raises(RefusedError, match="got two different messages"):
        session.take(topics.PRESSURE, bytes(other), LIVE, 1)


OWNED = [topic for topic in topics.RECEIVED if topic.owner]


@pytest.mark.variants(6)
@pytest.mark.parametrize("topic", OWNED, ids=lambda t: t.name)
@pytest.mark.parametrize("forged_first", [False, True])
def test_a_second_publisher_of_a_node_is_refused(golden, kept, topic, forged_first):
    """A message from a second publisher of a topic raises RunError with both names.

    The names are those of the topic and of the second publisher's node. The order of the publishers
    has no effect, and their bytes are equal here.
    """
    name = {b"forger": "/rogue", LIVE: f"/rig/{topic.owner}"}
    publishers = Publishers(find_publishers=lambda _topic: name)
    session = RecordingSession(kept, StateValidator(RATE), publishers)
    forger = {True: b"forger", False: LIVE}[forged_first]
    known = [m for m in golden if m[0].owner == topic.owner]
    example = next(cdr for other, _, cdr in golden if other is topic)
    session.take(topic, example, forger, 1)
    if not forged_first:
        for other, number, cdr in known[1:]:
            session.take(other, cdr, LIVE, number)
    with pytest.raises(RunError) as refused:
        session.take(topic, example, b"forger" if forger is LIVE else LIVE, 1)
    words = f"{topic.name}: has a second publisher, /rogue; only this rig's {topic.owner}"
    assert str(refused.value).startswith(words)


def test_each_topic_of_a_node_may_have_a_gid_without_a_common_part(golden, kept, states):
    """Publishers of one node are accepted even if their gids have no common part.

    A gid is the publisher's ID in the middleware. Those of rmw_zenoh, for example, are random.
    """
    chance = random.Random(1)
    gids = {topic: chance.randbytes(16) for topic in topics.RECEIVED}
    assert record([(*message, gids[message[0]]) for message in golden], kept) == states


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ({b"graph 1": "/rig/follower", b"graph 2": "/rogue"}, "publisher, /rogue;"),
        ({b"graph 1": "/follower", b"graph 2": "/follower"}, "publisher, 7365636f6e64;"),
        ({}, "publisher, 7365636f6e64;"),
    ],
)
def test_a_second_publisher_is_named_by_the_graph(names, words):
    """The error about a second publisher contains the name of its ROS node.

    If the ROS graph has no name for it, the error contains its gid, the publisher's ID in the
    middleware. The gid in messages may differ from that of the ROS graph (rmw_cyclonedds).
    """
    publishers = Publishers(lambda _topic: names)
    publishers.require("follower", topics.FOLLOWER_STATE, b"first")
    publishers.require("follower", topics.FOLLOWER_STATE, b"first")
    with pytest.raises(RunError, match=words):
        publishers.require("follower", topics.FOLLOWER_STATE, b"second")


def test_gids_are_compared_as_a_whole():
    """Two gids that differ only in the last bytes are two publishers.

    Two publishers of one RTPS participant share twelve bytes.
    """
    publishers = Publishers()
    publishers.require("follower", topics.FOLLOWER_STATE, bytes(16))
    with pytest.raises(RunError, match="second publisher"):
        publishers.require("follower", topics.FOLLOWER_STATE, bytes(12) + b"\0\0\1\3")


def test_a_forged_diagnostic_is_refused(golden, session):
    """A diagnostic of the microphone is refused if another process published it.

    The microphone's process is known from its sound levels.
    """
    level = next(m[2] for m in golden if m[0] is topics.LEVEL)
    session.take(topics.LEVEL, level, LIVE, 1)
    session.take(topics.DIAGNOSTICS, of_speaker("microphone", 0), LIVE, 1)
    with pytest.raises(RunError, match="/diagnostics: has a second publisher"):
        session.take(topics.DIAGNOSTICS, of_speaker("microphone", 1), b"forger", 1)


def test_a_law_that_differs_from_the_file_is_refused(golden, kept):
    """A motion law that differs from its cam file is not written to the bag.

    The recording continues.
    """
    held = []

    def check(topic, message):
        held.append(topic)
        if topic is topics.LAW_COEFFICIENTS:
            raise RefusedError("not the file's")

    session = RecordingSession(kept, StateValidator(RATE), check=check)
    refused = 0
    for topic, number, cdr in golden:
        try:
            session.take(topic, cdr, LIVE, number)
        except RefusedError:
            refused += 1
    assert refused == held.count(topics.LAW_COEFFICIENTS) > 0
    assert topics.PROFILE in held
    session.close()
    assert topics.LAW_COEFFICIENTS.name not in by_topic(kept)


def test_messages_without_a_known_state_are_bounded(golden, session):
    """A recorder refuses a flood of messages whose cam state it has not received.

    Otherwise its memory would grow without limit.
    """
    pressure = next(cdr for topic, _, cdr in golden if topic is topics.PRESSURE)
    with pytest.raises(RefusedError, match="messages without a state"):
        for second in range(1000):
            session.take(topics.PRESSURE, stamped(pressure, second * 10**9), AGAIN, second)


def stamped(cdr, stamp):
    """Return a serialized message with its stamp replaced by `stamp` (ns)."""
    return cdr[:4] + struct.pack("<iI", stamp // 10**9, stamp % 10**9) + cdr[12:]


def test_messages_before_a_written_state_are_dropped(golden, kept):
    """Stray messages with stamps between two cam states do not block the recording.

    They are dropped after the second state is written.
    """
    law = next(cdr for topic, _, cdr in golden if topic is topics.LAW)
    session, number = RecordingSession(kept, StateValidator(RATE)), 0
    for topic, n, cdr in golden:
        session.take(topic, cdr, LIVE, n)
        for i in range(9 if topic is topics.CAM_STATE else 0):  # 17 x 9 stamps exceed the storage
            number += 1
            junk = stamped(law, stamp_of(cdr) + 1 + i)
            session.take(topics.LAW, junk, LIVE, number)


def diagnosis(node, words, stamp=0, **values):
    pairs = [new("diagnostic_msgs/KeyValue", key, value) for key, value in values.items()]
    status = new("diagnostic_msgs/DiagnosticStatus", 0, node, words, "", pairs)
    return new("diagnostic_msgs/DiagnosticArray", header(stamp, ""), [status])


def of_speaker(node, stamp):
    return serialize(diagnosis(node, "all is well", stamp))


def test_only_diagnostics_of_the_rig_in_rig_time_are_written(golden, kept):
    """Diagnostics of another robot are refused, and those in wall-clock time dropped.

    Only diagnostics of the rig in rig time are written to the bag.
    """
    record(golden, kept)
    straight, kept.messages = by_topic(kept), []
    wall = 1_767_225_600 * 10**9
    first = [
        (topics.DIAGNOSTICS, 1, of_speaker("laser", 0), b"foreign"),
        (topics.DIAGNOSTICS, 2, of_speaker("microphone", wall), LIVE),
    ]
    session, refused = RecordingSession(kept, StateValidator(RATE)), []
    for topic, number, cdr, source in [*first, *((*message, LIVE) for message in golden)]:
        try:
            session.take(topic, cdr, source, number)
        except RefusedError as error:
            refused.append(str(error))
    session.close()
    assert len(refused) == 1 and "one of cam_drive, law_server" in refused[0]
    assert by_topic(kept) == straight


def test_derived_messages_are_refused(session):
    """A message of a topic that the recorder computes from the samples is refused."""
    for topic in set(topics.RECORDING) - set(topics.RECEIVED):
        with pytest.raises(RefusedError, match=f"{topic.name}: is computed by the recorder"):
            session.take(topic, b"", LIVE, 1)


def test_invalid_bytes_are_refused(golden, kept):
    """Bytes that are not a message of their topic are refused.

    A cam state with a changed byte is refused or still valid, and raises no other error.
    """
    for topic in topics.RECEIVED:
        for cdr in (b"", b"\0\1\0\0", b"\xff" * 40):
            with pytest.raises(RefusedError):
                RecordingSession(kept, StateValidator(RATE)).take(topic, cdr)
    state = next(cdr for topic, _, cdr in golden if topic is topics.CAM_STATE)
    for place in range(4, len(state), 3):
        cdr = bytearray(state)
        cdr[place] ^= 0xFF
        with suppress(RefusedError):
            RecordingSession(kept, StateValidator(RATE)).take(topics.CAM_STATE, bytes(cdr))


def test_padding_bytes_are_zero(golden):
    """Padding bytes of a received message are set to zero.

    The middleware leaves bytes there that differ from run to run.
    """
    cdr = next(m[2] for m in golden if m[0] is topics.CAM_STATE)  # "tm21\0" and 3 padding bytes
    gap = 4 + 8 + 4 + 5
    assert cdr[gap : gap + 3] == b"\0\0\0"
    dirty = cdr[:gap] + b"abc" + cdr[gap + 3 :]
    assert read_message(topics.CAM_STATE, dirty)[1] == cdr


# -- the quantity that the microphone measured in a recording, which a replay sets


def test_a_recording_contains_the_quantity_of_its_microphone():
    """The golden bag contains the quantity that its microphone measured, such as LZF."""
    assert {one.quantity for one in replay_steps(GOLDEN)} == {"", "LZF"}


def test_a_quantity_is_a_value_of_the_microphone():
    """The quantity is the symbol of a sound level in a diagnostic of the microphone.

    Other nodes and other texts give an empty string.
    """
    wrong = [("microphone", value) for value in ("", "L", "LBF", "LAFx", "laf")]
    for words in ("hears LAF", ""):
        assert quantity_of(diagnosis("microphone", words, **{QUANTITY: "LCS"})) == "LCS"
        assert quantity_of(diagnosis("microphone", words)) == ""
        for node, value in (("follower", "LCS"), *wrong):
            assert quantity_of(diagnosis(node, words, **{QUANTITY: value})) == ""
