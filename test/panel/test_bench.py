"""The bench page without nodes: set-ups, live state, drawn data, and readings.

A set-up is the cam, model and follower of the rig. A reading is a sound level noted by the user.
"""

import base64
import csv
import math

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics.jump.any_follower import TWO_MASSES, describe_follower, follower_of
from cam_rig.errors import RefusedError
from cam_rig.messages.topics import HEARTBEAT, PACE
from cam_rig.panel.bench import drawing, live_state, runner
from cam_rig.panel.bench.drawing import Cams, LiveMotion
from cam_rig.panel.bench.live_state import LiveState, Meter, NotedReading, to_csv
from cam_rig.panel.bench.runner import Setup
from cam_rig.profile.outlines import follower_shape
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.units import NS, RPM, TURN

from ..conftest import CAM_NAMES
from .conftest import blocks_of

RIG = cam_rig.load_rig("paper_table2")
DEFAULT_SETUP = Setup.of(RIG, "poly345")
SPEED, TICKS = 300.0, 12

# -- set-ups


def test_a_set_up_is_written_as_a_scene(tmp_path):
    """A set-up is written as a scene file with its mass, preload, model and speed.

    All other numbers of the follower are those of the rig file.
    """
    runner.add_cam(cam_rig.load_cam("poly345"), tmp_path / "cams")
    for model in runner.available_models(RIG):
        changes = {"model": model, "added_mass": 0.5, "preload": 45, "rpm": 321.0}
        loaded = open_scene(DEFAULT_SETUP.with_changes(changes, RIG).write(tmp_path, RIG))
        follower = loaded.rig.follower
        assert follower.mass.si == pytest.approx(RIG.follower.mass.si + 0.5)
        assert follower.preload.si == 45.0
        assert follower.spring_stiffness == RIG.follower.spring_stiffness
        assert loaded.scene.model == model
        rpm = np.array(loaded.scene.schedule.speeds.si_list) * 30 / np.pi
        np.testing.assert_allclose(rpm, [321.0, runner.AXIS_RPM])


def test_the_bench_starts_with_the_follower_of_the_board():
    """The bench starts with two masses if the rig has a mass share, else with one.

    Only models whose parameters the rig has are offered.
    """
    for path in (config_root() / "rigs").glob("*.yaml"):
        rig = cam_rig.load_rig(path)
        model = Setup.of(rig, "poly345").model
        assert model in runner.available_models(rig)
        assert (model == "two_mass") == (describe_follower(follower_of(rig)) == TWO_MASSES)
    assert set(runner.available_models(RIG)) == set(runner.MODELS)
    assert not {"two_mass", "torsional"} & set(runner.available_models(cam_rig.load_rig("tm21")))


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", CAM_NAMES)
def test_every_cam_can_be_added_to_the_bench(name, tmp_path):
    """A cam that is added to the bench keeps every number of its law.

    A cam with a desmodromic follower (driven both ways) is not offered, because no model simulates
    it.
    """
    cam = cam_rig.load_cam(name)
    runner.add_cam(cam, tmp_path)
    added_law, law = (
        cam_rig.build_law(cam_rig.load_cam(tmp_path / f"{name}.yaml")),
        cam_rig.build_law(cam),
    )
    assert np.array_equal(law.breaks, added_law.breaks) and np.array_equal(
        law.ordinates, added_law.ordinates
    )
    # A desmodromic follower has no spring, and no model simulates it.
    assert (name in runner.cam_names(tmp_path)) is cam.follower.sprung


def test_an_invalid_set_up_is_refused():
    """An invalid value of a set-up is refused in one line that states the rule."""
    for changes, text in (
        ({"model": "soft"}, "model: is 'soft'; allowed on this rig"),
        ({"added_mass": -1}, "added mass: is -1 kg"),
        ({"added_mass": float("nan")}, "added mass: is nan"),
        ({"preload": -1}, "preload"),
        ({"spring_stiffness": 0}, "spring_stiffness"),
        ({"spring_stiffness": "stiff"}, "spring_stiffness: allowed"),
        ({"preload": [1]}, "preload: allowed"),
        ({"colour": "red"}, "colour: allowed"),
        ({"rpm": 1e5}, f"rpm: is 100000; allowed: 1 to {runner.MAX_RPM:g}"),
    ):
        with pytest.raises(RefusedError) as raised:
            DEFAULT_SETUP.with_changes(changes, RIG)
        assert text in str(raised.value) and "\n" not in str(raised.value)


