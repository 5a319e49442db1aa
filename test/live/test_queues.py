"""Tests of the nodes' input queues, validation of cam states, and flow control.

A tick is the interval between two cam states. Its samples are sent as a block.
"""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from cam_rig.errors import ConfigError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import (
    MAX_TICKS_IN_FLIGHT,
    MAX_WAITING,
    MIN_PACE_WINDOW_S,
    PACE_WINDOW_S,
    FlowControl,
    LostTime,
    Pacing,
    factor_of,
)
from cam_rig.live.queues import FollowerQueue, TickMatcher
from cam_rig.live.state_validation import StateValidator
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import NS

LOADED = open_scene(config_root() / "scenes" / "quick.yaml")
STATES = list(cam_states(LOADED.scene))
S = 10**9


def validate_all(validator, states):
    for state in states:
        validator.validate(state)


def test_the_states_of_a_scene_are_valid():
    """All cam states of a scene are accepted by the validator.

    After the cam has stopped, another sequence of states may start at any angle.
    """
    validator = StateValidator(1000.0)
    validate_all(validator, STATES)
    validate_all(validator, [replace(state, angle=state.angle + 1.0) for state in STATES])


def test_a_repeated_state_is_rejected():
    """A cam state that is received again is refused, and later states are accepted.

    No node of the rig sends a state twice, so another publisher did.
    """
    validator = StateValidator(1000.0)
    validate_all(validator, STATES[:3])
    with pytest.raises(RefusedError, match="must be after the state"):
        validator.validate(STATES[2])
    validate_all(validator, STATES[3:])


LAST = CamState(S, 10.0, 20.0, "tm21")


def later(angle, speed=20.0, time_ns=1_100_000_000):
    return CamState(time_ns, angle, speed, "tm21")


@pytest.mark.parametrize(
    ("state", "text"),
    [
        (later(9.99, time_ns=S - 1), "must be after the state"),
        (later(12.1), "check for a second drive"),
        (later(10.0), "got a difference of 2 rad"),
        (later(float("nan")), "finite"),
        (later(12.0, float("inf")), "finite"),
        (later(12.0, -1.0), "ω must be between 0 and .*got -1"),
        (later(12.0, 1e9), "ω must be between 0 and 10472"),
        (later(12.0, 1.0, -5), "time 0 or later"),
        (later(10.0 + 20.0 * (1e9 - 1), 1.0, 10**18), "by at most 1000 s"),
    ],
)
def test_a_state_that_cannot_follow_is_rejected(state, text):
    """A cam state that cannot follow the last one is refused with value and limit.

    The validator does not change, so that the next valid state is accepted.
    """
    validator = StateValidator(1000.0)
    validator.validate(LAST)
    with pytest.raises(RefusedError, match=text):
        validator.validate(state)
    validator.validate(later(12.0, 30.0))


def test_a_lost_state_is_detected():
    """A cam state that skips a state of the scene is refused.

    It shows that a state was lost. Its angle and time are consistent, but the interval since the
    last state is twice as long.
    """
    validator = StateValidator.of(LOADED.scene)
    validator.validate(STATES[0])
    with pytest.raises(RefusedError, match="a state was lost, or a second drive"):
        validator.validate(STATES[2])
    validate_all(validator, STATES[1:3])


# Laws and states of the follower.


def queue(laws=LOADED.laws):
    simulator = FollowerSimulator.of(LOADED)
    simulator.laws.clear()
    follower = FollowerQueue(simulator, LOADED.scene)
    for law in laws.values():
        follower.add_law(law)
    return follower


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
    """Cam states that arrive before the laws of their cams give the same samples.

    The result equals that of states that arrive after the laws.
    """
    late = queue(laws={})
    assert turn(late, STATES) == []
    for law in LOADED.laws.values():
        late.add_law(law)
    assert complete(late) == straight
    assert [time_ns for time_ns, _ in straight] == [state.time_ns for state in STATES[1:]]


@pytest.mark.parametrize(
    "scene", sorted((config_root() / "scenes").glob("*.yaml")), ids=lambda path: path.stem
)
def test_every_shipped_scene_has_a_tick_for_each_state_after_the_first(scene):
    """For each shipped scene the follower computes samples after the first state."""
    loaded = open_scene(scene)
    simulator, states = FollowerSimulator.of(loaded), list(islice(cam_states(loaded.scene), 4))
    laws = list(simulator.laws.values())
    simulator.laws.clear()
    follower = FollowerQueue(simulator, loaded.scene)
    for law in laws:
        follower.add_law(law)
    assert len(turn(follower, states)) == 3


