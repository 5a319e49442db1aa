"""How far the drive may run ahead: ticks in flight, rig time beside wall time, repeats."""

from collections import deque
from random import Random

import pytest

from cam_rig.errors import ConfigError
from cam_rig.live.flow_control import (
    HISTORY_DEPTH,
    MAX_STATES_UNFLUSHED,
    MAX_TICKS_IN_FLIGHT,
    TICKS_IN_HISTORY,
    TICKS_KEPT,
    FlowControl,
    Pacing,
    factor_of,
)
from cam_rig.live.queues import RepeatBudget
from cam_rig.units import NS


def test_what_a_chain_of_successors_needs_fits_into_a_history():
    """The recorder loses some states; a publisher goes back as far, those before it further."""
    depth = TICKS_KEPT
    assert depth["microphone"] > MAX_STATES_UNFLUSHED + MAX_TICKS_IN_FLIGHT
    assert depth["follower"] > depth["microphone"] + MAX_TICKS_IN_FLIGHT
    assert depth["cam_drive"] > depth["follower"] + MAX_TICKS_IN_FLIGHT
    assert max(depth.values()) + MAX_TICKS_IN_FLIGHT < TICKS_IN_HISTORY < HISTORY_DEPTH


def flow(*consumers, ticks=MAX_TICKS_IN_FLIGHT):
    made = FlowControl(list(consumers))
    for stamp in range(0, 10 * ticks + 1, 10):
        assert made.may_send()
        made.sent(stamp)
    return made


def test_flow_control_bounds_the_ticks_in_flight():
    """No more than the limit goes out while the slowest consumer is silent."""
    made = flow("fast", "slow")
    assert made.in_flight == MAX_TICKS_IN_FLIGHT == 4 and not made.may_send()
    made.acknowledge("fast", 40)
    assert not made.may_send() and made.behind() == ["slow"]
    made.acknowledge("slow", 10)
    assert made.may_send()
    made.acknowledge("slow", 40)
    assert made.in_flight == 0 and made.behind() == []


def test_only_a_stamp_that_is_new_and_was_sent_counts():
    """Else another publisher would make the drive run away, or a repeat seem progress for ever."""
    made = flow("one", ticks=2)
    assert not made.acknowledge("one", 10**18) and made.in_flight == 2
    assert made.acknowledge("one", 10)
    assert not made.acknowledge("one", 10) and not made.acknowledge("one", 0)
    assert made.acknowledge("one", 20) and made.in_flight == 0


def test_a_run_goes_on_without_a_dropped_consumer():
    """What it has not acknowledged holds nothing back, and what it sends later counts nothing."""
    made = flow("follower", "viewer")
    assert made.acknowledge("follower", 40) and not made.may_send()
    made.drop("viewer")
    assert made.may_send() and made.behind() == []
    assert not made.acknowledge("viewer", 40)


def test_paces():
    allowed = {"free": None, "real_time": 1.0, "20x": 20.0, "0.5×": 0.5, "1 x": 1.0}
    assert {text: factor_of(text) for text in allowed} == allowed
    for text in ("", "fast", "x", "-2x", "0x", "1e9x", "nanx", "5"):
        with pytest.raises(ConfigError, match="allowed: free, real_time, or a factor"):
            factor_of(text)


def test_each_state_waits_for_its_time():
    """At 4x, a state 2 s later in rig time is due half a second later; a free run never waits."""
    pacing = Pacing()
    pacing.sent(0, 0.0)
    assert pacing.wait(10**15, 0.0) == 0.0
    pacing.set("4x")
    assert pacing.wait(0, 100.0) == 0.0
    pacing.sent(0, 100.0)
    assert pacing.wait(2 * NS, 100.0) == pytest.approx(0.5)
    assert pacing.wait(2 * NS, 100.4) == pytest.approx(0.1)
    assert pacing.wait(2 * NS, 101.0) == 0.0
    pacing.sent(2 * NS, 100.55)  # a little late is made up
    assert pacing.late == 0.0
    assert pacing.wait(4 * NS, 100.55) == pytest.approx(0.45)


def test_a_late_run_reports_it_and_goes_on_from_there():
    """Five stalled seconds are not made up in a rush; a stop is not late, as rig time stands."""
    pacing = Pacing(1.0)
    pacing.sent(0, 0.0)
    pacing.sent(NS, 6.0)
    assert pacing.late == pytest.approx(5.0)
    assert pacing.wait(2 * NS, 6.0) == pytest.approx(1.0)
    pacing.sent(2 * NS, 7.0)
    assert pacing.late == 0.0
    pacing.stand()
    assert pacing.wait(3 * NS, 50.0) == 0.0
    pacing.sent(3 * NS, 50.0)
    assert pacing.late == 0.0


def test_the_first_messages_of_the_last_ticks_stay_whatever_is_repeated():
    """In their order, in random courses of ticks and repeats from a topic's first message on."""
    for seed in range(40):
        random, budget, sent = Random(seed), RepeatBudget(), 0
        history = deque(maxlen=HISTORY_DEPTH)
        for _ in range(random.randint(1, 400)):
            if random.random() < random.choice((0.02, 0.3, 0.9)):
                budget.publish()
                history.append((sent, True))
                sent += 1
            elif sent and budget.repeat():
                history.append((max(0, sent - random.randint(1, 5)), False))
            wanted = list(range(max(0, sent - TICKS_IN_HISTORY), sent))
            assert [tick for tick, first in history if first and tick in wanted] == wanted


def test_repeats_have_room():
    """Of what is in flight seven times, as a flood may push some out; new ticks make room anew."""
    budget = RepeatBudget()
    for _ in range(10):
        for _ in range(TICKS_IN_HISTORY):
            budget.publish()
        repeats = sum(budget.repeat() for _ in range(1000))
        assert repeats == HISTORY_DEPTH - TICKS_IN_HISTORY >= 7 * (MAX_TICKS_IN_FLIGHT + 1)