# -- the displayed state follows the messages of the nodes, in any order


@pytest.fixture
def live():
    """State of a bench whose nodes run and whose cam is stopped."""
    state = LiveState(DEFAULT_SETUP)
    state.on_runner_event({"graph": "starting", "domain": 7})
    state.on_node_message(
        {"health": [f"cam_drive{HEARTBEAT}", 0, {"state": "stopped", "waits_for": ""}]}
    )
    state.on_node_message({"node": "microphone", "values": {"frequency_weighting": "A"}})
    state.on_node_message({"node": "microphone", "values": {"time_weighting": "F"}})
    return state


def turn(live, first, count):
    """Pass ticks of a constant speed to the state, each with its sound level.

    A tick is a time interval of the drive, here a twelfth of a turn.
    """
    for k in range(first, first + count):
        times = [round(n * 60.0 / SPEED / TICKS * NS) for n in (k, k + 1)]
        live.on_node_message(
            {"state": {"time_ns": times[0], "cam": "poly345", "rpm": SPEED, "angle": 0.0}}
        )
        live.on_node_message({"level": 80.0, "time_ns": times[1]})


def test_a_loss_of_contact_within_the_averaged_time_is_noted(live):
    """A reading has "contact lost" if contact was lost in its averaging time.

    This is so even if the last tick was in contact. A later reading has "in contact" again.
    """
    live.on_node_message({"health": ["follower", 0, {}]})
    turn(live, 0, 150)
    assert live.note().contact == "in contact"
    live.on_node_message({"health": ["follower", 1, {}]})
    live.on_node_message({"health": ["follower", 0, {}]})
    turn(live, 150, 20)
    assert live.note().contact == "contact lost"
    assert live.contact_losses == 1
    turn(live, 170, 90)
    assert live.note().contact == "in contact"
    assert [reading.weighting for reading in live.readings] == ["LAF"] * 3


def test_the_drive_has_its_reported_state(live):
    """The displayed state of the drive follows its messages and ticks.

    It is stopped, waiting or turning. After an emergency stop it is emergency until the drive
    reports another state.
    """
    assert (live.graph, live.drive) == ("running", "stopped")
    live.on_node_message(
        {"health": [f"cam_drive{HEARTBEAT}", 0, {"state": "waiting", "waits_for": "viewer"}]}
    )
    assert live.waits_for == "viewer"
    turn(live, 0, 1)
    assert (live.drive, live.waits_for) == ("turning", "")
    live.on_node_message({"health": ["cam_drive", 2, {}]})
    turn(live, 1, 1)
    assert live.drive == "emergency"
    live.on_node_message({"health": ["cam_drive", 0, {}]})
    assert live.drive == "turning"
    live.on_node_message({"health": [PACE, 1, {}]})
    assert live.is_late
    live.on_node_message({"health": [PACE, 0, {}]})
    assert not live.is_late


def test_ticks_in_flight_after_a_stop_do_not_count_as_turning(live):
    """After a stop, up to four ticks that still arrive do not display "turning".

    More ticks mean that another program has started the drive, so "turning" is displayed.
    """
    turn(live, 0, 150)
    live.on_service("stop")
    turn(live, 150, 4)
    assert (live.drive, live.page_data()["level"]) == ("stopped", None)
    with pytest.raises(RefusedError, match="the cam is stopped"):
        live.note()
    turn(live, 154, 2)
    assert live.drive == "turning"


def test_a_new_set_up_or_weighting_clears_the_meter_and_keeps_readings(live):
    """A new weighting or run clears the displayed level, but not the noted readings.

    The next run keeps the cam, the speed and the node settings.
    """
    live.on_node_message({"node": "cam_drive", "values": {"rpm": 280.0, "pacing": "5x"}})
    live.on_node_message({"node": "cam_drive", "values": {"scene": "/no/setting.yaml"}})
    turn(live, 0, 150)
    live.note()
    live.on_node_message({"node": "microphone", "values": {"frequency_weighting": "C"}})
    with pytest.raises(RefusedError):
        live.note()
    assert live.mounted_cam_and_speed() == {"cam": "poly345", "rpm": 280.0}
    assert live.node_settings()["cam_drive"] == {"pacing": "5x"}
    live.on_runner_event({"graph": "starting"})
    data = live.page_data()
    assert (data["state"], data["level"]) == ({}, None)
    assert len(data["readings"]) == 1