def test_a_known_law_is_not_replaced(straight):
    """A second law of a known cam does not change the follower's samples."""
    law, follower = LOADED.laws["tm21"], queue()
    out = turn(follower, STATES[:2])
    follower.add_law(Law("tm21", law.breaks, law.ordinates * 1.01))
    assert out + turn(follower, STATES[2:]) == straight


def test_states_of_an_unknown_cam_are_bounded():
    """The follower refuses more waiting states of an unknown cam than its limit.

    They wait for the law of the cam, and would otherwise fill the memory.
    """
    follower = queue(laws={})
    with pytest.raises(RefusedError, match="wait for the law of cam 'unknown'"):
        for i in range(MAX_WAITING + 1):
            follower.add_state(CamState(i * 10**8, i * 2.0, 20.0, "unknown"))


# Matching of blocks of samples and states.


def state_at(time_ns, speed=1.0):
    return CamState(time_ns, 0.0, speed, "cam")


def block(first_s, last_s):
    rows = np.zeros((6, 5))
    rows[0] = np.linspace(first_s, last_s, 5)
    return rows


def start_times(matcher, states=(), blocks=()):
    """Return the start times (ns) of the ticks that are complete after these inputs.

    A tick is complete with its two cam states and its block of samples. `states` are added first,
    then one block for each start time (s) in `blocks`.
    """
    for state in states:
        matcher.add_state(state)
    result = []
    for first in blocks:
        matcher.add_block(block(first, first + 0.8))
        result += [start.time_ns for start, _, _ in matcher.complete()]
    return result


def test_a_block_waits_for_the_state_at_the_end_of_its_tick():
    """Blocks of samples and cam states are joined to ticks, whichever arrive first.

    A tick is the interval between two cam states. No tick is lost or repeated.
    """
    for order in ("bbsss", "sssbb"):
        matcher, ticks = TickMatcher(), []
        blocks, states = iter([block(0.0, 0.9), block(1.0, 1.9)]), iter([0, S, 2 * S])
        for kind in order:
            if kind == "b":
                matcher.add_block(next(blocks))
            else:
                matcher.add_state(state_at(next(states)))
            ticks += list(matcher.complete())
        assert [(a.time_ns, b.time_ns) for a, b, _ in ticks] == [(0, S), (S, 2 * S)]
        assert [rows[0, 0] for _, _, rows in ticks] == [0.0, 1.0]


def test_each_tick_is_yielded_once():
    """Each tick is yielded once, and blocks that do not belong to it are skipped.

    A tick is the interval between two cam states. The other blocks are early, repeated, or of a cam
    at rest.
    """
    assert start_times(TickMatcher(), [state_at(S), state_at(2 * S)], [0.0, 1.0]) == [S]
    states = [state_at(i * S) for i in range(4)]
    repeated = [0.0, 1.0, 0.0, 1.0, 2.0]
    assert start_times(TickMatcher(sample_rate=5), states, repeated) == [0, S, 2 * S]
    states[1] = state_at(S, 0.0)
    assert start_times(TickMatcher(sample_rate=5), states, [0.0, 2.0]) == [0, 2 * S]


@pytest.mark.parametrize("wrong", [block(0.0, 0.7), block(0.0, 0.8)[:, :3], block(1.2, 1.8)])
def test_a_block_with_wrong_samples_is_rejected(wrong):
    """A block whose samples do not fit its tick is refused with the tick's start.

    A tick is the interval between two cam states. The correct block is accepted afterwards.
    """
    matcher = TickMatcher(sample_rate=5)
    assert start_times(matcher, [state_at(i * S) for i in range(3)], [0.0]) == [0]
    matcher.add_block(wrong if wrong[0, 0] > 1 else wrong + np.eye(6, 1))
    with pytest.raises(RefusedError, match="do not belong to the tick that starts at 1"):
        list(matcher.complete())
    assert start_times(matcher, blocks=[1.0]) == [S]


# Flow control: ticks in flight, rig time and wall-clock time.


def make_flow(*consumers, ticks=MAX_TICKS_IN_FLIGHT):
    """Return a flow control with the maximum number of unacknowledged ticks.

    The drive has sent these ticks, the intervals between cam states, and must now wait.
    """
    flow = FlowControl(list(consumers))
    for stamp in range(0, 10 * ticks + 1, 10):
        assert flow.may_send()
        flow.record_sent(stamp)
    return flow


