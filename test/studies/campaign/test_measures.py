"""What is measured of a point: settled runs, the rig's own numbers, rows where there is none."""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.steady_rules import FORCE_RTOL, MAX_FORCE_TURNS
from cam_rig.dynamics.vibration import residual_vibration
from cam_rig.quantities.catalogue import measured_in
from cam_rig.quantities.steady import scene_at, steady_row
from cam_rig.studies.campaign.campaign import make_point
from cam_rig.units import RPM

PRELOAD = "rig.follower.preload"
BASE = {"cam": "poly345", "rig": "paper_table2"}
CAM, RIG = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
LAW = cam_rig.build_law(CAM)
WAVE = {
    "profile.waviness.amplitude": {"values": [2], "unit": "um"},
    "profile.waviness.wavelength": {"values": [10], "unit": "deg"},
}


def test_a_wave_at_the_stems_resonance_takes_a_fifth_of_the_jump_speed(measured):
    """2 µm of 10°: from 413 to about 320 rpm; 1e-12 m changes nothing."""
    _, rows = measured("jump_speed", vary=WAVE)
    assert rows.measures[0, 0] == pytest.approx(320.0, abs=1.0)
    tiny = WAVE | {"profile.waviness.amplitude": {"values": [0.0, 1e-12], "unit": "m"}}
    none, least = measured("jump_speed", vary=tiny)[1].measures[:, 0]
    assert none == pytest.approx(413.44, abs=0.005)
    assert least == pytest.approx(none, rel=1e-6)


def test_measures_are_those_of_the_commands(measured):
    """At the base, each is what the library gives on its own."""
    names = ["jump_speed", "jump_speed_steady", "sound_level@300rpm"]
    names.append("peak_contact_force_rigid@300rpm")
    found = measured(*names)[1].measures[0]
    motion = cam_rig.simulate(LAW, RIG, model="two_mass", rpm=300, turns=33)
    expected = [
        cam_rig.jump_speed(LAW, RIG).rpm,
        cam_rig.jump_speed(LAW, RIG, duration=None).rpm,
        cam_rig.sound_level(motion, settle_turns=30).level_db,
        4030.0 * 0.05 + 30.6,  # at the top, where spring and preload alone press
    ]
    assert found == pytest.approx(expected, rel=2e-6)


def test_every_measure_has_a_number(measured):
    """On the paper's rig, finite ones, at one speed each where they have one."""
    known = measured_in("two_mass")
    _, rows = measured(*(f"{name}@300rpm" if one.where else name for name, one in known.items()))
    assert rows.reasons == ("",)
    assert np.isfinite(rows.measures).all()


def test_no_jump_speed_is_a_number_too(measured):
    """0 where contact is lost at every speed, ∞ where at none: rows, not errors."""
    damping = {"values": [3000], "unit": "N*s/m"}  # too much for the spring to close the dwell
    loose = {PRELOAD: {"values": [0], "unit": "N"}, "rig.follower.damping": damping}
    _, rows = measured("jump_speed", "jump_speed_rigid", vary=loose)
    assert rows.measures.tolist() == [[0.0, 0.0]]
    firm = {"cam.lift": {"values": [1e-9], "unit": "mm"}}
    _, rows = measured("jump_speed_rigid", vary=firm, base={"cam": "poly345", "rig": "tm21"})
    assert (rows.measures[0, 0], rows.reasons) == (pytest.approx(math.inf), ("",))


def test_what_cannot_be_made_is_a_row_with_its_reason(measured):
    """A mass below zero, a turn that is not one: no number, and why; the others are untouched."""
    mass = {"rig.follower.mass": {"values": [-1, 1.3], "unit": "kg"}}
    _, rows = measured("jump_speed", vary=mass)
    assert "follower.mass" in rows.reasons[0]
    assert np.isnan(rows.measures[0, 0])
    assert rows.reasons[1] == ""
    assert rows.measures[1, 0] > 400.0
    span = {"cam.segments[1].span": {"values": [100], "unit": "deg"}}
    assert "missing 17.5°" in measured("jump_speed", vary=span)[1].reasons[0]


def test_a_measure_that_fails_leaves_the_others(measured):
    """No shaft on the rig: twist has a reason, the jump speed a number."""
    base = {"cam": "poly345", "rig": "tm21"}
    _, rows = measured("twist@300rpm", "jump_speed_rigid", base=base)
    assert rows.reasons[0].startswith("twist@300rpm: ")
    assert np.isnan(rows.measures[0]).tolist() == [True, False]