def test_the_number_of_readings_is_bounded(live, monkeypatch):
    """Readings beyond the maximum number are refused until the list is cleared."""
    monkeypatch.setattr(live_state, "MAX_READINGS", 2)
    turn(live, 0, 150)
    live.note()
    live.note()
    with pytest.raises(RefusedError, match="clear them"):
        live.note()
    live.readings.clear()
    live.note()


# -- a reading is the mean square of a second at one speed, or it is refused


def turned(meter, rpm, seconds, level, start=0.0):
    """Pass ticks of constant speed and level to a meter, and return the end time (s).

    There are 12 ticks per turn.
    """
    tick = 60.0 / rpm / 12
    count = round(seconds / tick)
    for k in range(count):
        meter.add_speed(round((start + k * tick) * NS), rpm)
        meter.add_level(round((start + (k + 1) * tick) * NS), level)
    return start + count * tick


def test_a_steady_level_is_the_mean_square_of_whole_turns():
    """The level of a reading is the energy mean over whole turns at the present speed.

    It is available once the motion has settled, and after 8 time constants of the meter.
    """
    for rpm in (20.0, 97.0, 300.0, 3000.0):
        meter = Meter()
        end = turned(meter, 50.0, 3.0, 60.0)
        end = turned(meter, rpm, 2.0 * (1.0 + 60.0 / rpm), 80.0, end)
        assert meter.steady_mean(0.125)[:2] == pytest.approx((rpm, 80.0))
    with pytest.raises(RefusedError, match=r"after 9\.0 s"):
        meter.steady_mean(1.0)
    for _ in range(300):
        end = turned(meter, 3000.0, 1 / 60, 80.0, end)
        end = turned(meter, 3000.0, 1 / 60, 90.0, end)
    assert meter.steady_mean(0.125)[1] == pytest.approx(80.0 + 10 * np.log10(5.5), abs=1e-9)


def test_no_level_is_read_after_a_change_or_at_standstill():
    """A reading soon after a change of speed is refused with the time to wait.

    It is refused also before the first tick and while the cam is stopped.
    """
    meter = Meter()
    meter.add_level(1000, 80.0)
    assert meter.latest is None
    with pytest.raises(RefusedError, match="the cam is stopped"):
        meter.steady_mean(0.125)
    end = turned(meter, 300.0, 5.0, 80.0)
    end = turned(meter, 310.0, 0.5, 90.0, end)
    message = r"310 rpm for 0\.5 s of rig time; allowed: after 2\.3 s"
    with pytest.raises(RefusedError, match=message):
        meter.steady_mean(0.125)
    meter.add_speed(round(end * NS), 0.0)
    meter.add_level(round((end + 1.0) * NS), 40.0)
    with pytest.raises(RefusedError, match="the cam is stopped"):
        meter.steady_mean(0.125)


def test_readings_are_written_as_csv():
    """Readings are exported as CSV with units in the headings and quoted names."""
    reading = NotedReading("a,b", "one_mass", 300.0, 83.25, "LAF", "in contact", 0.5, 4030.0, 30.6)
    (row,) = csv.DictReader(to_csv([reading]).splitlines())
    assert row["cam"] == "a,b" and float(row["level_db"]) == 83.25
    assert float(row["preload_n"]) == 30.6


# -- the page draws the motion of the rig: cam, follower, force and gap

#: One cam for each type of follower.
CAMS = ("poly345", "flat", "inclined_flat", "oscillating_roller", "oscillating_flat", "point")


def law_of(name):
    """Return a shipped cam and its law."""
    cam = cam_rig.load_cam(name)
    return cam, cam_rig.build_law(cam)


@pytest.mark.parametrize("name", CAMS)
def test_the_drawn_follower_is_that_of_the_profile(name):
    """The picture for the page has the follower's position and rotation at each lift.

    Both are linear in the lift (1e-9 mm). The drawn contact point is on the contour within 1 µm.
    """
    cam, law = law_of(name)
    shape, picture = follower_shape(cam, law), drawing.cam_picture(cam, law)
    lift = np.linspace(0.0, 1.3 * law.lift, 7)
    way = np.array(picture["origin"]) + np.outer(lift, picture["origin_per_mm"]) * 1e3
    assert way == pytest.approx(shape.origin(lift) * 1e3, abs=1e-9)
    turned = picture["turn"] + picture["turn_per_mm"] * lift * 1e3
    assert turned == pytest.approx(shape.turn(lift), abs=1e-12)
    contour, touch = np.array(picture["contour"]), np.array(picture["contact"])
    for i in range(0, drawing.CONTOUR_POINTS, 30):
        angle = TURN * i / drawing.CONTOUR_POINTS
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        away = np.hypot(*((turn @ contour).T - touch[:, i]).T)
        assert away.min() < 1e-3


