"""Killed at any step, and done again: nothing of a recording is lost, and nothing is left over."""

import shutil
from itertools import count
from pathlib import Path

import pytest

from cam_rig.bag.files import is_unclosed, mcap_file, why_not_a_bag
from cam_rig.bag.reader import messages, raw_messages, read_counts, read_recording
from cam_rig.bag.recorder import BagRecorder
from cam_rig.bag.recover import examine, recover, recover_in_place, state_words
from cam_rig.errors import BagError
from cam_rig.messages.topics import RECORDING
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

GOLDEN = Path(__file__).parents[2] / "bags" / "golden"
NAMES = {topic.name for topic in RECORDING}
#: Steps on files that are passed over between two kills; the long test passes over none.
STRIDES = [pytest.param(23, id="some"), pytest.param(1, marks=pytest.mark.long, id="all")]


def payloads(bag):
    """Every message by topic, in order."""
    found = {}
    for connection, time, data in raw_messages(bag, NAMES):
        found.setdefault(connection.topic, []).append((time, bytes(data)))
    return found


def torn_at(bag, size):
    """A bag of which so many bytes were written."""
    bag.mkdir()
    (bag / f"{bag.name}_0.mcap").write_bytes(mcap_file(GOLDEN).read_bytes()[:size])
    shutil.copy(GOLDEN / "metadata.yaml", bag)
    return bag


@pytest.mark.parametrize("stride", STRIDES)
def test_a_recovery_may_be_killed_at_any_step(tmp_path, killed_at, stride):
    """In place: the second one gives every message, whenever the first one was killed."""
    recover(torn_at(tmp_path / "torn", 60_000), tmp_path / "all")
    expected, killed = payloads(tmp_path / "all"), 0
    for at in count(0, stride):
        bag = torn_at(tmp_path / f"bag{at}", 60_000)
        if not killed_at(at, lambda bag=bag: recover_in_place(bag)):
            break
        killed += 1
        if is_unclosed(bag):
            with pytest.raises(BagError, match="cam-rig recover"):
                read_counts(bag)
            recover_in_place(bag)
        assert payloads(bag) == expected
        assert [p.suffix for p in sorted(bag.iterdir())] in ([".mcap", ".yaml"],)
        shutil.rmtree(bag)
    assert killed > 40 / stride


@pytest.mark.parametrize("stride", STRIDES)
def test_a_copy_may_be_killed_at_any_step(tmp_path, killed_at, stride):
    """Into another folder: the same command again makes it; no reader takes a part."""
    torn = torn_at(tmp_path / "torn", 60_000)
    recover(torn, tmp_path / "all")
    expected = payloads(tmp_path / "all")
    for at in count(0, stride):
        target = tmp_path / f"recovered{at}"
        if not killed_at(at, lambda target=target: recover(torn, target)):
            break
        if not target.exists() or why_not_a_bag(target) or is_unclosed(target):
            recover(torn, target)
        assert payloads(target) == expected
        assert sorted(p.suffix for p in target.iterdir()) == [".mcap", ".yaml"]


def record(bag, loaded, golden, resume=False):
    recorder = BagRecorder(bag, loaded, resume=resume)
    for topic, number, cdr in golden:
        recorder.take(topic, cdr, b"live", number)
    return recorder


@pytest.fixture(scope="module")
def loaded():
    return open_scene(config_root() / "scenes" / "quick.yaml")


@pytest.mark.variants(1)
@pytest.mark.parametrize("stride", STRIDES)
@pytest.mark.parametrize("part", [0.1, 0.35])
def test_a_successor_may_be_killed_at_any_step(tmp_path, killed_at, loaded, golden, stride, part):
    """While it takes over: what the first recorder had written, the next successor still has."""
    record(tmp_path / "straight", loaded, golden).close()
    whole = mcap_file(tmp_path / "straight").read_bytes()
    expected = payloads(tmp_path / "straight")
    for at in count(0, stride):
        bag = tmp_path / f"bag{at}"
        bag.mkdir()
        (bag / f"{bag.name}_0.mcap").write_bytes(whole[: int(part * len(whole))])
        before = examine(bag).counts
        if not killed_at(at, lambda bag=bag: record(bag, loaded, golden[:60], resume=True).close()):
            break
        after = examine(bag).counts
        assert all(after.get(topic, 0) >= number for topic, number in before.items())
        record(bag, loaded, golden, resume=True).close()
        assert {t: sorted(m) for t, m in payloads(bag).items()} == {
            t: sorted(m) for t, m in expected.items()
        }
        assert [p.suffix for p in sorted(bag.iterdir())] == [".mcap", ".yaml"]
        shutil.rmtree(bag)


