"""A recorder that splits its bag, killed at any step: nothing is lost that was flushed."""

import shutil
from itertools import count

import pytest

from cam_rig.bag.files import is_closed, is_unclosed, mcap_files
from cam_rig.bag.reader import raw_messages, read_counts, read_recording
from cam_rig.bag.recorder import BagRecorder, files_to_resume
from cam_rig.bag.recover import NOTHING_RECORDED, examine, recover_in_place, state_words
from cam_rig.bag.split import Split
from cam_rig.messages.topics import RECORDING
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

NAMES = {topic.name for topic in RECORDING}
SPLIT = Split(duration=0.7)
#: Steps on files that are passed over between two kills; the long test passes over none.
STRIDES = [pytest.param(53, id="some"), pytest.param(1, marks=pytest.mark.long, id="all")]


def payloads(bag):
    """Every message by topic; diagnoses may be in the file after."""
    found = {}
    for connection, time, data in raw_messages(bag, NAMES):
        found.setdefault(connection.topic, []).append((time, bytes(data)))
    return {topic: sorted(messages) for topic, messages in found.items()}


def record(bag, loaded, golden, resume=False, flushed=None):
    """A recorder that has taken all; each message that it has flushed is noted in a file."""
    recorder = BagRecorder(bag, loaded, resume=resume, split=SPLIT)
    for topic, number, cdr in golden:
        recorder.take(topic, cdr, b"live", number)
        if flushed is not None:
            recorder._flush()
            flushed.write_text(str(recorder.count))
    return recorder


@pytest.fixture(scope="module")
def loaded():
    return open_scene(config_root() / "scenes" / "quick.yaml")


@pytest.fixture(scope="module")
def straight(tmp_path_factory, loaded, golden):
    """A split bag whose recorder lived to its end."""
    bag = tmp_path_factory.mktemp("straight") / "bag"
    record(bag, loaded, golden).close()
    assert len(mcap_files(bag)) > 2
    return bag


@pytest.mark.parametrize("stride", STRIDES)
def test_killed_at_any_step_it_has_what_was_flushed(
    tmp_path, killed_at, loaded, golden, straight, stride
):
    """The bag is closed or says that it is not; recovered, it holds every flushed message.

    A successor then makes the bag that would have been recorded without the kill.
    """
    some, expected = golden[: len(golden) // 2], payloads(straight)
    for at in count(0, stride):
        bag, flushed = tmp_path / f"bag{at}", tmp_path / "flushed"
        flushed.write_text("0")
        if not killed_at(at, lambda b=bag, f=flushed: record(b, loaded, some, flushed=f).close()):
            break
        least = int(flushed.read_text())
        if bag.exists():
            copy = tmp_path / f"copy{at}"
            shutil.copytree(bag, copy)
            for file in copy.iterdir():
                file.rename(file.with_name(file.name.replace(bag.name, copy.name)))
            words = state_words(copy)
            if least:
                assert not is_unclosed(copy) and sum(read_counts(copy).values()) >= least
            else:
                assert words
            shutil.rmtree(copy)
            record(bag, loaded, golden, resume=True).close()
            assert payloads(bag) == expected
            assert len(read_recording(bag).ticks) == 16
            assert {path.suffix for path in bag.iterdir()} == {".mcap", ".yaml"}
            shutil.rmtree(bag)
    assert at > 100


@pytest.mark.parametrize("stride", STRIDES)
def test_a_successor_may_be_killed_at_any_step(
    tmp_path, killed_at, loaded, golden, straight, stride
):
    """While it takes over: the closed files stay as they are, and the next one still has all."""
    expected = payloads(straight)
    for at in count(0, stride):
        bag = tmp_path / "bag"
        shutil.copytree(straight, bag)
        *kept, last = mcap_files(bag)
        last.write_bytes(last.read_bytes()[:-2000])
        (bag / "metadata.yaml").unlink()
        was, before = [file.read_bytes() for file in kept], examine(bag).counts
        if not killed_at(at, lambda b=bag: record(b, loaded, golden[:-20], resume=True).close()):
            break
        assert [file.read_bytes() for file in kept] == was
        after = examine(bag).counts
        assert all(after.get(topic, 0) >= number for topic, number in before.items())
        record(bag, loaded, golden, resume=True).close()
        assert payloads(bag) == expected
        shutil.rmtree(bag)
    assert at > 20


@pytest.mark.parametrize("stride", STRIDES)
def test_a_recovery_in_place_may_be_killed_at_any_step(tmp_path, killed_at, straight, stride):
    """Two files that were not closed, as a kill between them leaves: each becomes whole."""
    expected = payloads(straight)
    for at in count(0, stride):
        bag = tmp_path / "bag"
        shutil.copytree(straight, bag)
        first, second, *_ = mcap_files(bag)
        for file in (first, second):
            file.write_bytes(file.read_bytes()[:-400])
        if not killed_at(at, lambda b=bag: recover_in_place(b)):
            break
        if is_unclosed(bag):
            recover_in_place(bag)
        assert payloads(bag) == expected
        assert {path.suffix for path in bag.iterdir()} == {".mcap", ".yaml"}
        shutil.rmtree(bag)
    assert at > 40


def test_killed_between_two_files_both_are_written_anew(tmp_path, loaded, golden, straight):
    """The old one was not closed yet, the new one has no message: they become one file."""
    bag = tmp_path / "bag"
    shutil.copytree(straight, bag)
    files = mcap_files(bag)
    for file in files[2:]:
        file.unlink()
    files[0].write_bytes(files[0].read_bytes()[:-400])
    files[1].write_bytes(files[1].read_bytes()[:100])
    assert files_to_resume(bag) == ([], files[:2])
    recorder = record(bag, loaded, golden, resume=True)
    recorder.close()
    assert payloads(bag) == payloads(straight)
    assert all(is_closed(file) for file in mcap_files(bag))


def test_killed_before_its_first_message_it_has_recorded_nothing(tmp_path, loaded):
    """The folder and an empty file are no recording."""
    recorder = BagRecorder(tmp_path / "bag", loaded, split=SPLIT)
    recorder._writer._file.close_stream()
    assert state_words(tmp_path / "bag") == NOTHING_RECORDED
