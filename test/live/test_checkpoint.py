"""A successor knows what its predecessor knew, bit for bit."""

import os
import tempfile
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cam_rig.acoustics import MicrophoneState
from cam_rig.errors import RunError
from cam_rig.live.checkpoint import HEAD, MAX_BYTES, Checkpoint
from cam_rig.live.flow_control import TICKS_KEPT
from cam_rig.simulation.schedule import CamState


def test_the_last_records_are_kept(tmp_path):
    """A successor goes back by as many ticks as may not have arrived."""
    checkpoint, depth = Checkpoint(str(tmp_path), "follower"), TICKS_KEPT["follower"]
    assert checkpoint.oldest() is None
    for i in range(40):
        checkpoint.save((i, "x"), i)
    successor = Checkpoint(str(tmp_path), "follower")
    assert (successor.oldest(), successor.newest()) == ((40 - depth, "x"), (39, "x"))
    assert [i for i, _ in successor.all()] == list(range(40 - depth, 40))
    assert Checkpoint(str(tmp_path), "microphone").newest() is None


@pytest.mark.parametrize("done", [0, 1, 5, 30])
def test_a_successor_may_be_killed_as_well(tmp_path, done):
    """While it does again what was done, and after: the next one finds the last ticks in a row."""
    checkpoint, depth = Checkpoint(str(tmp_path), "follower"), TICKS_KEPT["follower"]
    for i in range(40):
        checkpoint.save(i, i)
    second = Checkpoint(str(tmp_path), "follower")
    begin = second.oldest()
    for i in range(begin + 1, begin + 1 + done):
        second.save(i, i)
    newest = max(39, begin + done)
    found = Checkpoint(str(tmp_path), "follower").all()
    assert sorted(set(found))[-depth + 1 :] == list(range(newest - depth + 2, newest + 1))
    assert found == sorted(found)


def test_without_a_folder_nothing_is_kept(tmp_path, monkeypatch):
    """A node by itself leaves no file."""
    monkeypatch.chdir(tmp_path)
    Checkpoint("", "follower").save((1,))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "[[",
        '[[0, {"record": "os:system", "fields": {}}]]',
        '[[0, {"record": "cam_rig.errors:CamRigError", "fields": {}}]]',
        '[[0, {"record": "cam_rig.dynamics.interval:FollowerState", "fields": {"x": 1}}]]',
        '[[0, {"array": "00", "type": "<f8", "shape": [1]}]]',
        '[[0, {"array": "0011223344556677", "type": "|O", "shape": [1]}]]',
        '[[0, {"array": "0011223344556677", "type": "|V8", "shape": [1]}]]',
        '[[0, {"array": "0011223344556677", "type": "f4,f4", "shape": [1]}]]',
        '[[0, {"array": "00", "type": "|u1", "shape": [1000000000000]}]]',
        '[[0, {"record": "cam_rig.nothing:There", "fields": {}}]]',
        '[[0, {"record": "cam_rig.acoustics.pressure:SoundSource", "fields": {}}]]',
        '[[0, {"record": "cam_rig.dynamics.interval:np", "fields": {}}]]',
        '[[0, {"record": "cam_rig.dynamics.interval:FollowerState", "fields": 3}]]',
        '[[0, {"record": 3, "fields": {}}]]',
        '[[0, {"set": []}]]',
        "[[0, {}]]",
        "[[1e999, 0]]",
        "[" * 100_000,
        "[[0, " + '{"list": [' * 9000 + "]}" * 9000 + "]]",
        "[[0, " + "9" * 5000 + "]]",
    ],
)
def test_a_foreign_file_is_refused(tmp_path, text):
    """It makes nothing but the rig's own records."""
    (tmp_path / "follower.json").write_text(f"{crc32(text.encode()):08x}\n{text}")
    with pytest.raises(RunError, match=r"follower\.json: is not a checkpoint of a node"):
        Checkpoint(str(tmp_path), "follower").oldest()


def test_only_a_plain_file_of_its_size_is_read(tmp_path):
    """A pipe is not waited for, a link not followed, and what is too long is not read."""
    file, other = tmp_path / "follower.json", tmp_path / "other.json"
    other.write_text("[[0, 1]]")
    os.symlink(other, file)
    with pytest.raises(RunError, match="is not a checkpoint of a node"):
        Checkpoint(str(tmp_path), "follower").oldest()
    file.unlink()
    with file.open("wb") as stream:
        stream.truncate(HEAD + MAX_BYTES + 1)
    with pytest.raises(RunError, match="allowed: 64 MiB"):
        Checkpoint(str(tmp_path), "follower").oldest()
    checkpoint = Checkpoint(str(tmp_path), "microphone")
    with pytest.raises(RunError, match=r"microphone\.json: has .* MiB; allowed: 64 MiB"):
        checkpoint.save("x" * MAX_BYTES)


@given(st.data())
@settings(max_examples=300, derandomize=True, deadline=None)
def test_a_damaged_file_is_refused(data):
    """Whatever byte of it is another: no state of it is a wrong one, and no error another's."""
    states = [CamState(0, 0.0, 20.0, "tm21"), CamState(10**8, 2.0, 20.0, "tm21")]
    state = (states[1], MicrophoneState(1.0, 2.0), np.arange(3.0), {"a": (1, None)})
    with tempfile.TemporaryDirectory() as folder:
        Checkpoint(folder, "microphone").save(state)
        file = Path(folder) / "microphone.json"
        text = bytearray(file.read_bytes())
        for _ in range(data.draw(st.integers(1, 3))):
            place = data.draw(st.integers(0, len(text) - 1))
            text[place] = data.draw(st.integers(0, 255) | st.sampled_from(b'[]{}",:0123456789'))
        if bytes(text) == file.read_bytes():
            return
        file.write_bytes(bytes(text))
        with pytest.raises(RunError, match="is not a checkpoint of a node"):
            Checkpoint(folder, "microphone").oldest()


def test_launches_are_counted_for_each_node(tmp_path):
    """As many processes may have published as a node; one where none is started again."""
    recorder = Checkpoint(str(tmp_path), "recorder")
    assert recorder.launches("follower") == 1
    for launches in (1, 2, 3):
        Checkpoint(str(tmp_path), "follower").count_launch()
        assert recorder.launches("follower") == launches
    (tmp_path / "follower.launches").write_text("many")
    with pytest.raises(RunError, match=r"follower\.launches: is not a count of launches"):
        recorder.launches("follower")
    assert Checkpoint("", "recorder").launches("follower") == 1
