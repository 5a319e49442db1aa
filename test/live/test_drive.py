"""The drive: which state comes next under commands, and when it goes out."""

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.errors import RefusedError
from cam_rig.live.drive import STANDSTILL_NS, DriveProgram, SetpointSchedule
from cam_rig.live.state_validation import StateValidator, speeds
from cam_rig.schema.load import config_root
from cam_rig.schema.quantity import Quantity
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import RPM

LOADED = open_scene(config_root() / "scenes" / "quick.yaml")
SCENE = LOADED.scene
PLAN = list(cam_states(SCENE))
RAMP = Quantity.model_validate({"assumed": 0.7, "unit": "s", "source": "a test"})
PROGRAM = SCENE.program.model_copy(update={"ramp": RAMP, "ticks_per_turn": 2})
#: The same from rest, each speed reached along a ramp.
RAMPED = SCENE.model_copy(update={"program": PROGRAM})


def run_out(schedule, at=()):
    """All states to come; ``at`` maps the number of states done to a command."""
    commands, out = dict(at), []
    for number in itertools.count():
        commands.get(number, lambda: None)()
        if (state := schedule.next_state) is None:
            return out
        out.append(state)
        schedule.advance()


def test_without_a_command_it_is_the_scene():
    """Bit for bit, so that a live run is the simulated one."""
    for scene in (SCENE, RAMPED):
        assert run_out(SetpointSchedule(scene)) == list(cam_states(scene))


def test_an_emergency_stop_on_a_ramp_stands_where_the_tick_ends():
    """The ramp is broken off, its first speed held; or, at rest, nothing turns."""
    for done in range(1, len(list(cam_states(RAMPED)))):
        schedule, validator = SetpointSchedule(RAMPED), StateValidator.of(RAMPED)
        for _ in range(done):
            validator.validate(schedule.next_state)
            schedule.advance()
        if (standing := schedule.halt()) is not None:
            validator.validate(standing)
            schedule.rewind()
            assert schedule.next_state.angle == standing.angle


def test_a_commanded_speed_holds_from_the_next_state_on():
    """Each tick turns by its planned angle at the commanded speed; 0 gives the scene back."""
    schedule = SetpointSchedule(SCENE)
    commands = {3: lambda: schedule.command(240 * RPM), 6: lambda: schedule.command(None)}
    out = run_out(schedule, commands)
    assert [s.speed for s in out[3:6]] == [240 * RPM] * 3
    assert [s.speed for s in out[6:]] == [s.speed for s in PLAN[6:]]
    assert len(out) == len(PLAN)
    assert out[4].time_ns - out[3].time_ns == 250_000_000  # a turn at 240 rpm


def test_an_operators_cam_stays_until_the_scenes_next():
    """θ goes on under the other cam."""
    schedule = SetpointSchedule(SCENE)
    out = run_out(schedule, {2: lambda: schedule.mount("cycloidal")})
    assert [s.cam for s in out[:9]] == ["tm21"] * 2 + ["cycloidal"] * 6 + ["bezier15"]
    assert [s.angle for s in out] == [s.angle for s in PLAN]


