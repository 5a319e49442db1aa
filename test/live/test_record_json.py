"""Records as JSON and back, bit for bit."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.acoustics import MicrophoneState
from cam_rig.dynamics import FollowerState
from cam_rig.errors import RunError
from cam_rig.live.checkpoint import from_plain, to_plain
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerCheckpoint, FollowerSimulator, MicrophoneSimulator

LOADED = open_scene(config_root() / "scenes" / "quick.yaml")


@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(0, 2**62), st.text())
def test_every_float_comes_back(number, time_ns, text):
    """Huge, signed zero, subnormal: a file in between changes nothing."""
    state = FollowerState(number, -0.0, 5e-324, True, inner=(number, 1.0))
    saved = (FollowerCheckpoint(CamState(time_ns, number, 1.0, text), state), [text], None)
    back = from_plain(json.loads(json.dumps(to_plain(saved))))
    assert repr(back) == repr(saved)


def test_arrays_and_tables_come_back():
    """Filters keep arrays."""
    saved = {"a": np.arange(6.0).reshape(2, 3) / 7.0, 3: (np.float64(0.1), np.int64(2))}
    back = from_plain(json.loads(json.dumps(to_plain(saved))))
    assert np.array_equal(back["a"], saved["a"]) and back[3] == (0.1, 2)


def test_the_simulators_states_can_be_saved():
    """Whatever a follower or microphone comes to keep must pass."""
    states = [CamState(0, 0.0, 20.0, "tm21"), CamState(10**8, 2.0, 20.0, "tm21")]
    follower, microphone = FollowerSimulator.of(LOADED), MicrophoneSimulator.of(LOADED)
    follower.turn_to(states[0])
    _, block = follower.turn_to(states[1])
    microphone.listen(block.rows, 20.0)
    assert isinstance(microphone.state, MicrophoneState)
    for saved in (follower.checkpoint, microphone.state):
        assert repr(from_plain(json.loads(json.dumps(to_plain(saved))))) == repr(saved)


def test_a_state_that_is_not_a_record_is_refused():
    """Better at once than in the successor."""
    with pytest.raises(RunError, match="holds object; allowed: records and arrays"):
        to_plain((object(),))
