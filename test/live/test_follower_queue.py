"""The follower and what it receives from drive and law server, in any order."""

import numpy as np
import pytest

from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import MAX_WAITING
from cam_rig.live.queues import FollowerQueue
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.simulate import FollowerSimulator

LOADED = open_scene(config_root() / "scenes" / "quick.yaml")
STATES = list(cam_states(LOADED.scene))


def ticks(checkpoint=None):
    simulator = FollowerSimulator.of(LOADED)
    simulator.laws.clear()
    return FollowerQueue(simulator, LOADED.scene, checkpoint)


def turn(follower, states):
    out = []
    for state in states:
        follower.add_state(state)
        out += [(end.time_ns, block.rows) for _, end, _, block in follower.complete()]
    return out


@pytest.fixture
def follower():
    made = ticks()
    for law in LOADED.laws.values():
        made.add_law(law)
    return made


def test_states_wait_for_their_law(follower):
    """Law and states come on two topics: nothing is lost, whichever is first."""
    late = ticks()
    assert turn(late, STATES) == []
    for law in LOADED.laws.values():
        late.add_law(law)
    out = [(end.time_ns, block.rows) for _, end, _, block in late.complete()]
    straight = turn(follower, STATES)
    assert [t for t, _ in out] == [t for t, _ in straight] == [s.time_ns for s in STATES[1:]]
    assert all(np.array_equal(a, b) for (_, a), (_, b) in zip(out, straight, strict=True))


@pytest.mark.parametrize("ended", [1, 4, 9, 15])
def test_a_successor_gives_the_same_ticks(follower, ended):
    """From the checkpoint after any tick, the rest is the same bit for bit."""
    turn(follower, STATES[:ended])
    successor = ticks(follower.checkpoint)
    for law in LOADED.laws.values():
        successor.add_law(law)
    rest, again = turn(follower, STATES[ended:]), turn(successor, STATES)
    assert [t for t, _ in again] == [t for t, _ in rest]
    assert all(np.array_equal(a, b) for (_, a), (_, b) in zip(again, rest, strict=True))


def test_another_law_of_the_same_name_is_refused_while_the_cam_turns(follower):
    """A second law server cannot change the cam under the follower."""
    law = LOADED.laws["tm21"]
    other = Law("tm21", law.breaks, law.ordinates * 1.01)
    follower.add_law(other)  # nothing turns yet
    follower.add_law(law)
    turn(follower, STATES[:2])
    follower.add_law(law)
    with pytest.raises(RefusedError, match="is a second law server at work"):
        follower.add_law(other)


def test_states_of_an_unknown_cam_are_bounded():
    """A cam without a law must not fill the memory."""
    made, turned = ticks(), 2.0
    with pytest.raises(RefusedError, match="wait for the law of 'unknown'"):
        for i in range(MAX_WAITING + 1):
            made.add_state(CamState(i * 10**8, i * turned, 20.0, "unknown"))
