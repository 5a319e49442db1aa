"""A recorder or recovery that is killed at any file operation loses no message."""

import shutil
from functools import cache

import numpy as np
import pytest
from mcap.opcode import Opcode

from cam_rig.bag.files import bag_file, is_unclosed, why_not_a_bag
from cam_rig.bag.listing import mcap_files
from cam_rig.bag.partial_reader import Condition
from cam_rig.bag.reader import messages, read_counts
from cam_rig.bag.recorder import BagRecorder
from cam_rig.bag.records import records_of
from cam_rig.bag.recover import NOTHING_RECORDED, recording_state, recover, recover_in_place
from cam_rig.bag.split import Split
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError
from cam_rig.messages.topics import LEVEL, RECORDING
from cam_rig.studies.simulate.recorded import read_recording

from .bags import GOLDEN, LOADED, cut_off, killed_bags, payloads, record

SPLIT = Split(duration=0.7)
#: Argument `some` of `killed_bags`: number of file operations at which a process is killed (0:
#: all).
SOME = pytest.mark.parametrize("some", [3, pytest.param(0, marks=pytest.mark.long)])


#: Function `payloads` (messages of a bag by topic) with a cache, for bags that do not change.
once = cache(payloads)


def names(bag):
    return sorted(path.suffix for path in bag.iterdir())


@SOME
@pytest.mark.parametrize("in_place", [True, False])
def test_a_recovery_may_be_killed_at_any_step(tmp_path, some, in_place):
    """A recovery that is killed at any file operation can be repeated.

    The repeated recovery saves every message. Before that, readers refuse the incomplete bag. This
    applies to a recovery in place and to one into a new folder.
    """
    torn = cut_off(tmp_path / "torn", 60_000)
    recover(torn, tmp_path / "all")
    expected = payloads(tmp_path / "all")

    def again(bag):
        return recover_in_place(bag) if in_place else recover(torn, bag)

    def prepare(name):
        bag = tmp_path / f"bag{name}"
        return (cut_off(bag, 60_000) if in_place else bag), lambda: again(bag)

    for bag in killed_bags(prepare, some):
        if not bag.exists() or why_not_a_bag(bag) or is_unclosed(bag):
            if in_place:
                with pytest.raises(BagError, match="cam-rig recover"):
                    read_counts(bag)
            again(bag)
        assert payloads(bag) == expected
        assert names(bag) == [".mcap", ".yaml"]


@SOME
def test_a_recorder_may_be_killed_while_it_closes(tmp_path, golden, whole, some):
    """A recorder that is killed while it closes loses no message.

    The recovered bag equals the closed bag.
    """

    def prepare(name):
        recorder = record(tmp_path / f"bag{name}", golden, samples_per_turn=2)
        recorder._session.close()
        recorder._writer.flush()
        return tmp_path / f"bag{name}", recorder.close

    for bag in killed_bags(prepare, some):
        if is_unclosed(bag):
            recording_state(bag)
        assert payloads(bag) == once(whole)
        assert len(read_recording(bag).ticks) == 16


