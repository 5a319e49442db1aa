"""What is sent again never pushes out of a topic's history what a successor goes back to."""

from collections import deque
from random import Random

from cam_rig.live.flow_control import (
    HISTORY_DEPTH,
    MAX_TICKS_IN_FLIGHT,
    TICKS_IN_HISTORY,
    TICKS_KEPT,
)
from cam_rig.live.queues import RepeatBudget


def assert_first_messages_stay(history, sent):
    """The last ticks are all there for the first time, in their order."""
    wanted = list(range(max(0, sent - TICKS_IN_HISTORY), sent))
    assert [tick for tick, first in history if first and tick in wanted] == wanted


def test_the_last_ticks_stay_whatever_is_repeated():
    """200 random courses of ticks and repeats, from the first message of a topic on."""
    for seed in range(200):
        random, budget, sent = Random(seed), RepeatBudget(), 0
        history = deque(maxlen=HISTORY_DEPTH)
        for _ in range(random.randint(1, 400)):
            if random.random() < random.choice((0.02, 0.3, 0.9)):
                budget.publish()
                history.append((sent, True))
                sent += 1
            elif sent and budget.repeat():
                history.append((max(0, sent - random.randint(1, 5)), False))
            assert_first_messages_stay(history, sent)


def test_what_is_in_flight_may_be_repeated_seven_times():
    """A flood from elsewhere may push several of the repeats out of a subscription, too."""
    budget = RepeatBudget()
    for _ in range(100):
        budget.publish()
    assert sum(budget.repeat() for _ in range(100)) >= 7 * (MAX_TICKS_IN_FLIGHT + 1)


def test_new_ticks_make_room():
    """Whatever was repeated before, a history of ticks later as much may be repeated again."""
    budget = RepeatBudget()
    for _ in range(10):
        for _ in range(TICKS_IN_HISTORY):
            budget.publish()
        assert sum(budget.repeat() for _ in range(1000)) == HISTORY_DEPTH - TICKS_IN_HISTORY


def test_every_successor_goes_back_less_far():
    """No node goes back further than what stays."""
    assert max(TICKS_KEPT.values()) + MAX_TICKS_IN_FLIGHT < TICKS_IN_HISTORY
