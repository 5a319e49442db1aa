"""What pages are shown follows from what the nodes say, in whatever order it comes."""

from __future__ import annotations

import pytest

import cam_rig
from cam_rig.errors import RefusedError
from cam_rig.messages.topics import HEARTBEAT, PACE
from cam_rig.panel.bench import live_state
from cam_rig.panel.bench.live_state import LiveState
from cam_rig.panel.bench.runner import Setup
from cam_rig.units import NS

RPM, TICKS = 300.0, 12


@pytest.fixture
def live() -> LiveState:
    """A bench whose nodes run."""
    state = LiveState(Setup.of(cam_rig.load_rig("paper_table2"), "poly345"))
    state.happened({"graph": "starting", "domain": 7})
    state.heard({"health": [f"cam_drive{HEARTBEAT}", 0, {"state": "stopped", "waits_for": ""}]})
    state.heard({"node": "microphone", "values": {"frequency_weighting": "A"}})
    state.heard({"node": "microphone", "values": {"time_weighting": "F"}})
    return state


def turn(live: LiveState, first: int, count: int) -> None:
    """Ticks of a speed, each with its level."""
    for k in range(first, first + count):
        times = [round(n * 60.0 / RPM / TICKS * NS) for n in (k, k + 1)]
        live.heard({"state": {"time_ns": times[0], "cam": "poly345", "rpm": RPM, "angle": 0.0}})
        live.heard({"level": 80.0, "time_ns": times[1]})


def test_a_contact_that_was_lost_in_the_mean_is_noted(live: LiveState) -> None:
    """Though the last tick was in contact; long after, it is not."""
    live.heard({"health": ["follower", 0, {}]})
    turn(live, 0, 150)
    assert live.note().contact == "in contact"
    live.heard({"health": ["follower", 1, {}]})
    live.heard({"health": ["follower", 0, {}]})
    turn(live, 150, 20)
    assert live.note().contact == "contact lost"
    assert live.losses == 1
    turn(live, 170, 90)
    assert live.note().contact == "in contact"
    assert [reading.weighting for reading in live.readings] == ["LAF"] * 3


def test_the_drive_is_what_it_says(live: LiveState) -> None:
    """Stopped, waiting, turning, stopped in an emergency until it says that it turns again."""
    assert (live.graph, live.drive) == ("running", "stopped")
    waiting = {"state": "waiting", "waits_for": "viewer"}
    live.heard({"health": [f"cam_drive{HEARTBEAT}", 0, waiting]})
    assert live.waits_for == "viewer"
    turn(live, 0, 1)
    assert (live.drive, live.waits_for) == ("turning", "")
    live.heard({"health": ["cam_drive", 2, {}]})
    turn(live, 1, 1)
    assert live.drive == "emergency"
    live.heard({"health": ["cam_drive", 0, {}]})
    assert live.drive == "turning"
    live.heard({"health": [PACE, 1, {}]})
    assert live.late == "lagging"
    live.heard({"health": [PACE, 0, {}]})
    assert live.late == ""


def test_what_is_in_flight_after_a_stop_does_not_turn(live: LiveState) -> None:
    """Four ticks may still come; more of them, and somebody else has started it."""
    turn(live, 0, 150)
    live.stopped()
    turn(live, 150, 4)
    assert (live.drive, live.shown()["level"]) == ("stopped", None)
    with pytest.raises(RefusedError, match="the cam stands"):
        live.note()
    turn(live, 154, 2)
    assert live.drive == "turning"


def test_another_weighting_or_cam_begins_a_new_reading(live: LiveState) -> None:
    """What was read before is of something else."""
    turn(live, 0, 150)
    live.note()
    live.heard({"node": "microphone", "values": {"frequency_weighting": "C"}})
    with pytest.raises(RefusedError):
        live.note()


def test_a_set_up_begins_anew_and_keeps_what_was_noted(live: LiveState) -> None:
    """Cam and speed are carried over; contact, level and nodes that ended are of the old run."""
    live.heard({"node": "cam_drive", "values": {"rpm": 280.0, "pacing": "5x"}})
    turn(live, 0, 150)
    live.note()
    live.happened({"ended": {"follower": "node follower was ended by signal 9"}})
    assert live.mounted() == {"cam": "poly345", "rpm": 280.0}
    assert live.chosen()["cam_drive"] == {"pacing": "5x"}
    live.happened({"graph": "starting"})
    shown = live.shown()
    assert (shown["state"], shown["ended"], shown["level"]) == ({}, {}, None)
    assert len(shown["readings"]) == 1


def test_readings_are_bounded(live: LiveState, monkeypatch: pytest.MonkeyPatch) -> None:
    """A button that is held down does not fill the memory."""
    monkeypatch.setattr(live_state, "MAX_READINGS", 2)
    turn(live, 0, 150)
    live.note()
    live.note()
    with pytest.raises(RefusedError, match="clear them"):
        live.note()
    live.clear()
    live.note()