@SOME
def test_a_recorder_killed_while_splitting_keeps_flushed_messages(tmp_path, golden, some):
    """A recorder that is killed while it starts a new file loses no flushed message."""

    def noting(bag):
        """Write a bag and store the number of its flushed messages in a file next to it.

        This returns the function that does so. The file shows a test what a killed recorder had
        written.
        """
        recorder = BagRecorder(bag, LOADED, split=SPLIT, samples_per_turn=2)
        for topic, number, cdr in golden[: len(golden) // 2]:
            recorder.take(topic, cdr, b"live", number)
            recorder._writer.flush()
            bag.with_suffix(".flushed").write_text(str(recorder.count))
        recorder.close()

    def prepare(name):
        return tmp_path / f"bag{name}", lambda: noting(tmp_path / f"bag{name}")

    for bag in killed_bags(prepare, some):
        flushed = bag.with_suffix(".flushed")
        least = int(flushed.read_text()) if flushed.exists() else 0
        if not bag.exists():
            continue
        copy = bag.with_name(f"copy_of_{bag.name}")
        shutil.copytree(bag, copy)
        for file in copy.iterdir():
            file.rename(file.with_name(file.name.replace(bag.name, copy.name)))
        words = recording_state(copy)
        if least:
            assert not is_unclosed(copy) and sum(read_counts(copy).values()) >= least
        else:
            assert words


@SOME
def test_a_recovery_of_two_files_may_be_killed_at_any_step(tmp_path, split, some):
    """A bag with two unclosed files can be recovered after any kill.

    A recorder that is killed between two files leaves both unclosed.
    """

    def prepare(name):
        bag = tmp_path / name / "bag"
        shutil.copytree(split, bag)
        for file in mcap_files(bag)[:2]:
            file.write_bytes(file.read_bytes()[:-400])
        return bag, lambda: recover_in_place(bag)

    for bag in killed_bags(prepare, some):
        if is_unclosed(bag):
            recover_in_place(bag)
        assert payloads(bag) == once(split)
        assert set(names(bag)) == {".mcap", ".yaml"}


def test_a_recorder_killed_at_its_start_has_recorded_no_message(tmp_path):
    """A bag whose recorder was killed before its first message is reported as empty.

    The three cases are a folder without a file, a file without a byte, and a file without a
    message.
    """
    bag = tmp_path / "bag"
    bag.mkdir()
    assert recording_state(bag) == NOTHING_RECORDED
    (bag / "bag_0.mcap").touch()
    assert recording_state(bag) == NOTHING_RECORDED
    recorder = BagRecorder(tmp_path / "split", LOADED, split=SPLIT)
    recorder._writer._file.close_stream()
    assert recording_state(tmp_path / "split") == NOTHING_RECORDED


def test_two_recoveries_at_once_are_refused(tmp_path):
    """A recovery of a bag that another process is recovering is refused.

    It would write into the file of the first recovery.
    """
    torn = cut_off(tmp_path / "torn", 60_000)
    with (
        BagWriter(torn, rewrite=True),
        pytest.raises(BagError, match="is being written by another"),
    ):
        recover_in_place(torn)


# -- a recording that was cut off: its readable messages become a valid bag


def write(bag, every):
    """Write a bag of 60 sound levels, with `every` messages per MCAP chunk."""
    with BagWriter(bag) as writer:
        for time in range(60):
            writer.write(LEVEL, time, b"\0\1\0\0" + bytes(8))
            if time % every == 0:
                writer.flush()


@pytest.mark.parametrize("part", [0.3, 0.4, 0.5])
def test_a_cut_bag_is_saved_up_to_the_cut(tmp_path, part):
    """A recovery saves each complete message before the cut into an ordinary bag."""
    write(tmp_path / "whole", 10)
    torn = cut_off(tmp_path / "torn", part, tmp_path / "whole")
    with pytest.raises(BagError, match="recover the bag with: cam-rig recover"):
        read_counts(torn)
    saved = recover(torn, tmp_path / "recovered")
    count = read_counts(tmp_path / "recovered").get("/microphone/level", 0)
    assert count == sum(saved.counts.values())
    assert 0 < count < 60 and saved.any_file_is(Condition.TRUNCATED)
    assert f"missing: everything after {(count - 1) * 1e-9:g} s" in saved.text
    times = [time for _, time, _ in messages(tmp_path / "recovered", (LEVEL,))]
    assert times == list(range(count))


def test_a_damaged_chunk_is_read_as_far_as_possible(tmp_path):
    """A flipped byte in a chunk loses at most one message.

    All messages of the chunk are reported as doubtful.
    """
    write(tmp_path / "bag", 10)
    file = bag_file(tmp_path / "bag")
    data = bytearray(file.read_bytes())
    with file.open("rb") as stream:
        chunk = [record for record in records_of(stream) if record.opcode == Opcode.CHUNK][1]
    data[chunk.start + chunk.length - 1] ^= 0xFF
    file.write_bytes(data)
    saved = recover(tmp_path / "bag", tmp_path / "recovered")
    assert saved.reports[0].damaged_records == 1 and 59 <= sum(saved.counts.values()) <= 60
    assert saved.reports[0].condition == Condition.DAMAGED
    assert 9 <= saved.reports[0].doubtful_messages <= 10 and "may be wrong" in saved.text


def test_an_existing_target_and_an_empty_source_are_refused(tmp_path):
    """A recovery into an existing folder, or of a file that is not MCAP, is refused.

    No folder is created.
    """
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "mine").touch()
    with pytest.raises(BagError, match="exists already, not overwriting"):
        recover(GOLDEN, tmp_path / "there")
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "empty_0.mcap").write_bytes(b"no mcap at all")
    with pytest.raises(BagError, match="are not those of MCAP"):
        recover(tmp_path / "empty", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def assert_same_numbers(made, expected):
    """Check that the numbers of two serialized messages are equal to 1e-12, relative.

    The absolute tolerance is 1e-15. The sine function of another processor may differ in the last
    digits.
    """
    assert len(made) == len(expected)
    count = (len(made) - 4) // 8  # doubles are aligned after the 4-byte header
    one, other = (
        np.frombuffer(data, dtype="<f8", offset=4, count=count) for data in (made, expected)
    )
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    assert made[4 + 8 * count :] == expected[4 + 8 * count :]


def test_derived_motion_has_the_requested_points_per_turn(tmp_path, golden):
    """A recording has the requested number of motion messages per turn.

    For the requested 12 it has 12 to 14. The recorder computes these messages from the samples. By
    default their number is that of the scene, and they equal those of the golden bag. All other
    messages are unchanged.
    """
    record(tmp_path / "unkilled", golden).close()
    unkilled = payloads(tmp_path / "unkilled")
    derived = {topic.name for topic in RECORDING if topic.derived}
    stored = payloads(GOLDEN)
    assert stored.keys() == unkilled.keys() > derived
    for topic in derived:
        assert [time for time, _ in unkilled[topic]] == [time for time, _ in stored[topic]]
        for (_, made), (_, expected) in zip(unkilled[topic], stored[topic], strict=True):
            assert_same_numbers(made, expected)
    record(tmp_path / "bag", golden, samples_per_turn=12).close()
    few = payloads(tmp_path / "bag")
    assert 16 * 12 <= len(few["/joint_states"]) <= 16 * 14
    for topic in stored.keys() - derived:
        assert few[topic] == unkilled[topic]