def test_flow_control_limits_the_ticks_in_flight():
    """The drive may be 4 ticks ahead of its slowest consumer, and then waits.

    A tick is the interval between two published cam states. Consumers acknowledge each tick.
    """
    flow = make_flow("fast", "slow")
    assert flow.in_flight == MAX_TICKS_IN_FLIGHT == 4 and not flow.may_send()
    flow.acknowledge("fast", 40)
    assert not flow.may_send() and flow.behind() == ["slow"]
    flow.acknowledge("slow", 10)
    assert flow.may_send()
    flow.acknowledge("slow", 40)
    assert flow.in_flight == 0 and flow.behind() == []


def test_only_the_new_stamp_of_a_sent_state_is_an_acknowledgement():
    """The stamp of a sent state counts as an acknowledgement only once per consumer.

    Other stamps have no effect. Otherwise other publishers could release states.
    """
    flow = make_flow("recorder", ticks=2)
    assert not flow.acknowledge("recorder", 10**18) and flow.in_flight == 2
    assert flow.acknowledge("recorder", 10)
    assert not flow.acknowledge("recorder", 10) and not flow.acknowledge("recorder", 0)
    assert flow.acknowledge("recorder", 20) and flow.in_flight == 0


def test_a_run_continues_without_a_dropped_consumer():
    """The drive does not wait for a consumer node that was dropped from the run.

    Its later acknowledgements are ignored.
    """
    flow = make_flow("follower", "viewer")
    assert flow.acknowledge("follower", 40) and not flow.may_send()
    flow.drop("viewer")
    assert flow.may_send() and flow.behind() == []
    assert not flow.acknowledge("viewer", 40)


def test_pacings_are_free_real_time_or_a_factor():
    """A pacing is free, real_time or a factor such as 20x. Other texts are refused."""
    allowed = {"free": None, "real_time": 1.0, "20x": 20.0, "0.5×": 0.5, "1 x": 1.0}
    assert {text: factor_of(text) for text in allowed} == allowed
    for text in ("", "fast", "x", "-2x", "0x", "1e9x", "nanx", "5"):
        with pytest.raises(ConfigError, match="pacing must be free, real_time, or a factor"):
            factor_of(text)


def test_each_state_waits_for_its_time():
    """A cam state is due at its rig time divided by the real-time factor.

    This is the pacing of a run. A free run never waits. A small delay is compensated.
    """
    pacing = Pacing()
    pacing.record_sent(0, 0.0)
    assert pacing.wait(10**15, 0.0) == 0.0
    pacing.set("4x")
    assert pacing.wait(0, 100.0) == 0.0
    pacing.record_sent(0, 100.0)
    assert pacing.wait(2 * NS, 100.0) == pytest.approx(0.5)
    assert pacing.wait(2 * NS, 100.4) == pytest.approx(0.1)
    assert pacing.wait(2 * NS, 101.0) == 0.0
    pacing.record_sent(2 * NS, 100.55)  # a small delay is made up
    assert pacing.late == 0.0
    assert pacing.wait(4 * NS, 100.55) == pytest.approx(0.45)


def test_a_late_run_reports_the_lost_time_and_does_not_make_it_up():
    """A run that falls behind by seconds reports the lost time and does not catch up.

    A pause is not a delay, because rig time stops.
    """
    pacing = Pacing(1.0)
    pacing.record_sent(0, 0.0)
    pacing.record_sent(NS, 6.0)
    assert pacing.late == pytest.approx(5.0)
    assert pacing.wait(2 * NS, 6.0) == pytest.approx(1.0)
    pacing.record_sent(2 * NS, 7.0)
    assert pacing.late == 0.0
    pacing.pause()
    assert pacing.wait(3 * NS, 50.0) == 0.0
    pacing.record_sent(3 * NS, 50.0)
    assert pacing.late == 0.0


# Pace of a run.


def test_a_slow_run_warns_once_per_window_with_factors_and_nodes():
    """A run that is too slow causes one warning per time window.

    It contains the actual and the set real-time factor, and the nodes that the drive waited for,
    the most frequent first. Less than a tenth of lost time causes no warning.
    """
    lost = LostTime(start=100.0)
    lost.add(5.0)
    for node in ("microphone", "follower", "follower"):
        lost.count_wait(node)
    assert lost.text(20.0, 109.9, PACE_WINDOW_S) == ""
    assert lost.text(20.0, 110.0, PACE_WINDOW_S) == (
        "real-time factor 10 instead of 20 in the last 10 s: waiting for follower, microphone; "
        "set a lower pacing, or reduce the load of this machine"
    )
    lost.add(0.9)  # less than a tenth
    assert lost.text(20.0, 120.0, PACE_WINDOW_S) == ""
    lost.add(1.5)
    assert "15 instead of 20 in the last 6 s: the drive itself is too slow" in lost.text(
        20.0, 126.0, MIN_PACE_WINDOW_S
    )
