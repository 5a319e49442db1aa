"""Missing messages of a bag are counted, and the report agrees with the bag.

A tick is one time step of the simulated drive. Each tick has one message of several topics.
"""

import errno
import io
import os
import re
import shutil
import struct

import pytest

from cam_rig.bag import files
from cam_rig.bag.completeness import Holdings, belonging, loss_of
from cam_rig.bag.files import bag_file, bag_files, is_unclosed
from cam_rig.bag.partial_reader import Condition, RecordedMessage, read_partial
from cam_rig.bag.reader import messages, read_counts, read_scene
from cam_rig.bag.recorder import BagRecorder
from cam_rig.bag.records import chunk_head, records_of
from cam_rig.bag.recover import examine, recording_state, recover, recover_in_place
from cam_rig.bag.split import Split
from cam_rig.errors import BagError
from cam_rig.messages.topics import CLOCK, JOINT_STATES, RECORDING
from cam_rig.simulation.schedule import cam_states

from .bags import GOLDEN, LOADED, WrappedFile, cut_off

SCENE = read_scene(GOLDEN).scene


RECORDS = []
read_partial(bag_file(GOLDEN), RECORDS.append)
RECORDS = [record[1:3] for record in RECORDS if isinstance(record, RecordedMessage)]


def held(keep=lambda topic, message: True):
    """Return the inventory of the golden bag's messages, which shows missing messages.

    `keep` is a function of topic and message that returns False for a message to leave out.
    """
    found = Holdings()
    for channel, message in RECORDS:
        if keep(channel.topic, message):
            found.add(channel.topic, message.log_time, message.sequence, message.data)
    return found


TIMES = [state.time_ns for state in cam_states(SCENE)]
#: Topics whose messages are not published at the times of the cam states. A gap in the sequence
#: numbers of their messages shows a loss.
NUMBERED = {topic.name for topic in RECORDING if topic.per in ("instant", "any")}


def instants_until(time_ns):
    """Return the number of /joint_states messages before a time (ns).

    They are those of the golden bag.
    """
    return sum(t < time_ns for _, t, _ in messages(GOLDEN, (JOINT_STATES,)))


def test_no_tick_of_the_golden_bag_is_missing():
    """The complete golden bag has no missing tick, with its scene and without it.

    A tick is the interval between two published cam states. For an empty bag the report states that
    its end is unknown.
    """
    for scene in (SCENE, None):
        loss = loss_of(held(), scene, closed=True, own=True)
        assert loss.gaps == () and loss.messages == 0 and not loss.open_end and not loss.ends
    assert loss_of(Holdings(), SCENE, False, True).open_end


@pytest.mark.parametrize(("first", "last"), [(3, 5), (1, 4), (7, 7), (9, 16), (1, 16)])
def test_missing_ticks_are_numbered(first, last):
    """Missing ticks are counted and reported by their numbers in the scene's run."""
    gone = set(TIMES[first : last + 1])
    kept = held(lambda topic, m: topic in NUMBERED or m.log_time not in gone)
    loss = loss_of(kept, SCENE, False, True)
    ticks = f"tick {first}" if first == last else f"ticks {first} to {last}"
    expected = [(CLOCK, *belonging(*move)) for move in moves()][first : last + 1]
    assert loss.gaps == (f"{ticks} of 16",)
    assert loss.messages == sum(len(topics) for topics in expected)


def test_diagnostics_after_the_end_are_named_but_not_counted():
    """Diagnostics that may be missing at the end of a truncated file are reported.

    They are not counted, because their number is unknown.
    """
    half = TIMES[8]
    loss = loss_of(held(lambda _topic, m: m.log_time <= half), SCENE, False, True)
    assert loss.gaps[0] == "ticks 9 to 16 of 16"
    assert loss.gaps[-1].startswith("/diagnostics after ")
    assert loss_of(held(lambda _topic, _m: True), SCENE, True, True).gaps == ()


def moves():
    states = list(cam_states(SCENE))
    return list(zip([None, *states[:-1]], states, strict=True))


@pytest.mark.parametrize("topic", [t.name for t in RECORDING if t.per == "tick"])
def test_the_missing_topic_of_a_tick_is_named(topic):
    """A topic without messages at some ticks is reported with the ticks' numbers.

    A tick is the interval between two published cam states, and each topic has messages for it.
    """
    for first, last in ((4, 4), (11, 13)):
        gone = set(TIMES[first : last + 1])
        kept = held(lambda name, m, gone=gone: name != topic or m.log_time not in gone)
        loss = loss_of(kept, SCENE, False, True)
        ticks = f"tick {first}" if first == last else f"ticks {first} to {last}"
        assert loss.gaps == (f"{topic} of {ticks} of 16",) and loss.messages == last - first + 1


