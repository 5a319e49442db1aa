"""The drive's program: nothing goes out before everyone is ready for it."""

import itertools

import pytest

from cam_rig.errors import RefusedError
from cam_rig.live.checkpoint import Handover
from cam_rig.live.drive import DriveProgram, OperatorCommands
from cam_rig.live.flow_control import FlowControl
from cam_rig.live.setpoints import SetpointSchedule
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states


@pytest.fixture
def loaded():
    return open_scene(config_root() / "scenes" / "quick.yaml")


def test_credit_bounds_the_ticks_in_flight():
    """No more than the limit goes out while the slowest is silent."""
    credit = FlowControl(["fast", "slow"], 2)
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
    credit = FlowControl(["one"], 1)
    for stamp in (0, 10):
        credit.sent(stamp)
    assert credit.acknowledge("one", 10)
    credit.acknowledge("one", 0)
    assert credit.in_flight == 0


def test_an_answer_to_nothing_that_was_sent_gives_no_credit():
    """Somebody else's stamps must not make the drive run away."""
    credit = FlowControl(["one"], 1)
    for stamp in (0, 10):
        credit.sent(stamp)
    assert not credit.acknowledge("one", 10**18)
    assert credit.in_flight == 1


def follow(program, states):
    """Answer as the other nodes do; returns the states that went out."""
    out = []
    for now in range(states):
        state = program.take(float(now))
        if state is not None:
            out.append(state)
            program.credit.acknowledge("all", state.time_ns)
    return out


def test_the_whole_scene_goes_out_once_and_in_order(loaded):
    """Every state of the scene, with one request for each cam."""
    asked = []

    def mount(cam):
        asked.append(cam)
        program.laws[cam] = loaded.laws[cam]
        return True

    program = DriveProgram(loaded.scene, ["all"], 4, mount)
    out = follow(program, 100)
    assert program.done
    assert asked == loaded.scene.cams
    assert len(out) == program.ticks + 1
    assert all(a.time_ns < b.time_ns for a, b in itertools.pairwise(out))


def test_nothing_turns_before_its_law_is_known(loaded):
    """A cam that nobody has published is waited for, by name."""
    program = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True)
    assert program.take(0.0) is None
    assert program.waits_for() == ["law_server"]
    assert not program.done


@pytest.fixture
def program(loaded):
    made = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True)
    made.laws.update(loaded.laws)
    return made


def test_an_unanswered_request_for_a_cam_is_made_again(loaded):
    """The law server may have died with it; once a second, not more often."""
    asked = []
    program = DriveProgram(loaded.scene, ["all"], 4, lambda cam: asked.append(cam) is None)
    for now in (0.0, 0.1, 0.9, 1.1, 1.2, 2.5):
        assert program.take(now) is None
    assert asked == ["tm21"] * 3


def test_a_stopped_drive_sends_nothing_and_goes_on(loaded, program):
    """Stop and start leave no trace in the states."""
    out = follow(program, 5)
    program.run(False)
    assert follow(program, 5) == []
    program.run(True)
    out += follow(program, 100)
    assert out == list(cam_states(loaded.scene))
    assert program.done


def test_an_emergency_stop_waits_for_a_reset(program):
    """The cam stands at once; start alone does nothing."""
    out = follow(program, 5)
    standing = program.halt()
    assert standing.speed == 0.0 and standing.time_ns > out[-1].time_ns
    program.credit.acknowledge("all", standing.time_ns)
    program.run(True)
    assert follow(program, 5) == []
    assert not program.done
    program.reset()
    assert follow(program, 5) == []
    program.run(True)
    again = follow(program, 100)
    assert again[0].time_ns > standing.time_ns and again[0].angle == standing.angle
    assert program.done


def test_a_drive_that_died_is_followed_without_a_gap(loaded):
    """The successor says the last states again, then goes on: the same states in all."""
    first = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True)
    first.laws.update(loaded.laws)
    out, memories = [], []
    for _ in range(7):
        out += follow(first, 1)
        memories.append(first.memory)
    second = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True, memories[-3:])
    assert second.take(0.0) is None  # no law yet: nothing to say
    second.laws.update(loaded.laws)
    again = follow(second, 100)
    assert again[:3] == out[-3:]
    known = set(out)
    assert out + [state for state in again if state not in known] == list(cam_states(loaded.scene))
    assert second.done and second.sent == second.ticks + 1


