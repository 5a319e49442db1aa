"""A bounded number of ticks in flight, and the numbers that follow from it."""

from cam_rig.live.flow_control import (
    HISTORY_DEPTH,
    MAX_STATES_UNFLUSHED,
    MAX_TICKS_IN_FLIGHT,
    TICKS_KEPT,
    FlowControl,
)


def test_what_a_chain_of_successors_needs_fits_into_a_history():
    """The recorder loses some states; a publisher goes back as far, those before it further."""
    depth = TICKS_KEPT
    assert depth["microphone"] > MAX_STATES_UNFLUSHED + MAX_TICKS_IN_FLIGHT
    assert depth["follower"] > depth["microphone"] + MAX_TICKS_IN_FLIGHT
    assert depth["cam_drive"] > depth["follower"] + MAX_TICKS_IN_FLIGHT
    assert depth["cam_drive"] + MAX_TICKS_IN_FLIGHT < HISTORY_DEPTH


def test_flow_control_bounds_the_ticks_in_flight():
    """No more than the limit goes out while the slowest consumer is silent."""
    flow = FlowControl(["fast", "slow"], 2)
    for stamp in (0, 10, 20):
        assert flow.may_send()
        flow.sent(stamp)
    assert flow.in_flight == 2
    assert not flow.may_send()
    flow.acknowledge("fast", 20)
    assert not flow.may_send()
    assert flow.behind() == ["slow"]
    flow.acknowledge("slow", 10)
    assert flow.may_send()
    flow.acknowledge("slow", 20)
    assert flow.in_flight == 0
    assert flow.behind() == []


def test_a_late_acknowledgement_changes_nothing():
    """Stamps that go backwards do not change what is in flight."""
    flow = FlowControl(["one"], 1)
    for stamp in (0, 10):
        flow.sent(stamp)
    assert flow.acknowledge("one", 10)
    flow.acknowledge("one", 0)
    assert flow.in_flight == 0


def test_a_stamp_that_was_not_sent_acknowledges_nothing():
    """Stamps of another publisher must not make the drive run away."""
    flow = FlowControl(["one"], 1)
    for stamp in (0, 10):
        flow.sent(stamp)
    assert not flow.acknowledge("one", 10**18)
    assert flow.in_flight == 1


def test_a_repeated_acknowledgement_counts_nothing():
    """Else a consumer that only repeats itself would seem to make progress for ever."""
    flow = FlowControl(["recorder"], 4)
    for stamp in (0, 10, 20):
        flow.sent(stamp)
    assert flow.acknowledge("recorder", 10)
    assert not flow.acknowledge("recorder", 10)
    assert not flow.acknowledge("recorder", 0)
    assert flow.acknowledge("recorder", 20)


def test_a_run_goes_on_without_a_dropped_consumer():
    """What it has not acknowledged holds nothing back, and what it sends later counts nothing."""
    flow = FlowControl(["follower", "viewer"], 1)
    for stamp in (0, 10):
        flow.sent(stamp)
    assert flow.acknowledge("follower", 10) and not flow.may_send()
    flow.drop("viewer")
    assert flow.may_send() and flow.behind() == []
    assert not flow.acknowledge("viewer", 10)