@pytest.mark.parametrize(
    ("model", "above"), [("one_mass", 480.0), ("two_mass", 430.0), ("kinetostatic", 480.0)]
)
def test_the_predicted_turn_is_that_of_a_long_run(model, above):
    """The turn that the page predicts is the last of a simulation of 30 turns.

    Lift, force and contact agree below and above the jump speed.
    """
    law, setup = law_of("poly345")[1], DEFAULT_SETUP.with_changes({"model": model}, RIG)
    for rpm in (250.0, above):
        predicted = drawing.predict_turn(setup.with_changes({"rpm": rpm}, RIG), law, RIG)
        assert predicted["is_steady"]
        turn = np.frombuffer(base64.b64decode(predicted["curves"]), "<f4").reshape(6, -1)
        run = cam_rig.simulate(law, RIG, model=model, rpm=rpm, turns=30, sample_rate=48_000)
        last = run.angle >= run.angle[-1] - TURN
        curves = drawing.turn_curves(law, run.angle[last], run.rows[:, last])
        order = np.argsort(curves[0] % TURN)
        for row, tolerance in ((1, 2e-3), (4, 0.03 * curves[4].max())):
            simulated = np.interp(turn[0], (curves[0] % TURN)[order], curves[row][order])
            assert np.abs(simulated - turn[row]).max() < tolerance
        assert predicted["contact_lost"] == bool((curves[4] == 0.0).any())
        assert predicted["min_force_n"] == pytest.approx(curves[4].min(), abs=0.5)


def test_the_marks_of_the_knob_are_the_jump_speeds():
    """The speed knob has marks at the jump speeds, first that of the selected model.

    A rig without two masses has only the mark of one mass.
    """
    law = law_of("poly345")[1]
    two_masses, one_mass = drawing.jump_speeds(law, RIG, "two_mass")
    assert (two_masses["model"], one_mass["model"]) == ("two_mass", "one_mass")
    assert two_masses["rpm"] == pytest.approx(cam_rig.jump_speed(law, RIG).rpm, rel=1e-6)
    assert one_mass["rpm"] > two_masses["rpm"]
    (alone,) = drawing.jump_speeds(law, cam_rig.load_rig("tm21"), "one_mass")
    assert alone["rpm"] == pytest.approx(438.28969763, rel=1e-8)


@pytest.mark.parametrize("rpm", [20.0, 333.3, 1000.0])
def test_a_block_contains_angle_and_gap_of_its_samples(tmp_path, rpm):
    """A block of samples for the page has about one sample per degree.

    It contains the cam angle and the gap. There is no block without a cam state or for an unknown
    cam.
    """
    law, rig = law_of("poly345")[1], cam_rig.load_rig("tm21")
    run = cam_rig.simulate(law, rig, rpm=rpm, turns=1, sample_rate=4000)
    live = LiveMotion(Cams(tmp_path))
    assert live.block(run.rows) is None
    live.add_state({"time_ns": 0, "angle": 0.0, "rpm": rpm, "cam": "poly345"})
    block = live.block(run.rows)
    assert block is not None
    ((start, step, rows),) = blocks_of(block)
    assert start == 0.0
    stride = round(step * 4000)
    assert rows[0] == pytest.approx(run.angle[::stride], abs=1e-5)
    assert math.degrees(step * rpm * RPM) < max(1.01, math.degrees(rpm * RPM / 4000) * 1.01)
    gap = np.where(run.force == 0.0, run.lift - law(run.angle), 0.0)[::stride]
    assert rows[5] == pytest.approx(1e6 * gap, rel=1e-5, abs=1e-3)
    for change in ({"cam": "gone"}, {"rpm": 0.0}):
        live.add_state({"time_ns": 0, "angle": 0.0, "rpm": rpm, "cam": "poly345"} | change)
        assert (live.block(run.rows[:, :1]) is None) == ("cam" in change)