def test_without_a_scene_gaps_are_counted_by_sequence_numbers():
    """Without a scene, missing messages are counted by sequence numbers per topic.

    The report does not state that the end of such a run is complete, because an operator may have
    changed the run. A bag of another program has no gaps.
    """
    gone = set(TIMES[5:9])
    kept = held(lambda topic, m: topic in NUMBERED - {"/diagnostics"} or m.log_time not in gone)
    loss = loss_of(kept, None, False, True)
    assert "messages 6 to 9 of /cam/state" in loss.gaps
    assert "messages 5 to 8 of /follower/samples" in loss.gaps
    assert loss.open_end and not any("tick" in gap for gap in loss.gaps)
    all_gone = [topic for move in moves()[5:9] for topic in (CLOCK, *belonging(*move))]
    last_of_theirs = [
        topic for topic in all_gone if topic.per == "cam"
    ]  # no later message shows the loss
    assert loss.messages == len(all_gone) - len(last_of_theirs)
    of_others = loss_of(kept, None, True, own=False)
    assert of_others.gaps == () and not of_others.open_end


def test_missing_instants_and_diagnostics_are_counted():
    """Missing motion messages and diagnostics are counted by their sequence numbers."""
    gone = range(TIMES[3], TIMES[4])
    kept = held(lambda t, m: t != "/joint_states" or m.log_time not in gone)
    first, last = instants_until(TIMES[3]) + 1, instants_until(TIMES[4])
    count = last - first + 1
    words = f"messages {first} to {last} of /joint_states ({count} messages)"
    assert count >= 72 and loss_of(kept, SCENE, True, True).text == words
    loss = loss_of(held(lambda t, m: t != "/diagnostics" or m.sequence not in (2, 3)), SCENE, 1, 1)
    assert loss.text == "messages 2 to 3 of /diagnostics (2 messages)"


def test_an_interrupted_run_has_no_loss(tmp_path, golden):
    """The bag of a run that was stopped after tick 6 of 16 has no loss.

    A tick is the interval between two published cam states. Ticks that were not recorded are not
    lost.
    """
    bag, last = tmp_path / "bag", max(i for i, m in enumerate(golden) if m[0].per == "tick")
    recorder = BagRecorder(bag, LOADED, samples_per_turn=2)
    for topic, number, cdr in golden[: last + 1]:
        if recorder.take(topic, cdr, b"x", number)[-1:] == [TIMES[6]]:
            break
    recorder.close()
    words = recover(bag, tmp_path / "copy").text
    assert "nothing lost; it was closed after tick 6 of 16" in words
    assert "missing" not in words and "not complete" not in words
    assert recording_state(bag) == f"closed, {sum(read_counts(bag).values())} messages"


@pytest.mark.variants(4)
@pytest.mark.parametrize("part", range(5, 100, 9))
def test_the_report_agrees_with_the_recovered_bag(tmp_path, part):
    """The ticks that a recovery reports as missing are not in the recovered bag.

    A tick is the interval between two published cam states.
    """
    bag = cut_off(tmp_path / "bag", part / 100)
    words = recover(bag, tmp_path / "recovered").text
    assert "flushed" not in words
    # Number of messages of the last topic of a tick.
    ticks = read_counts(tmp_path / "recovered").get("/microphone/pressure", 0)
    if ticks == 16:
        assert "no tick is missing" in words or "nothing lost" in words
        return
    assert "nothing lost" not in words and "no tick" not in words
    named = re.search(r"ticks? (\d+)(?: to (\d+))? of 16 ?\(|ticks? (\d+) (?:to 16 )?of 16", words)
    assert named, words
    missing = [int(n) for n in re.findall(r"ticks? (\d+)", words)]
    assert ticks + 1 == min(missing)
    assert examine(bag).text == words


def full_after(monkeypatch, size):
    """Simulate a disk with room for `size` bytes."""
    left = [size]

    class Full(WrappedFile):
        def write(self, data):
            if left[0] == 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            written = super().write(bytes(data)[: left[0]])
            left[0] -= written
            return written

    create = files.create
    monkeypatch.setattr(
        files, "create", lambda file: io.BufferedWriter(Full(create(file).detach()))
    )


