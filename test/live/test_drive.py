"""Tests of the drive: sequence of cam states under commands, and their sending.

A cam state has time, cam angle and speed. A tick is the interval between two cam states.
"""

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.errors import RefusedError
from cam_rig.live.drive import STANDSTILL_NS, DriveProgram, SetpointSchedule
from cam_rig.live.state_validation import StateValidator, speed_limits
from cam_rig.schema.load import config_root
from cam_rig.schema.quantity import Quantity
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import RPM

LOADED = open_scene(config_root() / "scenes" / "quick.yaml")
SCENE = LOADED.scene
PLAN = list(cam_states(SCENE))
RAMP = Quantity.model_validate({"assumed": 0.7, "unit": "s", "source": "a test"})
PROGRAM = SCENE.schedule.model_copy(update={"ramp": RAMP, "ticks_per_turn": 2})
#: The test scene from rest, with a speed ramp to each speed.
RAMPED = SCENE.model_copy(update={"schedule": PROGRAM})


def run_out(schedule, commands=()):
    """Send all remaining cam states of a schedule, and return them.

    `commands` maps a number of sent states to a function that is called at that moment.
    """
    commands, out = dict(commands), []
    for number in itertools.count():
        commands.get(number, lambda: None)()
        if (state := schedule.next_state) is None:
            return out
        out.append(state)
        schedule.advance()


def test_states_without_a_command_equal_those_of_the_scene():
    """Without a command the drive sends the cam states of the scene, bit for bit.

    A live run therefore equals the simulated run.
    """
    for scene in (SCENE, RAMPED):
        assert run_out(SetpointSchedule(scene)) == list(cam_states(scene))


def test_an_emergency_stop_on_a_ramp_stops_at_the_end_of_the_tick():
    """An emergency stop on a speed ramp is a state of speed 0 at the end of the tick.

    A tick is the interval between two cam states. After a reset the scene continues at that angle.
    At rest no state is sent.
    """
    for done in range(1, len(list(cam_states(RAMPED)))):
        schedule, validator = SetpointSchedule(RAMPED), StateValidator.of(RAMPED)
        for _ in range(done):
            validator.validate(schedule.next_state)
            schedule.advance()
        if (stopped := schedule.halt()) is not None:
            validator.validate(stopped)
            schedule.rewind()
            assert schedule.next_state.angle == stopped.angle


def test_a_commanded_speed_applies_from_the_next_state_on():
    """A commanded speed applies from the next cam state on until it is taken back.

    Each tick (interval between two cam states) still turns by its planned angle.
    """
    schedule = SetpointSchedule(SCENE)
    commands = {3: lambda: schedule.command(240 * RPM), 6: lambda: schedule.command(None)}
    out = run_out(schedule, commands)
    assert [s.speed for s in out[3:6]] == [240 * RPM] * 3
    assert [s.speed for s in out[6:]] == [s.speed for s in PLAN[6:]]
    assert len(out) == len(PLAN)
    assert out[4].time_ns - out[3].time_ns == 250_000_000  # one turn at 240 rpm


def test_an_operators_cam_stays_until_the_scene_mounts_its_next_cam():
    """A cam that an operator mounts turns until the scene mounts its next cam.

    The angles of the cam states are those of the scene.
    """
    schedule = SetpointSchedule(SCENE)
    out = run_out(schedule, {2: lambda: schedule.mount("cycloidal")})
    assert [s.cam for s in out[:9]] == ["tm21"] * 2 + ["cycloidal"] * 6 + ["bezier15"]
    assert [s.angle for s in out] == [s.angle for s in PLAN]


COMMANDS = st.lists(
    st.tuples(
        st.integers(0, 16),
        st.one_of(
            st.floats(speed_limits(SCENE)[0], speed_limits(RAMPED)[1]).map(
                lambda speed: ("command", speed)
            ),
            st.sampled_from(["tm21", "poly345", "bezier15"]).map(lambda cam: ("mount", cam)),
            st.just(("command", None)),
            st.just(("rewind",)),
        ),
    ),
    max_size=6,
    unique_by=lambda item: item[0],
)


