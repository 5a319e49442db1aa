"""A successor knows what its predecessor knew, bit for bit."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.acoustics import MicrophoneState
from cam_rig.dynamics import FollowerState
from cam_rig.errors import RunError
from cam_rig.experiment.handover import Handover, from_plain, to_plain
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import open_stage
from cam_rig.experiment.sweep import FollowerBench, FollowerMemory, MicrophoneBench
from cam_rig.schema.load import config_root

STAGE = open_stage(config_root() / "scenes" / "quick.yaml")


@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(0, 2**62), st.text())
def test_every_float_comes_back(number, time_ns, text):
    """Huge, signed zero, subnormal: a file in between changes nothing."""
    state = FollowerState(number, -0.0, 5e-324, True, inner=(number, 1.0))
    memory = (FollowerMemory(CamState(time_ns, number, 1.0, text), state), [text], None)
    back = from_plain(json.loads(json.dumps(to_plain(memory))))
    assert repr(back) == repr(memory)


def test_arrays_and_tables_come_back():
    """Filters remember arrays."""
    memory = {"a": np.arange(6.0).reshape(2, 3) / 7.0, 3: (np.float64(0.1), np.int64(2))}
    back = from_plain(json.loads(json.dumps(to_plain(memory))))
    assert np.array_equal(back["a"], memory["a"]) and back[3] == (0.1, 2)


def test_the_benches_memories_can_be_handed_over():
    """Whatever a follower or microphone comes to remember must pass."""
    states = [CamState(0, 0.0, 20.0, "tm21"), CamState(10**8, 2.0, 20.0, "tm21")]
    follower, microphone = FollowerBench.of(STAGE), MicrophoneBench.of(STAGE)
    follower.turn_to(states[0])
    _, block = follower.turn_to(states[1])
    microphone.listen(block.rows, 20.0)
    assert isinstance(microphone.memory, MicrophoneState)
    for memory in (follower.memory, microphone.memory):
        assert repr(from_plain(json.loads(json.dumps(to_plain(memory))))) == repr(memory)


def test_the_last_records_are_kept(tmp_path):
    """A successor goes back by as many ticks as may not have arrived."""
    keeper = Handover(str(tmp_path), "follower", depth=3)
    assert keeper.oldest() is None
    for i in range(10):
        keeper.keep((i, "x"))
    successor = Handover(str(tmp_path), "follower", depth=3)
    assert (successor.oldest(), successor.newest()) == ((7, "x"), (9, "x"))
    assert Handover(str(tmp_path), "microphone").newest() is None


def test_without_a_folder_nothing_is_kept(tmp_path, monkeypatch):
    """A node by itself leaves no file."""
    monkeypatch.chdir(tmp_path)
    Handover("", "follower").keep((1,))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "[[",
        '[{"record": "os:system", "fields": {}}]',
        '[{"record": "cam_rig.errors:CamRigError", "fields": {}}]',
        '[{"record": "cam_rig.dynamics.block:FollowerState", "fields": {"x": 1}}]',
        '[{"array": "00", "type": "<f8", "shape": [1]}]',
    ],
)
def test_a_foreign_file_is_refused(tmp_path, text):
    """It makes nothing but the rig's own records."""
    (tmp_path / "follower.json").write_text(text)
    with pytest.raises(RunError, match=r"follower\.json: is no handover of a node"):
        Handover(str(tmp_path), "follower").oldest()


def test_a_memory_that_is_no_record_is_refused():
    """Better at once than in the successor."""
    with pytest.raises(RunError, match="holds object; allowed: records and arrays"):
        to_plain((object(),))
