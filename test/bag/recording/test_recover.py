"""A recording that was cut off: what is left of it becomes a valid bag, and the loss is named."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

from cam_rig.bag.files import is_unclosed, mcap_file
from cam_rig.bag.reader import messages, raw_messages, read_counts, read_recording
from cam_rig.bag.recorder import BagRecorder, open_bag
from cam_rig.bag.records import records_of
from cam_rig.bag.recover import recover, recover_in_place
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.messages.topics import CAM_STATE, LEVEL, RECORDING, Publishers
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

GOLDEN = Path(__file__).parents[3] / "bags" / "golden"


def cut(bag, folder, part):
    """A copy of a bag of which only a part was written."""
    torn = folder / "torn"
    torn.mkdir()
    data = mcap_file(bag).read_bytes()
    (torn / "torn_0.mcap").write_bytes(data[: int(len(data) * part)])
    return torn


def write(bag, every):
    """A bag of 60 states in chunks of ``every``."""
    with BagWriter(bag) as writer:
        for topic, _, time, cdr in STATES:
            writer.write(topic, time, cdr)
            if time % every == 0:
                writer.flush()


STATES = [(LEVEL, 0, time, b"\0\1\0\0" + bytes(8)) for time in range(60)]


@pytest.mark.parametrize("part", [0.3, 0.4, 0.5])
def test_a_cut_bag_is_saved_up_to_the_cut(tmp_path, part):
    """Every message that is whole comes back, and the result is an ordinary bag."""
    write(tmp_path / "whole", 10)
    torn = cut(tmp_path / "whole", tmp_path, part)
    with pytest.raises(BagError, match="recover it with: cam-rig recover"):
        read_counts(torn)
    saved = recover(torn, tmp_path / "recovered")
    count = read_counts(tmp_path / "recovered").get("/microphone/level", 0)
    assert count == sum(saved.counts.values())
    assert 0 < count < 60 and not saved.whole
    assert f"missing: everything after {(count - 1) * 1e-9:g} s" in saved.words
    times = [time for _, time, _ in messages(tmp_path / "recovered", (LEVEL,))]
    assert times == list(range(count))


def test_the_golden_bag_comes_back_whole(tmp_path):
    """Nothing is lost of a bag that was closed; scene and all are attached to the copy."""
    saved = recover(GOLDEN, tmp_path / "copy")
    assert saved.whole and "nothing lost" in saved.words
    assert read_counts(tmp_path / "copy") == read_counts(GOLDEN)
    assert len(read_recording(tmp_path / "copy").ticks) == 16


def test_a_damaged_chunk_is_read_as_far_as_it_goes(tmp_path):
    """A flipped byte costs one message at most, and all of its chunk are reported as doubtful."""
    write(tmp_path / "bag", 10)
    file = mcap_file(tmp_path / "bag")
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
def loaded():
    return open_scene(config_root() / "scenes" / "quick.yaml")


def record(bag, loaded, golden, resume=False, points_per_turn=0):
    recorder = BagRecorder(bag, loaded, resume=resume, points_per_turn=points_per_turn)
    for topic, number, cdr in golden:
        recorder.take(topic, cdr, b"live", number)
    return recorder


def contents(bag):
    found = {}
    for topic in ("/cam/state", "/microphone/level", "/follower/samples", "/diagnostics"):
        found[topic] = read_counts(bag).get(topic)
    motion = {topic.name for topic in RECORDING if topic.derived}
    found["motion"] = [(c.topic, t, bytes(data)) for c, t, data in raw_messages(bag, motion)]
    found["states"] = [time for _, time, _ in messages(bag, (CAM_STATE,))]
    found["levels"] = [(time, float(m.data)) for _, time, m in messages(bag, (LEVEL,))]
    return found


@pytest.fixture(scope="module")
def straight(tmp_path_factory, loaded, golden):
    """What is in a bag whose recorder lived to its end."""
    bag = tmp_path_factory.mktemp("straight") / "bag"
    record(bag, loaded, golden).close()
    return contents(bag)


@pytest.mark.variants(2)
@pytest.mark.parametrize("part", [0.02, 0.4, 0.9])
def test_a_recorder_takes_over_from_a_killed_one(tmp_path, loaded, golden, straight, part):
    """What the truncated file lacks comes from the histories; the bag is the undisturbed one."""
    bag = tmp_path / "bag"
    killed = record(bag, loaded, golden[: len(golden) // 2])
    killed._flush()
    file = mcap_file(bag)
    data = file.read_bytes()
    shutil.rmtree(bag)
    bag.mkdir()
    file.write_bytes(data[: int(len(data) * part)])
    assert is_unclosed(bag)
    record(bag, loaded, golden, resume=True).close()
    assert contents(bag) == straight
    assert [p.suffix for p in sorted(bag.iterdir())] == [".mcap", ".yaml"]


def assert_same_numbers(made, expected):
    """Serialized messages are equal but for the rounding of another processor's sine, 1e-12."""
    assert len(made) == len(expected)
    count = (len(made) - 4) // 8  # doubles are aligned after the header of 4 bytes
    one, other = (
        np.frombuffer(data, dtype="<f8", offset=4, count=count) for data in (made, expected)
    )
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    assert made[4 + 8 * count :] == expected[4 + 8 * count :]