@given(COMMANDS)
@pytest.mark.parametrize("scene", [SCENE, RAMPED], ids=["steps", "ramps"])
def test_no_command_makes_theta_or_time_jump(scene, commands):
    """Under random commands at any time the cam states are valid.

    A valid state continues angle and time of the previous state without a jump, and its time is
    later.
    """
    schedule = SetpointSchedule(scene)
    calls = {n: lambda call=call: getattr(schedule, call[0])(*call[1:]) for n, call in commands}
    validator = StateValidator.of(scene)
    out = run_out(schedule, calls)
    for state in out:
        validator.validate(state)
    assert all(b.time_ns > a.time_ns for a, b in itertools.pairwise(out))


# Conditions for sending a state.


def drive(mount=lambda cam: True, laws=LOADED.laws):
    program = DriveProgram(SCENE, ["all"], mount)
    program.laws.update(laws)
    return program


@pytest.fixture
def program():
    return drive()


def follow(program, states):
    """Take and acknowledge up to `states` cam states as the other nodes do.

    The list of the sent states is returned.
    """
    out = []
    for now in range(states):
        state = program.take(float(now))
        if state is not None:
            out.append(state)
            program.flow.acknowledge("all", state.time_ns)
    return out


def test_all_states_of_the_scene_are_sent_once_and_in_order():
    """The drive requests each cam of the scene once, and sends each state in order.

    No state is sent twice.
    """
    requested = []

    def mount(cam):
        requested.append(cam)
        program.laws[cam] = LOADED.laws[cam]
        return True

    program = drive(mount, laws={})
    assert follow(program, 100) == PLAN
    assert program.done
    assert requested == SCENE.cams


def test_no_state_is_sent_before_the_law_of_its_cam_is_known():
    """Without the law of its cam no cam state is sent, and the cam is requested again.

    The request is repeated once per second, because the law server may not have received it.
    """
    requested = []
    program = drive(lambda cam: requested.append(cam) is None, laws={})
    for now in (0.0, 0.1, 0.9, 1.1, 1.2, 2.5):
        assert program.take(now) is None
    assert requested == ["tm21"] * 3
    assert program.flow.behind() == [] and not program.done


@pytest.mark.parametrize("steps", [[1, 2, 3, 100], [7, 1, 100]])
def test_a_drive_that_is_stepped_sends_the_states_of_the_scene(program, steps):
    """A drive that is stepped by some ticks sends these ticks, and then stops.

    A tick is the interval between two cam states. Together the steps give the states of the scene.
    The first step also sends the state at which the first tick starts.
    """
    program.run(False)
    assert program.at_start
    out = []
    for count in steps:
        program.run_ticks(count)
        states = follow(program, 200)
        out += states
        if not program.done:
            assert not program.running and len(states) == count + (len(out) == len(states))
    assert out == PLAN and not program.at_start


def test_a_command_ends_a_step(program):
    """Start and reset end a request of steps before all its ticks are sent.

    Start continues the run without stopping. Reset stops it and returns to the first state.
    """
    program.run(False)
    program.run_ticks(3)
    assert len(follow(program, 2)) == 2
    program.run(True)
    assert len(follow(program, 5)) == 5
    program.reset()
    assert program.at_start and not program.running


def test_a_stopped_drive_sends_no_state_and_can_be_resumed(program):
    """A stopped drive sends no cam state, and later sends the remaining states."""
    out = follow(program, 5)
    program.run(False)
    assert follow(program, 5) == []
    program.run(True)
    out += follow(program, 100)
    assert out == PLAN
    assert program.done


def test_an_emergency_stop_stops_at_the_end_of_the_tick_until_a_reset(program):
    """An emergency stop stops the cam at the end of the tick, until a reset.

    A tick is the interval between two cam states. A start without a reset has no effect. After the
    reset the scene restarts one second of rig time later.
    """
    follow(program, 5)
    due = program.schedule.next_state
    stopped = program.halt()
    assert (stopped.time_ns, stopped.angle, stopped.speed) == (due.time_ns, due.angle, 0.0)
    assert program.schedule.next_state is None and program.halt() is None
    program.flow.acknowledge("all", stopped.time_ns)
    program.run(True)
    assert follow(program, 5) == [] and not program.done
    program.reset()
    assert follow(program, 5) == []
    program.run(True)
    again = follow(program, 100)
    assert (again[0].time_ns, again[0].angle) == (due.time_ns + STANDSTILL_NS, due.angle)
    assert again[0].cam == "tm21" and again[0].speed == pytest.approx(200 * RPM)
    assert len(again) == len(PLAN) and program.done


