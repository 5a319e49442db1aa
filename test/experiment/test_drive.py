"""The drive's program: nothing goes out before everyone is ready for it."""

import itertools

import pytest

from cam_rig.experiment.credit import Credit
from cam_rig.experiment.drive import DriveProgram
from cam_rig.experiment.stage import open_stage
from cam_rig.schema.load import config_root


@pytest.fixture
def stage():
    return open_stage(config_root() / "scenes" / "quick.yaml")


def test_credit_bounds_the_ticks_in_flight():
    """No more than the limit goes out while the slowest is silent."""
    credit = Credit(["fast", "slow"], 2)
    for stamp in (0, 10, 20):
        assert credit.may_send()
        credit.sent(stamp)
    assert credit.in_flight == 2
    assert not credit.may_send()
    credit.acknowledge("fast", 20)
    assert not credit.may_send()
    assert credit.behind() == ["slow"]
    credit.acknowledge("slow", 10)
    assert credit.may_send()
    credit.acknowledge("slow", 20)
    assert credit.in_flight == 0
    assert credit.behind() == []


def test_a_late_acknowledgement_of_old_news_changes_nothing():
    """Stamps that go backwards do not give credit back or take it away."""
    credit = Credit(["one"], 1)
    for stamp in (0, 10):
        credit.sent(stamp)
    credit.acknowledge("one", 10)
    credit.acknowledge("one", 0)
    assert credit.in_flight == 0


def follow(program, states):
    """Answer as the other nodes do; returns the states that went out."""
    out = []
    for _ in range(states):
        state = program.take()
        if state is not None:
            out.append(state)
            program.credit.acknowledge("all", state.time_ns)
    return out


def test_the_whole_scene_goes_out_once_and_in_order(stage):
    """Every state of the scene, with one request for each cam."""
    asked = []

    def mount(cam):
        asked.append(cam)
        program.laws[cam] = stage.laws[cam]
        return True

    program = DriveProgram(stage.scene, ["all"], 4, mount)
    out = follow(program, 100)
    assert program.done
    assert asked == stage.scene.cams
    assert len(out) == program.ticks + 1
    assert all(a.time_ns < b.time_ns for a, b in itertools.pairwise(out))


def test_nothing_turns_before_its_law_is_known(stage):
    """A cam that nobody has published is waited for, by name."""
    program = DriveProgram(stage.scene, ["all"], 4, lambda cam: True)
    assert program.take() is None
    assert program.waits_for() == ["law_server"]
    assert not program.done
