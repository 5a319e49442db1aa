"""A successor knows what its predecessor knew, bit for bit; a foreign file makes nothing."""

import json
import os
import tempfile
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.acoustics import MicrophoneState
from cam_rig.dynamics import FollowerState
from cam_rig.errors import RunError
from cam_rig.live.checkpoint import HEAD, MAX_BYTES, Checkpoint, from_plain, to_plain
from cam_rig.live.flow_control import TICKS_KEPT
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerCheckpoint, FollowerSimulator, MicrophoneSimulator

STATES = [CamState(0, 0.0, 20.0, "tm21"), CamState(10**8, 2.0, 20.0, "tm21")]
#: Not any: Hypothesis takes seconds to know all of Unicode.
TEXTS = st.text('a"\\\n\0é\ud800')


def through_json(saved):
    return from_plain(json.loads(json.dumps(to_plain(saved))))


@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(0, 2**62), TEXTS)
def test_every_float_comes_back(number, time_ns, text):
    """Huge, signed zero, subnormal."""
    state = FollowerState(number, -0.0, 5e-324, True, inner=(number, 1.0))
    saved = (FollowerCheckpoint(CamState(time_ns, number, 1.0, text), state), [text], None)
    assert repr(through_json(saved)) == repr(saved)


def test_what_nodes_keep_comes_back():
    """Tables and arrays, as filters have them, and whatever a simulator comes to keep."""
    saved = {"a": np.arange(6.0).reshape(2, 3) / 7.0, 3: (np.float64(0.1), np.int64(2))}
    back = through_json(saved)
    assert np.array_equal(back["a"], saved["a"]) and back[3] == (0.1, 2)
    loaded = open_scene(config_root() / "scenes" / "quick.yaml")
    follower, microphone = FollowerSimulator.of(loaded), MicrophoneSimulator.of(loaded)
    follower.turn_to(STATES[0])
    _, block = follower.turn_to(STATES[1])
    microphone.listen(block.rows, 20.0)
    assert isinstance(microphone.state, MicrophoneState)
    for saved in (follower.checkpoint, microphone.state):
        assert repr(through_json(saved)) == repr(saved)
    with pytest.raises(RunError, match="holds object; allowed: records and arrays"):
        to_plain((object(),))


@pytest.mark.parametrize("done", [0, 1, 5, 30])
def test_a_successor_may_be_killed_as_well(tmp_path, done):
    """It goes back by as many ticks as may not have arrived. While it does again what was done, and
    after: the next one finds the last ticks in a row."""
    checkpoint, depth = Checkpoint(str(tmp_path), "follower"), TICKS_KEPT["follower"]
    for i in range(40):
        checkpoint.save(i, i)
    second = Checkpoint(str(tmp_path), "follower")
    assert second.all() == list(range(40 - depth, 40)) and second.newest() == 39
    assert Checkpoint(str(tmp_path), "microphone").newest() is None
    begin = 40 - depth
    for i in range(begin + 1, begin + 1 + done):
        second.save(i, i)
    newest = max(39, begin + done)
    found = Checkpoint(str(tmp_path), "follower").all()
    assert sorted(set(found))[-depth + 1 :] == list(range(newest - depth + 2, newest + 1))
    assert found == sorted(found)


def test_without_a_folder_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Checkpoint("", "follower").save((1,))
    assert list(tmp_path.iterdir()) == []


def record(path, fields):
    return f'[[0, {{"record": {path}, "fields": {fields}}}]]'


def array(kind, digits="0011223344556677", shape="[1]"):
    return f'[[0, {{"array": "{digits}", "type": "{kind}", "shape": {shape}}}]]'


FOREIGN = [
    *("", "[]", "[[", "[[0, {}]]", "[[1e999, 0]]", '[[0, {"set": []}]]'),
    record('"os:system"', "{}"),
    record('"cam_rig.errors:CamRigError"', "{}"),
    record('"cam_rig.dynamics.interval:FollowerState"', '{"x": 1}'),
    record('"cam_rig.dynamics.interval:FollowerState"', "3"),
    record('"cam_rig.dynamics.interval:np"', "{}"),
    record('"cam_rig.nothing:There"', "{}"),
    record('"cam_rig.acoustics.pressure:SoundSource"', "{}"),
    record("3", "{}"),
    *(array(kind) for kind in ("|O", "|V8", "f4,f4")),
    array("<f8", "00"),
    array("|u1", "00", "[1000000000000]"),
    "[" * 100_000,
    "[[0, " + '{"list": [' * 9000 + "]}" * 9000 + "]]",
    "[[0, " + "9" * 5000 + "]]",
]


def test_a_foreign_file_is_refused(tmp_path):
    """It makes nothing but the rig's own records."""
    for text in FOREIGN:
        (tmp_path / "follower.json").write_text(f"{crc32(text.encode()):08x}\n{text}")
        with pytest.raises(RunError, match=r"follower\.json: is not a checkpoint of a node"):
            Checkpoint(str(tmp_path), "follower").all()


def test_only_a_plain_file_of_its_size_is_read(tmp_path):
    """A link is not followed, and what is too long is neither read nor written."""
    file, other = tmp_path / "follower.json", tmp_path / "other.json"
    other.write_text("[[0, 1]]")
    os.symlink(other, file)
    with pytest.raises(RunError, match="is not a checkpoint of a node"):
        Checkpoint(str(tmp_path), "follower").all()
    file.unlink()
    with file.open("wb") as stream:
        stream.truncate(HEAD + MAX_BYTES + 1)
    with pytest.raises(RunError, match="allowed: 64 MiB"):
        Checkpoint(str(tmp_path), "follower").all()
    with pytest.raises(RunError, match=r"microphone\.json: has .* MiB; allowed: 64 MiB"):
        Checkpoint(str(tmp_path), "microphone").save("x" * MAX_BYTES)


@given(st.data())
def test_a_damaged_file_is_refused(data):
    """Whatever byte of it is another: no state of it is a wrong one, and no error another's."""
    state = (STATES[1], MicrophoneState(1.0, 2.0), np.arange(3.0), {"a": (1, None)})
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
            Checkpoint(folder, "microphone").all()


def test_starts_are_counted_for_each_node(tmp_path):
    """As many processes may have published as a node; one where none is started again."""
    recorder = Checkpoint(str(tmp_path), "recorder")
    assert recorder.starts("follower") == 1
    for starts in (1, 2, 3):
        Checkpoint(str(tmp_path), "follower").count_start()
        assert recorder.starts("follower") == starts
    (tmp_path / "follower.starts").write_text("many")
    with pytest.raises(RunError, match=r"follower\.starts: is not a count of starts"):
        recorder.starts("follower")
    assert Checkpoint("", "recorder").starts("follower") == 1
