"""Tests of the measures at a campaign's points: values, steady motion, failures."""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.steady_rules import FORCE_RTOL, MAX_FORCE_TURNS
from cam_rig.dynamics.vibration import residual_vibration
from cam_rig.quantities.catalogue import campaign_quantities
from cam_rig.quantities.steady import scene_at, steady_row
from cam_rig.studies.campaign.campaign import make_point
from cam_rig.units import RPM

PRELOAD = "rig.follower.preload"
BASE = {"cam": "poly345", "rig": "paper_table2"}
CAM, RIG = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
LAW = cam_rig.build_law(CAM)


def test_measures_are_those_of_the_commands(measured):
    """Measures of the unchanged inputs equal those of other functions of cam_rig.

    These are `jump_speed` and `sound_level`, and a closed form of the peak force.
    """
    names = ["jump_speed", "jump_speed_steady", "sound_level@300rpm"]
    names.append("peak_contact_force_rigid@300rpm")
    measures = measured(*names)[1].measures[0]
    motion = cam_rig.simulate(LAW, RIG, model="two_mass", rpm=300, turns=33)
    expected = [
        cam_rig.jump_speed(LAW, RIG).rpm,
        cam_rig.jump_speed(LAW, RIG, duration=None).rpm,
        cam_rig.sound_level(motion, transient_turns=30).level_db,
        4030.0 * 0.05 + 30.6,  # at the top of the rise only spring and preload press
    ]
    assert measures == pytest.approx(expected, rel=2e-6)


def test_every_measure_has_a_number(measured):
    """Every measure that exists for the two-mass model is finite on the paper's rig."""
    quantities = campaign_quantities("two_mass")
    _, rows = measured(
        *(f"{name}@300rpm" if quantity.where else name for name, quantity in quantities.items())
    )
    assert rows.reasons == ("",)
    assert np.isfinite(rows.measures).all()


def test_a_missing_jump_speed_is_zero_or_infinite(measured):
    """The jump speed is 0 if contact is lost at any speed, and ∞ if it is never lost.

    Both are values, not errors.
    """
    damping = {"values": [3000], "unit": "N*s/m"}  # too strong for the spring to close
    loose = {PRELOAD: {"values": [0], "unit": "N"}, "rig.follower.damping": damping}
    _, rows = measured("jump_speed", "jump_speed_rigid", vary=loose)
    assert rows.measures.tolist() == [[0.0, 0.0]]
    firm = {"cam.lift": {"values": [1e-9], "unit": "mm"}}
    _, rows = measured("jump_speed_rigid", vary=firm, base={"cam": "poly345", "rig": "tm21"})
    assert (rows.measures[0, 0], rows.reasons) == (pytest.approx(math.inf), ("",))


def test_an_invalid_point_is_a_row_with_its_reason(measured):
    """A point of a campaign with an invalid input has a reason and NaN values.

    Other points have values.
    """
    mass = {"rig.follower.mass": {"values": [-1, 1.3], "unit": "kg"}}
    _, rows = measured("jump_speed", vary=mass)
    assert "follower.mass" in rows.reasons[0]
    assert np.isnan(rows.measures[0, 0])
    assert rows.reasons[1] == ""
    assert rows.measures[1, 0] > 400.0
    span = {"cam.segments[1].span": {"values": [100], "unit": "deg"}}
    assert "missing 17.5°" in measured("jump_speed", vary=span)[1].reasons[0]


def test_a_measure_that_fails_leaves_the_others(measured):
    """If one measure of a campaign's point fails, its value is NaN with a reason.

    The other measures of the point keep their values.
    """
    base = {"cam": "poly345", "rig": "tm21"}
    _, rows = measured("twist@300rpm", "jump_speed_rigid", base=base)
    assert rows.reasons[0].startswith("twist@300rpm: ")
    assert np.isnan(rows.measures[0]).tolist() == [True, False]


@pytest.mark.variants(2)
@pytest.mark.parametrize("model", ["two_mass", "elastic_stem"])
@pytest.mark.parametrize("cam", ["poly345", "cycloidal", "bezier15"])
def test_forces_in_contact_are_those_of_the_steady_state(measured, model, cam):
    """The extreme contact forces of a campaign equal those of a 30-turn simulation.

    The follower stays in contact. They agree within 1e-5 of the largest force, the error of
    sampling at 200 kHz. They enclose the sampled extremes within 1e-6.
    """
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
    """Steady force, torque and level of a campaign do not depend on the scene's turns."""
    campaign, _ = measured("peak_contact_force@300rpm", base=BASE | {"model": model})
    point = make_point(campaign, np.array([30.6]))
    rows = []
    for turns in (2.0, 10.0):
        schedule = point.scene.schedule
        turned = schedule.turns.model_copy(update={"assumed": turns})
        schedule = schedule.model_copy(update={"turns": turned})
        scene = scene_at(point.scene.model_copy(update={"schedule": schedule}), 300 * RPM)
        row, settled = steady_row(point.law, point.rig, scene, 300 * RPM)
        assert settled
        rows.append([row.peak_force, row.min_force, row.peak_torque, row.level_db])
    assert rows[0] == pytest.approx(rows[1], rel=FORCE_RTOL)


def test_a_motion_with_lift_offs_is_steady_or_reported_as_unsettled(measured, results, tmp_path):
    """A motion with lift-offs is simulated until steady, or reported as unsettled.

    If it is not steady after MAX_FORCE_TURNS turns, the point has the status `unsettled`, and its
    reason and the table's note give the number of turns. The force stays a finite number.
    """
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
    """Under the model one_mass a force measure equals its `_rigid` variant.

    Under two_mass the stem vibrates, so the two differ by more than 2 %.
    """
    names = [f"{n}_contact_force{r}@300rpm" for r in ("", "_rigid") for n in ("peak", "least")]
    _, rigid = measured(*names, base=BASE | {"model": "one_mass"})
    assert rigid.measures[0, :2] == pytest.approx(rigid.measures[0, 2:], rel=1e-9)
    _, two = measured(*names, base=BASE | {"model": "two_mass"})
    assert two.measures[0, 2:] == pytest.approx(rigid.measures[0, 2:], rel=1e-12)
    assert two.measures[0, 0] > 1.02 * two.measures[0, 2]
    assert two.measures[0, 1] < 0.8 * two.measures[0, 3]


def test_steady_vibration_is_that_of_the_whole_turn(measured):
    """The measure of steady vibration includes what is left from earlier turns.

    It is more than twice the vibration after a single motion from dwell to dwell, started at rest.
    """
    _, rows = measured("residual_vibration_steady@300rpm")
    design = cam_rig.design(CAM, RIG, minimise="residual_vibration@300rpm", pieces=4)
    steady = residual_vibration(LAW, FollowerParameters.from_rig(RIG), np.array([300.0 * RPM]))
    assert rows.measures[0, 0] == pytest.approx(steady[0], rel=1e-12)
    assert rows.measures[0, 0] > 2.0 * design.goal.start


def test_steady_vibration_is_read_in_the_low_dwell_of_the_cam_without_errors(measured):
    """The measure of steady vibration is evaluated in the nominal cam's low dwell.

    An eccentricity of 1e-12 m removes the dwell from the actual profile but must not change the
    value.
    """
    vary = {
        "profile.eccentricity.amplitude": {"values": [0.0, 1e-12], "unit": "m"},
        "profile.eccentricity.phase": {"values": [0, 120, 240], "unit": "deg"},
    }
    found = measured("residual_vibration_steady@300rpm", vary=vary)[1].measures[:, 0]
    assert found == pytest.approx(found[0], abs=1e-12)