def test_a_speed_outside_the_limits_is_rejected(program):
    """A commanded speed outside the limits raises RefusedError with both limits.

    At lower speeds a tick (interval between two cam states) has more samples than a message may
    have.
    """
    limits = r"must be 0, or between 0\.0126 and 3141\.59 rad/s \(0\.12 and 30000 rpm\)"
    for speed in (-1.0, 1e6, 1e-3, float("nan")):
        with pytest.raises(RefusedError, match=limits):
            program.command(speed)


def test_an_emergency_stop_before_the_first_state_lasts_until_a_reset():
    """After an emergency stop before the first state the cam needs reset and start.

    A start without a reset has no effect.
    """
    program = drive()
    assert program.halt() is None and program.halted
    program.run(True)
    assert follow(program, 3) == []
    program.reset()
    program.run(True)
    assert follow(program, 3) == PLAN[:3]


def test_an_override_with_a_cam_that_the_law_server_refuses_ends():
    """If the law server refuses an operator's cam, the cam of the scene turns.

    A wrong report of a mounted cam thus does not stop the drive.
    """
    requested = []
    program = drive(lambda cam: requested.append(cam) is None)
    assert len(follow(program, 2)) == 2
    program.on_mounted(requested[0])
    program.on_mounted("nonsense")
    assert follow(program, 5) == []
    assert requested[-1] == "nonsense"
    program.on_refused("nonsense")
    assert program.take(10.0).cam == SCENE.cams[0]


def test_after_a_reset_the_cam_of_the_scene_is_requested_again():
    """After a reset the drive requests the cam of the scene from the law server, once.

    Otherwise a cam that an operator had mounted would stay mounted and displayed.
    """
    requested = []
    program = drive(lambda cam: requested.append(cam) is None)
    assert len(follow(program, 2)) == 2
    program.on_mounted(SCENE.cams[0])
    program.on_mounted(SCENE.cams[1])
    assert [state.cam for state in follow(program, 2)] == [SCENE.cams[1]] * 2
    program.reset()
    program.run(True)
    before = len(requested)
    assert follow(program, 1)[0].cam == SCENE.cams[0]
    assert requested[before:] == [SCENE.cams[0]]
    program.on_mounted(SCENE.cams[0])
    assert not program.schedule.overrides_cam
    program.reset()
    program.run(True)
    assert follow(program, 1)[0].cam == SCENE.cams[0]
    assert len(requested) == before + 1


def test_rig_time_advances_between_two_states(program):
    """In a paced run rig time advances with wall-clock time up to the next cam state.

    It stops just before the next state. In a free run, after an emergency stop and after a reset
    the drive reports no rig time between the states (None).
    """
    assert program.time_ns(50.0) is None
    program.pacing.set("0.5x")
    first = program.take(50.0)
    program.flow.acknowledge("all", first.time_ns)
    assert [program.time_ns(50.0 + t) for t in (0.0, 0.01, 0.3)] == [0, 5_000_000, 150_000_000]
    assert program.take(50.1) is None and program.wait(50.1) == pytest.approx(0.5)
    assert program.time_ns(60.0) == 299_999_999
    program.run(False)  # the current tick is completed
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


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(20))
def test_rig_time_is_never_past_the_next_state(program, seed):
    """Under random commands the rig time between two cam states is before the second."""
    chance, newest_ns, states = random.Random(seed), -1, []
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
            assert newest_ns < state.time_ns
        if (between := program.time_ns(now)) is not None:
            assert states[-1].time_ns <= between < program.schedule.next_state.time_ns
            newest_ns = max(newest_ns, between)
    assert len(states) > 5


def test_a_late_report_of_the_law_server_is_not_an_override():
    """A late report that the previous cam is mounted has no effect on the drive.

    Only the report of a cam that the drive has not requested counts as an operator's choice of cam.
    """
    first, program = [state for state in PLAN if state.cam == SCENE.cams[0]], drive()
    assert follow(program, len(first)) == first
    assert program.take(100.0).cam == SCENE.cams[1]  # it is requested by now
    for cam in SCENE.cams:
        program.on_mounted(cam)
    assert program.schedule.next_state.cam == SCENE.cams[1]
    program.on_mounted("cycloidal")
    assert program.schedule.next_state.cam == "cycloidal"
    program.on_mounted(SCENE.cams[1])
    assert program.schedule.next_state.cam == SCENE.cams[1]
