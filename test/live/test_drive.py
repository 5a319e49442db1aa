"""The drive's program: nothing goes out before every consumer is ready for it."""

import itertools
import random

import pytest

from cam_rig.errors import RefusedError
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.live.drive import DriveProgram, OperatorCommands
from cam_rig.live.setpoints import SetpointSchedule
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states


@pytest.fixture
def loaded():
    return open_scene(config_root() / "scenes" / "quick.yaml")


def follow(program, states):
    """Answer as the other nodes do; returns the states that went out."""
    out = []
    for now in range(states):
        state = program.take(float(now))
        if state is not None:
            out.append(state)
            program.flow.acknowledge("all", state.time_ns)
    return out


def test_the_whole_scene_goes_out_once_and_in_order(loaded):
    """Every state of the scene, with one request for each cam."""
    asked = []

    def mount(cam):
        asked.append(cam)
        program.laws[cam] = loaded.laws[cam]
        return True

    program = DriveProgram(loaded.scene, ["all"], mount)
    out = follow(program, 100)
    assert program.done
    assert asked == loaded.scene.cams
    assert len(out) == program.ticks + 1
    assert all(a.time_ns < b.time_ns for a, b in itertools.pairwise(out))


def test_nothing_turns_before_its_law_is_known(loaded):
    """A cam without a published law is waited for, by name."""
    program = DriveProgram(loaded.scene, ["all"], lambda cam: True)
    assert program.take(0.0) is None
    assert program.waits_for() == ["law_server"]
    assert not program.done


@pytest.fixture
def program(loaded):
    made = DriveProgram(loaded.scene, ["all"], lambda cam: True)
    made.laws.update(loaded.laws)
    return made


def test_an_unanswered_request_for_a_cam_is_made_again(loaded):
    """The law server may have been killed with it; once a second, not more often."""
    asked = []
    program = DriveProgram(loaded.scene, ["all"], lambda cam: asked.append(cam) is None)
    for now in (0.0, 0.1, 0.9, 1.1, 1.2, 2.5):
        assert program.take(now) is None
    assert asked == ["tm21"] * 3


def test_a_stopped_drive_sends_nothing_and_goes_on(loaded, program):
    """Stop and start change no state."""
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
    program.flow.acknowledge("all", standing.time_ns)
    program.run(True)
    assert follow(program, 5) == []
    assert not program.done
    program.reset()
    assert follow(program, 5) == []
    program.run(True)
    again = follow(program, 100)
    assert again[0].time_ns > standing.time_ns and again[0].angle == standing.angle
    assert program.done


def test_a_successor_continues_without_a_gap(loaded):
    """It sends its predecessor's last states again, then goes on: the same states in all."""
    first = DriveProgram(loaded.scene, ["all"], lambda cam: True)
    first.laws.update(loaded.laws)
    out, checkpoints = [], []
    for _ in range(7):
        out += follow(first, 1)
        checkpoints.append(first.checkpoint)
    second = DriveProgram(loaded.scene, ["all"], lambda cam: True, checkpoints[-3:])
    assert second.take(0.0) is None  # no law yet: nothing to send
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
def test_operator_commands_outlive_the_drive(loaded, program, sent, tmp_path):
    """Stopped, or reset and stopped, a successor stands as well: nothing starts by itself."""
    checkpoints = [(follow(program, 1), program.checkpoint)[1] for _ in range(sent)]
    for ask in (lambda: program.run(False), program.reset, program.halt):
        ask()
        Checkpoint(str(tmp_path), "commands").save(
            OperatorCommands(program.schedule.state, program.running, "20x")
        )
        commands = Checkpoint(str(tmp_path), "commands").newest()
        assert commands.pacing == "20x"
        second = DriveProgram(loaded.scene, ["all"], lambda cam: True, checkpoints, commands)
        second.laws.update(loaded.laws)
        assert len(follow(second, 20)) == sent  # those of its predecessor
        assert second.schedule.state == program.schedule.state
    commands = OperatorCommands(SetpointSchedule(loaded.scene).state, False, "free")
    if sent:  # commands that states came after are obeyed already
        second = DriveProgram(loaded.scene, ["all"], lambda cam: True, checkpoints, commands)
        assert second.running and second.schedule.state == checkpoints[-1].schedule


