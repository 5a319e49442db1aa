"""The setpoint schedule under commands: rig time and θ continue without a jump."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.live.setpoints import STANDSTILL_NS, SetpointSchedule
from cam_rig.live.state_validation import Admission, StateValidator, speeds
from cam_rig.schema.load import config_root
from cam_rig.schema.quantity import Quantity
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import RPM

SCENE = open_scene(config_root() / "scenes" / "quick.yaml").scene
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


@pytest.mark.parametrize("scene", [SCENE, RAMPED], ids=["steps", "ramps"])
def test_without_a_command_it_is_the_scene(scene):
    """Bit for bit, so that a live run is the simulated one."""
    assert run_out(SetpointSchedule(scene)) == list(cam_states(scene))


def test_an_emergency_stop_on_a_ramp_stands_where_the_tick_ends():
    """The ramp is broken off, its first speed held; or, at rest, nothing turns."""
    for done in range(1, len(list(cam_states(RAMPED)))):
        schedule, validator = SetpointSchedule(RAMPED), StateValidator.of(RAMPED)
        for _ in range(done):
            validator.admit(schedule.next_state)
            schedule.advance()
        if (standing := schedule.halt()) is not None:
            validator.admit(standing)
            schedule.rewind()
            assert schedule.next_state.angle == standing.angle


def test_a_commanded_speed_holds_from_the_next_state_on():
    """Each tick turns by its planned angle at the commanded speed; 0 gives the scene back."""
    schedule = SetpointSchedule(SCENE)
    out = run_out(
        schedule, {3: lambda: schedule.command(240 * RPM), 6: lambda: schedule.command(None)}
    )
    plan = list(cam_states(SCENE))
    assert [s.speed for s in out[3:6]] == [240 * RPM] * 3
    assert [s.speed for s in out[6:]] == [s.speed for s in plan[6:]]
    assert len(out) == len(plan)
    assert out[4].time_ns - out[3].time_ns == 250_000_000  # a turn at 240 rpm


def test_an_operators_cam_stays_until_the_scenes_next():
    """θ goes on under the other cam."""
    schedule = SetpointSchedule(SCENE)
    out = run_out(schedule, {2: lambda: schedule.mount("cycloidal")})
    assert [s.cam for s in out[:9]] == ["tm21"] * 2 + ["cycloidal"] * 6 + ["bezier15"]
    assert [s.angle for s in out] == [s.angle for s in cam_states(SCENE)]


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
    admitted = [validator.admit(state) for state in out]
    assert admitted[0] is Admission.NEW_SEQUENCE and Admission.SEEN not in admitted
    for before, state, admission in zip(out, out[1:], admitted[1:], strict=False):
        stood = before.speed == 0.0 and before.angle == state.angle
        assert admission is Admission.NEXT or stood
    assert all(b.time_ns > a.time_ns for a, b in itertools.pairwise(out))


def test_a_halt_stands_where_the_tick_ends_and_a_rewind_begins_again():
    """The cam stops with its last tick; after a second it runs the scene from there."""
    schedule = SetpointSchedule(SCENE)
    for _ in range(5):
        schedule.advance()
    due = schedule.next_state
    halted = schedule.halt()
    assert (halted.time_ns, halted.angle, halted.speed) == (due.time_ns, due.angle, 0.0)
    assert schedule.next_state is None and schedule.halt() is None
    schedule.rewind()
    again = schedule.next_state
    assert (again.time_ns, again.angle) == (due.time_ns + STANDSTILL_NS, due.angle)
    assert again.cam == "tm21" and again.speed == pytest.approx(200 * RPM)
    assert len(run_out(schedule)) == len(list(cam_states(SCENE)))


def test_a_successor_continues_the_schedule():
    """The schedule's state alone determines what comes next."""
    schedule = SetpointSchedule(SCENE)
    schedule.command(222 * RPM)
    for _ in range(5):
        schedule.advance()
    schedule.mount("poly345")
    rest = SetpointSchedule(SCENE, schedule.state)
    assert run_out(rest) == run_out(schedule)