@pytest.mark.variants(2)
@pytest.mark.parametrize("model", ["two_mass", "elastic_stem"])
@pytest.mark.parametrize("cam", ["poly345", "cycloidal", "bezier15"])
def test_forces_in_contact_are_of_the_steady_state(measured, model, cam):
    """To 1e-6 of those of a long run, and between its samples too."""
    names = [f"{name}_contact_force@290rpm" for name in ("least", "peak")]
    found = measured(*names, base=BASE | {"model": model, "cam": cam})[1].measures[0]
    law = cam_rig.build_law(cam_rig.load_cam(cam))
    motion = cam_rig.simulate(law, RIG, model=model, rpm=290, turns=30, sample_rate=200_000)
    force = motion.force[motion.time > 28 * 60 / 290]
    assert found == pytest.approx([force.min(), force.max()], abs=1e-5 * force.max())
    assert found[0] <= force.min() * (1.0 + 1e-6)
    assert found[1] >= force.max() * (1.0 - 1e-6)


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "two_mass", "elastic_stem"])
def test_forces_do_not_depend_on_the_turns_of_the_scene(measured, model):
    """Of two turns or ten: a settled follower does the same in each of them."""
    campaign, _ = measured("peak_contact_force@300rpm", base=BASE | {"model": model})
    point = make_point(campaign, np.array([30.6]))
    rows = []
    for turns in (2.0, 10.0):
        program = point.scene.program
        turned = program.turns.model_copy(update={"assumed": turns})
        program = program.model_copy(update={"turns": turned})
        scene = scene_at(point.scene.model_copy(update={"program": program}), 300 * RPM)
        row, settled = steady_row(point.law, point.rig, scene, 300 * RPM)
        assert settled
        rows.append([row.force_peak, row.force_least, row.torque_peak, row.level_db])
    assert rows[0] == pytest.approx(rows[1], rel=FORCE_RTOL)


def test_a_follower_that_lifts_off_is_settled_or_said_not_to_be(measured, results, tmp_path):
    """Above the jump speed its flights repeat; where not, rows and tables say of which turns."""
    _, rows = measured("lift_offs@450rpm", "peak_contact_force@450rpm")
    assert rows.status == ["ok"]
    assert rows.measures[0, 0] > 0.0
    stiff = {"rig.follower.restitution": {"values": [0.0, 0.9], "unit": "1"}}
    measures, grid = ["peak_contact_force@900rpm"], {"kind": "grid"}
    found = results(tmp_path, vary=stiff, measures=measures, plan=grid)
    frame = found.to_pandas()
    assert frame.status.tolist()[1] == "unsettled"
    assert f"not settled to 1e-06 in {MAX_FORCE_TURNS} turns" in frame.reason[1]
    assert np.isfinite(frame.peak_contact_force_at_900rpm).all()
    (table,) = found.to_display()
    assert "of 2 points" in table.notes[-1]
    assert f"in {MAX_FORCE_TURNS} turns" in table.notes[-1]


def test_one_rigid_mass_is_the_same_by_either_name(measured):
    """The scene's model one_mass gives what the names of one rigid mass do, and two masses not."""
    names = [f"{n}_contact_force{r}@300rpm" for r in ("", "_rigid") for n in ("peak", "least")]
    _, rigid = measured(*names, base=BASE | {"model": "one_mass"})
    assert rigid.measures[0, :2] == pytest.approx(rigid.measures[0, 2:], rel=1e-9)
    _, two = measured(*names, base=BASE | {"model": "two_mass"})
    assert two.measures[0, 2:] == pytest.approx(rigid.measures[0, 2:], rel=1e-12)
    assert two.measures[0, 0] > 1.02 * two.measures[0, 2]
    assert two.measures[0, 1] < 0.8 * two.measures[0, 3]


def test_steady_vibration_is_that_of_the_whole_turn(measured):
    """What the events leave meets what is left of the turns before: not what one event leaves."""
    _, rows = measured("residual_vibration_steady@300rpm")
    one = cam_rig.design(CAM, RIG, minimise="residual_vibration@300rpm", pieces=4)
    steady = residual_vibration(LAW, FollowerParameters.from_rig(RIG), np.array([300.0 * RPM]))
    assert rows.measures[0, 0] == pytest.approx(steady[0], rel=1e-12)
    assert rows.measures[0, 0] > 2.0 * one.goal.start


def test_steady_vibration_is_read_in_the_low_dwell_of_the_cam_without_errors(measured):
    """An eccentricity leaves no dwell at rest: 1e-12 m of it changes the vibration by no more."""
    vary = {
        "profile.eccentricity.amplitude": {"values": [0.0, 1e-12], "unit": "m"},
        "profile.eccentricity.phase": {"values": [0, 120, 240], "unit": "deg"},
    }
    found = measured("residual_vibration_steady@300rpm", vary=vary)[1].measures[:, 0]
    assert found == pytest.approx(found[0], abs=1e-12)
