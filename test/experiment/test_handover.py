"""A successor knows what its predecessor knew, bit for bit."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.acoustics import MicrophoneState
from cam_rig.bag.topics import TICK_DEPTH
from cam_rig.dynamics import FollowerState
from cam_rig.errors import RunError
from cam_rig.experiment.handover import (
    STATES_UNFLUSHED,
    TICKS_IN_FLIGHT,
    TICKS_KEPT,
    Handover,
    from_plain,
    to_plain,
)
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
    keeper, depth = Handover(str(tmp_path), "follower"), TICKS_KEPT["follower"]
    assert keeper.oldest() is None
    for i in range(40):
        keeper.keep((i, "x"), i)
    successor = Handover(str(tmp_path), "follower")
    assert (successor.oldest(), successor.newest()) == ((40 - depth, "x"), (39, "x"))
    assert [i for i, _ in successor.all()] == list(range(40 - depth, 40))
    assert Handover(str(tmp_path), "microphone").newest() is None


@pytest.mark.parametrize("done", [0, 1, 5, 30])
def test_a_successor_may_die_as_well(tmp_path, done):
    """While it does again what was done, and after: the next one finds the last ticks in a row."""
    keeper, depth = Handover(str(tmp_path), "follower"), TICKS_KEPT["follower"]
    for i in range(40):
        keeper.keep(i, i)
    second = Handover(str(tmp_path), "follower")
    begin = second.oldest()
    for i in range(begin + 1, begin + 1 + done):
        second.keep(i, i)
    newest = max(39, begin + done)
    found = Handover(str(tmp_path), "follower").all()
    assert sorted(set(found))[-depth + 1 :] == list(range(newest - depth + 2, newest + 1))
    assert found == sorted(found)


def test_what_a_chain_of_the_dead_needs_fits_into_a_history():
    """The recorder loses some states; who speaks goes back as far, who is heard by it further."""
    depth = TICKS_KEPT
    assert depth["microphone"] > STATES_UNFLUSHED + TICKS_IN_FLIGHT
    assert depth["follower"] > depth["microphone"] + TICKS_IN_FLIGHT
    assert depth["cam_drive"] > depth["follower"] + TICKS_IN_FLIGHT
    assert depth["cam_drive"] + TICKS_IN_FLIGHT < TICK_DEPTH


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
        '[[0, {"record": "os:system", "fields": {}}]]',
        '[[0, {"record": "cam_rig.errors:CamRigError", "fields": {}}]]',
        '[[0, {"record": "cam_rig.dynamics.block:FollowerState", "fields": {"x": 1}}]]',
        '[[0, {"array": "00", "type": "<f8", "shape": [1]}]]',
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
