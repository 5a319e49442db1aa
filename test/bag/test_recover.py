"""A recording that was cut off: what is left of it becomes a valid bag, and the loss is named."""

import numpy as np
import pytest
from mcap.opcode import Opcode

from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import messages, read_counts
from cam_rig.bag.recorder import open_bag
from cam_rig.bag.records import records_of
from cam_rig.bag.recover import recover
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.messages.topics import LEVEL, RECORDING, Publishers

from .bags import GOLDEN, LOADED, cut_off, payloads, record


def write(bag, every):
    """A bag of 60 levels in chunks of ``every``."""
    with BagWriter(bag) as writer:
        for time in range(60):
            writer.write(LEVEL, time, b"\0\1\0\0" + bytes(8))
            if time % every == 0:
                writer.flush()


@pytest.mark.parametrize("part", [0.3, 0.4, 0.5])
def test_a_cut_bag_is_saved_up_to_the_cut(tmp_path, part):
    """Every message that is whole comes back, and the result is an ordinary bag."""
    write(tmp_path / "whole", 10)
    torn = cut_off(tmp_path / "torn", part, tmp_path / "whole")
    with pytest.raises(BagError, match="recover it with: cam-rig recover"):
        read_counts(torn)
    saved = recover(torn, tmp_path / "recovered")
    count = read_counts(tmp_path / "recovered").get("/microphone/level", 0)
    assert count == sum(saved.counts.values())
    assert 0 < count < 60 and not saved.whole
    assert f"missing: everything after {(count - 1) * 1e-9:g} s" in saved.words
    times = [time for _, time, _ in messages(tmp_path / "recovered", (LEVEL,))]
    assert times == list(range(count))


def test_a_damaged_chunk_is_read_as_far_as_it_goes(tmp_path):
    """A flipped byte costs one message at most, and all of its chunk are reported as doubtful."""
    write(tmp_path / "bag", 10)
    file = bag_file(tmp_path / "bag")
    data = bytearray(file.read_bytes())
    with file.open("rb") as stream:
        chunk = [record for record in records_of(stream) if record.opcode == Opcode.CHUNK][1]
    data[chunk.start + chunk.length - 1] ^= 0xFF
    file.write_bytes(data)
    saved = recover(tmp_path / "bag", tmp_path / "recovered")
    assert saved.readers[0].damaged == 1
    assert 59 <= sum(saved.counts.values()) <= 60
    assert 9 <= saved.readers[0].doubtful <= 10
    assert "whose numbers may be wrong: " in saved.words


def test_nothing_is_overwritten_and_nothing_made_of_nothing(tmp_path):
    """An existing target and a file without records are refused by name."""
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "mine").touch()
    with pytest.raises(BagError, match="exists already, not overwriting"):
        recover(GOLDEN, tmp_path / "there")
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "empty_0.mcap").write_bytes(b"no mcap at all")
    with pytest.raises(BagError, match="does not begin as an MCAP file does"):
        recover(tmp_path / "empty", tmp_path / "new")
    assert not (tmp_path / "new").exists()


@pytest.fixture(scope="module")
def straight(tmp_path_factory, golden):
    """What a recorder makes that lives to its end."""
    bag = tmp_path_factory.mktemp("straight") / "bag"
    record(bag, golden).close()
    return payloads(bag)


def assert_same_numbers(made, expected):
    """Serialized messages are equal but for the rounding of another processor's sine, 1e-12."""
    assert len(made) == len(expected)
    count = (len(made) - 4) // 8  # doubles are aligned after the header of 4 bytes
    one, other = (
        np.frombuffer(data, dtype="<f8", offset=4, count=count) for data in (made, expected)
    )
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    assert made[4 + 8 * count :] == expected[4 + 8 * count :]


def test_the_motion_in_a_bag_is_made_from_its_samples(tmp_path, golden, straight):
    """As often as is asked for, by the scene where nothing is; the rest is the same."""
    derived = {topic.name for topic in RECORDING if topic.derived}
    stored = payloads(GOLDEN)
    assert stored.keys() == straight.keys() > derived
    for topic in derived:
        assert [time for time, _ in straight[topic]] == [time for time, _ in stored[topic]]
        for (_, made), (_, expected) in zip(straight[topic], stored[topic], strict=True):
            assert_same_numbers(made, expected)
    record(tmp_path / "bag", golden, points_per_turn=12).close()
    few = payloads(tmp_path / "bag")
    assert 16 * 12 <= len(few["/joint_states"]) <= 16 * 14
    for topic in stored.keys() - derived:
        assert few[topic] == straight[topic]


@pytest.mark.parametrize("made", ["", "bag", "bag/bag_0.mcap"])
def test_a_recorder_that_was_killed_at_once_has_a_successor(
    tmp_path, golden, straight, monkeypatch, made
):
    """Before its folder was there, before the file, before the first byte."""
    bag, other = tmp_path / "bag", tmp_path / "other"

    def die(*_, **__):
        if made:
            bag.mkdir()
        if made.endswith("mcap"):
            (tmp_path / made).touch()
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("cam_rig.bag.recorder.BagWriter", die)
        open_bag(Checkpoint(str(tmp_path), "recorder"), bag, LOADED, Publishers())
    successor = open_bag(Checkpoint(str(tmp_path), "recorder"), other, LOADED, Publishers())
    for topic, number, cdr in golden[:30]:
        successor.take(topic, cdr, b"live", number)
    successor.close()
    assert payloads(bag)["/cam/state"] == straight["/cam/state"][: len(payloads(bag)["/cam/state"])]
    assert not other.exists()


def test_a_folder_that_was_there_is_nobodys_to_take_over(tmp_path):
    """It is refused, and by a successor as well."""
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    for _ in range(2):
        with pytest.raises(BagError, match="exists already, not overwriting"):
            open_bag(Checkpoint(str(tmp_path), "recorder"), theirs, LOADED, Publishers())
    assert list(theirs.iterdir()) == []