@pytest.mark.parametrize("stride", STRIDES)
def test_a_recorder_may_be_killed_while_it_closes(tmp_path, killed_at, loaded, golden, stride):
    """All was flushed: recovered, it is the bag that would have been closed."""
    record(tmp_path / "straight", loaded, golden).close()
    expected = payloads(tmp_path / "straight")
    for at in count(0, stride):
        bag = tmp_path / f"bag{at}"
        recorder = record(bag, loaded, golden)
        recorder._session.close()
        recorder._flush()
        if not killed_at(at, recorder.close):
            break
        recorder._writer._file.close_stream()
        if is_unclosed(bag):
            state_words(bag)
        assert payloads(bag) == expected
        assert len(read_recording(bag).ticks) == 16
        shutil.rmtree(bag)


@pytest.mark.variants(6)
@pytest.mark.parametrize("partial", [None, 0, 3, 20_000, 60_000])
@pytest.mark.parametrize("listed", [True, False])
def test_what_older_versions_left_of_a_recovery_is_understood(tmp_path, partial, listed):
    """They set the truncated file aside as ``.torn``: all is in it, whatever the new file has."""
    bag, whole = tmp_path / "B", mcap_file(GOLDEN).read_bytes()
    bag.mkdir()
    (bag / "B_0.torn").write_bytes(whole[:500_000])
    if partial is not None:
        (bag / "B_0.mcap").write_bytes(whole[:partial])
    if listed:
        shutil.copy(GOLDEN / "metadata.yaml", bag)
    assert is_unclosed(bag)
    with pytest.raises(BagError, match=r"B_0\.torn .*recover it with: cam-rig recover"):
        read_counts(bag)
    with pytest.raises(BagError, match="recover it with: cam-rig recover"):
        list(messages(bag, RECORDING))
    saved = recover(bag, tmp_path / "recovered")
    assert "read from B_0.torn, left by an interrupted recovery" in saved.words
    cut_off = torn_at(tmp_path / "cut_off", 500_000)
    assert saved.counts == examine(cut_off).counts and saved.counts["/microphone/level"] > 1
    assert recover_in_place(bag).counts == saved.counts
    assert payloads(bag) == payloads(tmp_path / "recovered")
    assert sorted(p.name for p in bag.iterdir()) == ["B_0.mcap", "metadata.yaml"]


def test_a_file_beside_its_torn_one_is_not_taken_for_all(tmp_path):
    """Named by its file, such a bag is read as when named by its folder."""
    torn_at(tmp_path / "B", 20_000)
    (tmp_path / "B" / "B_0.torn").write_bytes(mcap_file(GOLDEN).read_bytes())
    for name in ("B_0.mcap", "B_0.torn"):
        saved = recover(tmp_path / "B" / name, tmp_path / name.replace(".", "_"))
        assert saved.counts == read_counts(GOLDEN)


def test_a_successor_of_a_recorder_that_had_closed_goes_on(tmp_path, loaded, golden):
    """Killed between its last byte and its end: the closed bag is not overwritten."""
    bag = tmp_path / "bag"
    record(bag, loaded, golden[: len(golden) // 2]).close()
    record(bag, loaded, golden, resume=True).close()
    assert len(read_recording(bag).ticks) == 16


def test_two_recoveries_at_once_are_refused(tmp_path):
    """The second one would write into the first one's file."""
    torn = torn_at(tmp_path / "torn", 60_000)
    from cam_rig.bag.writer import BagWriter

    with (
        BagWriter(torn, rewrite=True),
        pytest.raises(BagError, match="is being written by another"),
    ):
        recover_in_place(torn)