def test_the_motion_in_a_bag_is_made_from_its_samples(tmp_path, loaded, golden, straight):
    """As often as is asked for, by the scene where nothing is; the rest is the same."""
    stored = {topic.name for topic in RECORDING if topic.derived}
    in_golden = [(c.topic, t, bytes(data)) for c, t, data in raw_messages(GOLDEN, stored)]
    assert [one[:2] for one in straight["motion"]] == [one[:2] for one in in_golden]
    for (_, _, made), (_, _, expected) in zip(straight["motion"], in_golden, strict=True):
        assert_same_numbers(made, expected)
    record(tmp_path / "bag", loaded, golden, points_per_turn=12).close()
    few = contents(tmp_path / "bag")
    motion = few.pop("motion")
    assert few == {key: value for key, value in straight.items() if key != "motion"}
    count = len([topic for topic, _, _ in motion if topic == "/joint_states"])
    assert 16 * 12 <= count <= 16 * 14


def make_folder(bag):
    bag.mkdir()


def make_empty_file(bag):
    bag.mkdir()
    (bag / "bag_0.mcap").touch()


def begin_recovery(bag):
    bag.mkdir()
    shutil.copy(mcap_file(GOLDEN), bag / "bag_0.torn")


@pytest.mark.parametrize("killed", [lambda bag: None, make_folder, make_empty_file, begin_recovery])
def test_a_recorder_that_was_killed_at_once_has_a_successor(
    tmp_path, loaded, golden, straight, monkeypatch, killed
):
    """Before its folder was there, before the file, before the first byte, in a recovery."""
    bag, checkpoint = tmp_path / "bag", Checkpoint(str(tmp_path), "recorder")

    def die(*_, **__):
        killed(bag)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("cam_rig.bag.recorder.BagWriter", die)
        open_bag(checkpoint, bag, loaded, Publishers())
    successor = open_bag(
        Checkpoint(str(tmp_path), "recorder"), tmp_path / "other", loaded, Publishers()
    )
    for topic, number, cdr in golden:
        successor.take(topic, cdr, b"live", number)
    successor.close()
    assert contents(bag) == straight
    assert not (tmp_path / "other").exists()


def test_a_folder_that_was_there_is_nobodys_to_take_over(tmp_path, loaded):
    """It is refused, and by a successor as well."""
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    for _ in range(2):
        with pytest.raises(BagError, match="exists already, not overwriting"):
            open_bag(Checkpoint(str(tmp_path), "recorder"), theirs, loaded, Publishers())
    assert list(theirs.iterdir()) == []


def test_a_bag_is_recovered_in_place(tmp_path, loaded, golden):
    """After a run whose recorder was killed, its bag can be read."""
    bag = tmp_path / "bag"
    killed = record(bag, loaded, golden)
    killed._flush()
    assert is_unclosed(bag)
    saved = recover_in_place(bag)
    assert not is_unclosed(bag) and not saved.whole
    assert len(read_recording(bag).ticks) == 16
    versions = [line for line in mcap_file(bag).read_bytes().split(b"\n") if b'"cam_rig"' in line]
    assert versions, "the versions it was made with are attached"