def test_a_speed_no_cam_can_have_is_refused(program):
    """With the limits; so slow a tick of it would hold more samples than a message may."""
    limits = r"allowed: 0, or 0\.0126 to 3141\.59 rad/s \(0\.12 to 30000 rpm\)"
    for speed in (-1.0, 1e6, 1e-3, float("nan")):
        with pytest.raises(RefusedError, match=limits):
            program.command(speed)


@pytest.mark.parametrize("sent", [0, 5])
def test_what_a_hand_asked_for_outlives_the_drive(loaded, program, sent, tmp_path):
    """Stopped, or reset and stopped, a successor stands as well: nothing starts by itself."""
    memories = [(follow(program, 1), program.memory)[1] for _ in range(sent)]
    for ask in (lambda: program.run(False), program.reset, program.halt):
        ask()
        Handover(str(tmp_path), "orders").keep(
            OperatorCommands(program.table.place, program.running, 222.0, "20x")
        )
        orders = Handover(str(tmp_path), "orders").newest()
        assert (orders.rpm, orders.pacing) == (222.0, "20x")
        second = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True, memories, orders)
        second.laws.update(loaded.laws)
        assert len(follow(second, 20)) == sent  # what its predecessor had said
        assert second.table.place == program.table.place
    orders = OperatorCommands(SetpointSchedule(loaded.scene).place, False, 0.0, "free")
    if sent:  # orders that states came after are obeyed already
        second = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True, memories, orders)
        assert second.running and second.table.place == memories[-1].place


def test_an_emergency_stop_holds_before_the_first_state_and_while_states_are_said_again(loaded):
    """Whenever it comes, only a reset lets the cam turn."""
    first = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True)
    first.laws.update(loaded.laws)
    assert first.halt() is None and first.halted
    first.run(True)
    assert follow(first, 3) == []
    first.reset()
    first.run(True)
    memories = [(follow(first, 1), first.memory)[1] for _ in range(3)]
    second = DriveProgram(loaded.scene, ["all"], 4, lambda cam: True, memories)
    second.laws.update(loaded.laws)
    assert second.halt() is None and second.halted
    second.run(True)
    said = follow(second, 20)
    assert said[:3] == [memory.state for memory in memories]
    assert [state.speed for state in said[3:]] == [0.0]
    assert said[3].cam == said[2].cam and not second.done


def test_a_cam_that_the_law_server_does_not_have_is_let_go(loaded):
    """Who claims that it is mounted cannot hold the drive for ever."""
    asked = []
    program = DriveProgram(loaded.scene, ["all"], 4, lambda cam: asked.append(cam) is None)
    program.laws.update(loaded.laws)
    assert len(follow(program, 2)) == 2
    program.mounted(asked[0])
    program.mounted("nonsense")
    assert follow(program, 5) == []
    assert asked[-1] == "nonsense"
    program.refused("nonsense")
    assert program.take(10.0).cam == loaded.scene.cams[0]


def test_a_state_waits_for_its_time(program):
    """Paced, the second state goes out when its rig time has come."""
    program.pacing.set("real_time")
    first = program.take(50.0)
    program.credit.acknowledge("all", first.time_ns)
    assert program.take(50.1) is None
    assert program.wait(50.1) == pytest.approx(0.2)
    assert program.take(50.3).time_ns == 300_000_000


def test_the_law_servers_word_is_no_cam_by_hand_however_late(loaded):
    """A cam of few ticks is sent before the law server's word of it comes; the next cam turns."""
    scene = loaded.scene
    first = [state for state in cam_states(scene) if state.cam == scene.cams[0]]
    program = DriveProgram(scene, ["all"], 2 * len(first), lambda cam: True)
    for law in loaded.laws.values():
        program.add_law(law)
    sent = [program.take(float(i)) for i in range(len(first))]
    assert sent == first
    program.credit.acknowledge("all", first[-1].time_ns)
    assert program.take(100.0).cam == scene.cams[1]  # asked for as well by now
    for cam in scene.cams:
        program.mounted(cam)
    assert program.table.state.cam == scene.cams[1]
    program.mounted("cycloidal")
    assert program.table.state.cam == "cycloidal"
    program.mounted(scene.cams[1])
    assert program.table.state.cam == scene.cams[1]


def test_an_answer_told_twice_is_no_news():
    """Else a consumer that only repeats itself would look alive for ever."""
    credit = FlowControl(["recorder"], 4)
    for stamp in (0, 10, 20):
        credit.sent(stamp)
    assert credit.acknowledge("recorder", 10)
    assert not credit.acknowledge("recorder", 10)
    assert not credit.acknowledge("recorder", 0)
    assert credit.acknowledge("recorder", 20)