def test_an_emergency_stop_holds_before_the_first_state_and_while_states_are_resent(loaded):
    """Whenever it comes, only a reset lets the cam turn."""
    first = DriveProgram(loaded.scene, ["all"], lambda cam: True)
    first.laws.update(loaded.laws)
    assert first.halt() is None and first.halted
    first.run(True)
    assert follow(first, 3) == []
    first.reset()
    first.run(True)
    checkpoints = [(follow(first, 1), first.checkpoint)[1] for _ in range(3)]
    second = DriveProgram(loaded.scene, ["all"], lambda cam: True, checkpoints)
    second.laws.update(loaded.laws)
    assert second.halt() is None and second.halted
    second.run(True)
    sent = follow(second, 20)
    assert sent[:3] == [checkpoint.state for checkpoint in checkpoints]
    assert [state.speed for state in sent[3:]] == [0.0]
    assert sent[3].cam == sent[2].cam and not second.done


def test_a_cam_that_the_law_server_refuses_is_dropped(loaded):
    """A wrong report that it is mounted cannot hold the drive for ever."""
    asked = []
    program = DriveProgram(loaded.scene, ["all"], lambda cam: asked.append(cam) is None)
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
    program.flow.acknowledge("all", first.time_ns)
    assert program.take(50.1) is None
    assert program.wait(50.1) == pytest.approx(0.2)
    assert program.take(50.3).time_ns == 300_000_000


def test_rig_time_goes_on_between_two_states(program):
    """At half real time 5 ms of it in 10 ms, up to the next state and never past it, stopped or
    not; a free run has none, nor has a cam that stands."""
    assert program.time_ns(50.0) is None
    program.pacing.set("0.5x")
    first = program.take(50.0)
    program.flow.acknowledge("all", first.time_ns)
    assert [program.time_ns(50.0 + t) for t in (0.0, 0.01, 0.3)] == [0, 5_000_000, 150_000_000]
    assert program.time_ns(60.0) == 299_999_999
    program.run(False)  # the tick that turns is finished
    assert program.time_ns(60.0) == 299_999_999
    program.run(True)
    assert program.take(70.0).time_ns == 300_000_000
    assert program.time_ns(70.2) == 400_000_000
    assert program.halt() is not None
    assert program.time_ns(70.3) is None
    program.reset()
    assert program.time_ns(70.4) is None
    program.pacing.set("free")
    assert program.time_ns(70.5) is None


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(20))
def test_rig_time_is_never_past_the_next_state(program, seed):
    """Under any commands, at any time: what is told between two states comes before the second."""
    chance, told, states = random.Random(seed), -1, []
    program.pacing.set("real_time")
    commands = (
        lambda: program.command(chance.choice([0.0, 5.0, 20.0, 40.0])),
        lambda: program.run(chance.random() < 0.7),
        lambda: program.pacing.set(chance.choice(["real_time", "0.3x", "7x"])),
        lambda: (program.halt(), program.reset(), program.run(True)),
    )
    now = 0.0
    for _ in range(3000):
        now += chance.uniform(0.0, 0.02)
        if chance.random() < 0.01:
            chance.choice(commands)()
        if (state := program.take(now)) is not None:
            states.append(state)
            program.flow.acknowledge("all", state.time_ns)
            assert told < state.time_ns
        if (between := program.time_ns(now)) is not None:
            assert states[-1].time_ns <= between < program.schedule.next_state.time_ns
            told = max(told, between)
    assert len(states) > 5


def test_a_late_report_of_the_law_server_is_not_an_override(loaded):
    """A cam of few ticks is sent before it is reported as mounted; the next cam turns."""
    scene = loaded.scene
    first = [state for state in cam_states(scene) if state.cam == scene.cams[0]]
    program = DriveProgram(scene, ["all"], lambda cam: True)
    for law in loaded.laws.values():
        program.add_law(law)
    assert follow(program, len(first)) == first
    assert program.take(100.0).cam == scene.cams[1]  # asked for as well by now
    for cam in scene.cams:
        program.mounted(cam)
    assert program.schedule.next_state.cam == scene.cams[1]
    program.mounted("cycloidal")
    assert program.schedule.next_state.cam == "cycloidal"
    program.mounted(scene.cams[1])
    assert program.schedule.next_state.cam == scene.cams[1]