@pytest.mark.variants(2)
@pytest.mark.parametrize("room", [0, 5_000, 100_000, 199_000])
def test_a_recovery_on_a_full_disk_does_not_change_the_bag(tmp_path, monkeypatch, room):
    """A recovery on a full disk fails and leaves the bag unchanged.

    The error states the readable messages, the missing ticks (intervals between cam states) and the
    command that recovers into another folder.
    """
    bag = cut_off(tmp_path / "my bag", 200_000)
    file = bag / "my bag_0.mcap"
    data = file.read_bytes()
    with monkeypatch.context() as patch:
        full_after(patch, room)
        words = recording_state(bag)
    assert "No space left on device" in words
    there = recover(bag, tmp_path / "elsewhere").counts
    assert f"the bag is unchanged and readable: {sum(there.values())} messages up to" in words
    assert f"ticks {there['/cam/state']} to 16 of 16" in words
    assert f"cam-rig recover '{bag}' --output" in words
    assert file.read_bytes() == data
    assert {path.name for path in bag.iterdir()} <= {file.name, "metadata.yaml"}
    assert "saved" in recording_state(bag) and not is_unclosed(bag)


def test_a_failed_copy_removes_its_folder(tmp_path, monkeypatch):
    """A recovery that fails removes its new folder, so that it can be repeated."""
    with monkeypatch.context() as patch:
        full_after(patch, 100_000)
        with pytest.raises(BagError, match=r"cannot be written \(No space left on device\)"):
            recover(GOLDEN, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
    assert not recover(GOLDEN, tmp_path / "copy").any_file_is(Condition.TRUNCATED)


@pytest.mark.variants(2)
@pytest.mark.parametrize("split", [Split(), Split(duration=0.5)], ids=["one file", "split"])
@pytest.mark.parametrize("room", [40_000, 150_000, 170_000, 215_000])
def test_a_recorder_on_a_full_disk_keeps_the_written_messages(
    tmp_path, monkeypatch, golden, room, split
):
    """A recorder on a full disk raises an error and writes nothing more.

    The messages that were written before can be recovered.
    """
    bag = tmp_path / "bag"
    with monkeypatch.context() as patch:
        full_after(patch, room)
        recorder = BagRecorder(bag, LOADED, split=split)
        with pytest.raises(BagError, match=r"cannot be written \(No space left on device\)"):
            for topic, number, cdr in golden:
                recorder.take(topic, cdr, b"live", number)
                recorder._writer.flush()
        size = sum(file.stat().st_size for file in bag_files(bag))
        with pytest.raises(BagError, match="No space left on device"):
            recorder._writer.flush()
        recorder.close()
    assert sum(file.stat().st_size for file in bag_files(bag)) == size
    assert is_unclosed(bag)
    saved = recover_in_place(bag)
    assert sum(saved.counts.values()) >= 5 and "missing: " in saved.text
    assert read_counts(bag) == dict(sorted(saved.counts.items()))


def test_a_damaged_length_loses_only_its_chunk(tmp_path):
    """A recovery loses at most the chunk whose length field is damaged.

    It finds the next chunk by the byte pattern of its header.
    """
    file = bag_file(GOLDEN)
    with file.open("rb") as stream:
        chunks = [record for record in records_of(stream) if record.opcode == 6]
        chunk = next(each for each in chunks if chunk_head(stream, each).packed > 200_000)
        damaged = chunk_head(stream, chunk)
    data = bytearray(file.read_bytes())
    struct.pack_into("<Q", data, chunk.start - 8, 2**40)
    (tmp_path / "a.mcap").write_bytes(data)
    saved = recover(tmp_path / "a.mcap", tmp_path / "recovered")
    assert saved.counts == read_counts(GOLDEN)
    shutil.rmtree(tmp_path / "recovered")
    data[chunk.start : chunk.start + 100_000] = bytes(100_000)
    (tmp_path / "a.mcap").write_bytes(data)
    saved = recover(tmp_path / "a.mcap", tmp_path / "recovered")
    last = sum(time <= damaged.end for time in TIMES) - 1
    assert last > 1 and f"ticks 1 to {last} of 16" in saved.text.partition("missing: ")[2]
    assert saved.counts["/microphone/level"] == 16 - last


def test_the_missing_end_of_a_long_scene_is_not_counted():
    """The missing end of 100 000 turns is reported in one phrase, not tick by tick.

    If the bag was closed, the report states the last recorded tick.
    """
    schedule = SCENE.schedule.model_copy(
        update={"turns": SCENE.schedule.turns.model_copy(update={"assumed": 1e5, "given": None})}
    )
    endless = SCENE.model_copy(update={"schedule": schedule})
    kept = held(lambda _topic, m: m.log_time <= 300_000_000)
    loss = loss_of(kept, endless, False, True)
    assert loss.open_end and loss.messages < 100
    assert loss_of(kept, endless, True, True).ends.startswith("it was closed after tick 1 of")