COMMANDS = st.lists(
    st.tuples(
        st.integers(0, 16),
        st.one_of(
            st.floats(speeds(SCENE)[0], speeds(RAMPED)[1]).map(lambda speed: ("command", speed)),
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
    """Whatever is commanded when, the validator admits all states of the drive."""
    schedule = SetpointSchedule(scene)
    at = {n: lambda call=call: getattr(schedule, call[0])(*call[1:]) for n, call in commands}
    validator = StateValidator.of(scene)
    out = run_out(schedule, at)
    for state in out:
        validator.validate(state)
    assert all(b.time_ns > a.time_ns for a, b in itertools.pairwise(out))


# When a state goes out.


def drive(mount=lambda cam: True, laws=LOADED.laws):
    made = DriveProgram(SCENE, ["all"], mount)
    made.laws.update(laws)
    return made


@pytest.fixture
def program():
    return drive()


def follow(program, states):
    """Answer as the other nodes do; returns the states that went out."""
    out = []
    for now in range(states):
        state = program.take(float(now))
        if state is not None:
            out.append(state)
            program.flow.acknowledge("all", state.time_ns)
    return out


def test_the_whole_scene_goes_out_once_and_in_order():
    """Every state of the scene, with one request for each cam, once its law is known."""
    asked = []

    def mount(cam):
        asked.append(cam)
        program.laws[cam] = LOADED.laws[cam]
        return True

    program = drive(mount, laws={})
    assert follow(program, 100) == PLAN
    assert program.done
    assert asked == SCENE.cams


def test_nothing_turns_before_its_law_is_known():
    """A cam without a published law is waited for, by name; its request is made again. The request
    may come before the law server has discovered the drive; once a second, not more often."""
    asked = []
    program = drive(lambda cam: asked.append(cam) is None, laws={})
    for now in (0.0, 0.1, 0.9, 1.1, 1.2, 2.5):
        assert program.take(now) is None
    assert asked == ["tm21"] * 3
    assert program.flow.behind() == [] and not program.done


def test_a_stopped_drive_sends_nothing_and_goes_on(program):
    out = follow(program, 5)
    program.run(False)
    assert follow(program, 5) == []
    program.run(True)
    out += follow(program, 100)
    assert out == PLAN
    assert program.done


def test_an_emergency_stop_stands_where_the_tick_ends_and_waits_for_a_reset(program):
    """Start alone does nothing; after a second the scene begins again from there."""
    follow(program, 5)
    due = program.schedule.next_state
    standing = program.halt()
    assert (standing.time_ns, standing.angle, standing.speed) == (due.time_ns, due.angle, 0.0)
    assert program.schedule.next_state is None and program.halt() is None
    program.flow.acknowledge("all", standing.time_ns)
    program.run(True)
    assert follow(program, 5) == [] and not program.done
    program.reset()
    assert follow(program, 5) == []
    program.run(True)
    again = follow(program, 100)
    assert (again[0].time_ns, again[0].angle) == (due.time_ns + STANDSTILL_NS, due.angle)
    assert again[0].cam == "tm21" and again[0].speed == pytest.approx(200 * RPM)
    assert len(again) == len(PLAN) and program.done


def test_a_speed_no_cam_can_have_is_refused(program):
    """With the limits; so slow a tick of it would hold more samples than a message may."""
    limits = r"allowed: 0, or 0\.0126 to 3141\.59 rad/s \(0\.12 to 30000 rpm\)"
    for speed in (-1.0, 1e6, 1e-3, float("nan")):
        with pytest.raises(RefusedError, match=limits):
            program.command(speed)


def test_an_emergency_stop_holds_before_the_first_state():
    """Only a reset lets the cam turn."""
    program = drive()
    assert program.halt() is None and program.halted
    program.run(True)
    assert follow(program, 3) == []
    program.reset()
    program.run(True)
    assert follow(program, 3) == PLAN[:3]


def test_a_cam_that_the_law_server_refuses_is_dropped():
    """A wrong report that it is mounted cannot hold the drive for ever."""
    asked = []
    program = drive(lambda cam: asked.append(cam) is None)
    assert len(follow(program, 2)) == 2
    program.mounted(asked[0])
    program.mounted("nonsense")
    assert follow(program, 5) == []
    assert asked[-1] == "nonsense"
    program.refused("nonsense")
    assert program.take(10.0).cam == SCENE.cams[0]


def test_after_a_reset_the_scene_s_cam_is_mounted_again():
    """Of a cam that an operator had mounted the law server is told, so that nobody shows it."""
    asked = []
    program = drive(lambda cam: asked.append(cam) is None)
    assert len(follow(program, 2)) == 2
    program.mounted(SCENE.cams[0])
    program.mounted(SCENE.cams[1])
    assert [state.cam for state in follow(program, 2)] == [SCENE.cams[1]] * 2
    program.reset()
    program.run(True)
    before = len(asked)
    assert follow(program, 1)[0].cam == SCENE.cams[0]
    assert asked[before:] == [SCENE.cams[0]]
    program.mounted(SCENE.cams[0])
    assert not program.schedule.overrides_cam
    program.reset()
    program.run(True)
    assert follow(program, 1)[0].cam == SCENE.cams[0]
    assert len(asked) == before + 1


def test_rig_time_goes_on_between_two_states(program):
    """At half real time 5 ms of it in 10 ms, up to the next state, which waits for its time, and
    never past it, stopped or not; a free run has none, nor has a cam that stands."""
    assert program.time_ns(50.0) is None
    program.pacing.set("0.5x")
    first = program.take(50.0)
    program.flow.acknowledge("all", first.time_ns)
    assert [program.time_ns(50.0 + t) for t in (0.0, 0.01, 0.3)] == [0, 5_000_000, 150_000_000]
    assert program.take(50.1) is None and program.wait(50.1) == pytest.approx(0.5)
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


@pytest.mark.variants(3)
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


def test_a_late_report_of_the_law_server_is_not_an_override():
    """A cam of few ticks is sent before it is reported as mounted; the next cam turns."""
    first, program = [state for state in PLAN if state.cam == SCENE.cams[0]], drive()
    assert follow(program, len(first)) == first
    assert program.take(100.0).cam == SCENE.cams[1]  # asked for as well by now
    for cam in SCENE.cams:
        program.mounted(cam)
    assert program.schedule.next_state.cam == SCENE.cams[1]
    program.mounted("cycloidal")
    assert program.schedule.next_state.cam == "cycloidal"
    program.mounted(SCENE.cams[1])
    assert program.schedule.next_state.cam == SCENE.cams[1]
