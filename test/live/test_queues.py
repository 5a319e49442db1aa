"""What a node receives, in any order: possible states, laws and states, blocks and states."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import MAX_WAITING
from cam_rig.live.queues import FollowerQueue, TickMatcher
from cam_rig.live.state_validation import Admission, StateValidator
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.simulate import FollowerSimulator

LOADED = open_scene(config_root() / "scenes" / "quick.yaml")
STATES = list(cam_states(LOADED.scene))
S = 10**9


def admitted(validator, states):
    return {validator.admit(state) for state in states}


def test_a_scene_is_admitted_and_its_repetition_known():
    """A drive that was started again sends its last states once more."""
    validator = StateValidator(1000.0)
    assert validator.admit(STATES[0]) is Admission.NEW_SEQUENCE
    assert admitted(validator, STATES[1:]) == {Admission.NEXT}
    assert admitted(validator, STATES[-9:]) == {Admission.SEEN}
    again = [replace(state, angle=state.angle + 1.0) for state in STATES]
    assert validator.admit(again[0]) is Admission.NEW_SEQUENCE  # the cam stood: a new run's
    assert validator.admit(again[1]) is Admission.NEXT


def test_a_successor_passes_over_what_was_done():
    """Histories begin long before the state to go on from."""
    validator = StateValidator(1000.0, STATES[5])
    assert admitted(validator, STATES[:6]) == {Admission.SEEN}
    assert validator.admit(STATES[6]) is Admission.NEXT


LAST = CamState(S, 10.0, 20.0, "tm21")


def later(angle, speed=20.0, time_ns=1_100_000_000):
    return CamState(time_ns, angle, speed, "tm21")


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (later(9.99, time_ns=S - 1), "stamps that rise"),
        (later(12.1), "is a second drive at work"),
        (later(10.0), "θ is 2 rad from"),
        (later(float("nan")), "finite"),
        (later(12.0, float("inf")), "finite"),
        (later(12.0, -1.0), "ω -1 rad/s; allowed: 0 to"),
        (later(12.0, 1e9), "allowed: 0 to 10472"),
        (later(12.0, 1.0, -5), "time from zero"),
        (later(10.0 + 20.0 * (1e9 - 1), 1.0, 10**18), "by at most 1000 s"),
    ],
)
def test_what_cannot_follow_is_refused(state, words):
    """The words name the number and what is allowed; the validator stays as it was."""
    validator = StateValidator(1000.0)
    validator.admit(LAST)
    with pytest.raises(RefusedError, match=words):
        validator.admit(state)
    assert validator.admit(later(12.0, 30.0)) is Admission.NEXT


def test_a_lost_state_is_noticed():
    """At constant speed the next but one leads on too, but a tick is never two turns."""
    validator = StateValidator.of(LOADED.scene)
    validator.admit(STATES[0])
    with pytest.raises(RefusedError, match="was one lost, or is a second drive"):
        validator.admit(STATES[2])
    assert admitted(validator, STATES[1:3]) == {Admission.NEXT}


# The follower: laws and states.


def queue(checkpoint=None, laws=LOADED.laws):
    simulator = FollowerSimulator.of(LOADED)
    simulator.laws.clear()
    made = FollowerQueue(simulator, LOADED.scene, checkpoint)
    for law in laws.values():
        made.add_law(law)
    return made


def complete(follower):
    return [(end.time_ns, block.rows.tolist()) for _, end, _, block in follower.complete()]


def turn(follower, states):
    out = []
    for state in states:
        follower.add_state(state)
        out += complete(follower)
    return out


@pytest.fixture(scope="module")
def straight():
    return turn(queue(), STATES)


def test_states_wait_for_their_law(straight):
    """Law and states come on two topics: nothing is lost, whichever is first."""
    late = queue(laws={})
    assert turn(late, STATES) == []
    for law in LOADED.laws.values():
        late.add_law(law)
    assert complete(late) == straight
    assert [time_ns for time_ns, _ in straight] == [state.time_ns for state in STATES[1:]]


def test_a_successor_gives_the_same_ticks(straight):
    """From the checkpoint after any tick, the rest is the same bit for bit."""
    for ended in (1, 4, 9, 15):
        follower = queue()
        turn(follower, STATES[:ended])
        assert turn(queue(follower.checkpoint), STATES) == straight[ended - 1 :]


def test_a_law_that_is_known_is_not_changed(straight):
    """A second law server cannot change the cam under the follower, in its last digits neither."""
    law, follower = LOADED.laws["tm21"], queue()
    out = turn(follower, STATES[:2])
    follower.add_law(Law("tm21", law.breaks, law.ordinates * 1.01))
    assert out + turn(follower, STATES[2:]) == straight


def test_states_of_an_unknown_cam_are_bounded():
    """A cam without a law must not fill the memory."""
    follower = queue(laws={})
    with pytest.raises(RefusedError, match="wait for the law of 'unknown'"):
        for i in range(MAX_WAITING + 1):
            follower.add_state(CamState(i * 10**8, i * 2.0, 20.0, "unknown"))


# Blocks of samples, and the states between which they lie.


def at(time_ns, speed=1.0):
    return CamState(time_ns, 0.0, speed, "cam")


def block(first_s, last_s):
    rows = np.zeros((6, 5))
    rows[0] = np.linspace(first_s, last_s, 5)
    return rows


def begun(matcher, states=(), blocks=()):
    """The stamps at which the ticks begin that are complete with each block."""
    for state in states:
        matcher.add_state(state)
    found = []
    for first in blocks:
        matcher.add_block(block(first, first + 0.8))
        found += [start.time_ns for start, _, _ in matcher.complete()]
    return found


def test_a_block_waits_for_the_state_that_closes_its_tick():
    """Neither order loses or repeats a tick."""
    for order in ("bbsss", "sssbb"):
        matcher, found = TickMatcher(), []
        blocks, states = iter([block(0.0, 0.9), block(1.0, 1.9)]), iter([0, S, 2 * S])
        for kind in order:
            if kind == "b":
                matcher.add_block(next(blocks))
            else:
                matcher.add_state(at(next(states)))
            found += list(matcher.complete())
        assert [(a.time_ns, b.time_ns) for a, b, _ in found] == [(0, S), (S, 2 * S)]
        assert [rows[0, 0] for _, _, rows in found] == [0.0, 1.0]


@pytest.mark.parametrize(
    ("matcher", "states", "blocks", "found"),
    [
        pytest.param({}, [at(S), at(2 * S)], [0.0, 1.0], [S], id="from before we listened"),
        pytest.param(
            {"sample_rate": 5},
            [at(i * S) for i in range(4)],
            [0.0, 1.0, 0.0, 1.0, 2.0],
            [0, S, 2 * S],
            id="sent again by a successor",
        ),
        pytest.param(
            {"sample_rate": 5, "since": S},
            [at(i * S) for i in range(3)],
            [0.0, 1.0],
            [S],
            id="done by a predecessor",
        ),
        pytest.param(
            {"sample_rate": 5},
            [at(0), at(S, 0.0), at(2 * S), at(3 * S)],
            [0.0, 2.0],
            [0, 2 * S],
            id="the cam stood",
        ),
    ],
)
def test_each_tick_is_given_once(matcher, states, blocks, found):
    assert begun(TickMatcher(**matcher), states, blocks) == found


@pytest.mark.parametrize("wrong", [block(0.0, 0.7), block(0.0, 0.8)[:, :3], block(1.2, 1.8)])
def test_a_block_of_other_samples_is_refused(wrong):
    """It is named, and the right one is taken."""
    matcher = TickMatcher(sample_rate=5)
    assert begun(matcher, [at(0), at(S), at(2 * S)], [0.0]) == [0]
    matcher.add_block(wrong if wrong[0, 0] > 1 else wrong + np.eye(6, 1))
    with pytest.raises(RefusedError, match="allowed: the samples of the tick that begins at 1"):
        list(matcher.complete())
    assert begun(matcher, blocks=[1.0]) == [S]
