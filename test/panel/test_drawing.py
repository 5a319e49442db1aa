"""What the bench's page draws is the rig's own motion: cam, follower, force and gap."""

import base64
import math

import numpy as np
import pytest

import cam_rig
from cam_rig.panel.bench.drawing import (
    POINTS,
    Cams,
    LiveMotion,
    cam_picture,
    curves,
    expected,
    jump_speeds,
)
from cam_rig.panel.bench.runner import Setup
from cam_rig.profile.outlines import follower_shape
from cam_rig.units import RPM, TURN

from .conftest import blocks_of

#: One of each follower: roller, flat, inclined, on an arm.
CAMS = ("poly345", "flat", "inclined_flat", "oscillating_roller", "oscillating_flat", "point")


def law_of(name):
    cam = cam_rig.load_cam(name)
    return cam, cam_rig.build_law(cam)


def rows_of(found):
    return np.frombuffer(base64.b64decode(found["curves"]), "<f4").reshape(6, -1)


@pytest.mark.parametrize("name", CAMS)
def test_the_follower_is_drawn_where_the_profile_has_it(name):
    """A straight line of the lift stands for its way, exactly; it is touched on the contour."""
    cam, law = law_of(name)
    shape, drawn = follower_shape(cam, law), cam_picture(cam, law)
    lift = np.linspace(0.0, 1.3 * law.lift, 7)
    way = np.array(drawn["origin"]) + np.outer(lift, drawn["along"]) * 1e3
    assert way == pytest.approx(shape.origin(lift) * 1e3, abs=1e-9)
    turned = drawn["turn"] + drawn["turns"] * lift * 1e3
    assert turned == pytest.approx(shape.turn(lift), abs=1e-12)
    contour, touch = np.array(drawn["contour"]), np.array(drawn["touch"])
    for i in range(0, POINTS, 30):
        angle = TURN * i / POINTS
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        away = np.hypot(*((turn @ contour).T - touch[:, i]).T)
        assert away.min() < 1e-3


@pytest.mark.parametrize(
    ("model", "above"), [("one_mass", 480.0), ("two_mass", 430.0), ("kinetostatic", 480.0)]
)
def test_what_is_expected_is_what_a_long_run_does(model, above):
    """Below and above the jump speed: lift, force and flight of the turns once they repeat."""
    law, rig = law_of("poly345")[1], cam_rig.load_rig("paper_table2")
    setup = Setup.of(rig, "poly345").changed({"model": model}, rig)
    for rpm in (250.0, above):
        found = expected(setup.changed({"rpm": rpm}, rig), law, rig)
        assert found["settled"]
        turn = rows_of(found)
        run = cam_rig.simulate(law, rig, model=model, rpm=rpm, turns=30, sample_rate=48_000)
        last = run.angle >= run.angle[-1] - TURN
        whole = curves(law, run.angle[last], run.rows[:, last])
        place = np.argsort(whole[0] % TURN)
        for row, near in ((1, 2e-3), (4, 0.03 * whole[4].max())):
            shown = np.interp(turn[0], (whole[0] % TURN)[place], whole[row][place])
            assert np.abs(shown - turn[row]).max() < near
        assert found["lost"] == bool((whole[4] == 0.0).any())
        assert found["least_n"] == pytest.approx(whole[4].min(), abs=0.5)


def test_the_marks_on_the_knob_are_the_jump_speeds():
    """By the set-up's own model first; of a rig without two masses by one alone."""
    law, rig = law_of("poly345")[1], cam_rig.load_rig("paper_table2")
    two, one = jump_speeds(law, rig, "two_mass")
    assert (two["model"], one["model"]) == ("two_mass", "one_mass")
    assert two["rpm"] == pytest.approx(cam_rig.jump_speed(law, rig).rpm, rel=1e-6)
    assert one["rpm"] > two["rpm"]
    (alone,) = jump_speeds(law, cam_rig.load_rig("tm21"), "one_mass")
    assert alone["rpm"] == pytest.approx(438.28969763, rel=1e-8)


@pytest.mark.parametrize("rpm", [20.0, 333.3, 1000.0])
def test_a_block_has_the_angle_and_the_gap_of_its_samples(tmp_path, rpm):
    """About one sample a degree; of an unknown state nothing."""
    law, rig = law_of("poly345")[1], cam_rig.load_rig("tm21")
    run = cam_rig.simulate(law, rig, rpm=rpm, turns=1, sample_rate=4000)
    live = LiveMotion(Cams(tmp_path))
    assert live.block(run.rows) is None
    live.state({"time_ns": 0, "angle": 0.0, "rpm": rpm, "cam": "poly345"})
    block = live.block(run.rows)
    assert block is not None
    ((begin, step, rows),) = blocks_of(block)
    assert begin == 0.0
    every = round(step * 4000)
    assert rows[0] == pytest.approx(run.angle[::every], abs=1e-5)
    assert math.degrees(step * rpm * RPM) < max(1.01, math.degrees(rpm * RPM / 4000) * 1.01)
    gap = np.where(run.force == 0.0, run.lift - law(run.angle), 0.0)[::every]
    assert rows[5] == pytest.approx(1e6 * gap, rel=1e-5, abs=1e-3)
    for change in ({"cam": "gone"}, {"rpm": 0.0}):
        live.state({"time_ns": 0, "angle": 0.0, "rpm": rpm, "cam": "poly345"} | change)
        assert (live.block(run.rows[:, :1]) is None) == ("cam" in change)
