"""Calibration of the rig's sound, and identification of the TM21's cam."""

import numpy as np
import pytest

import cam_rig
from examples.paper import calibrate, identify
from examples.paper.identify import Geometry, levels, study, with_geometry


def test_calibration_repeats_the_rig_file(printed_by):
    """The calibration script gives the radiation constants of the rig file.

    It does not write the file by default.
    """
    printed = printed_by(calibrate)
    assert "gain 9.86e-05 Pa·s/N, corner 18.42 Hz; 0.634 dB RMS over 21 speeds" in printed
    assert "written" not in printed
    found, rig = calibrate.study(), cam_rig.load_rig("tm21")
    assert found.gain == pytest.approx(rig.radiation.gain.si, rel=1e-4)  # five digits in the file
    assert found.corner_frequency == pytest.approx(rig.radiation.corner_frequency.si, rel=1e-4)


#: Geometry of the cam in config/cams/tm21.yaml (mm and degrees), with the r.m.s. difference (dB) of
#: its sound level and the number of trials of the search.
SHIPPED = Geometry(lift=5.682, event=114.54, nose=78.60, rms=0.93, trials=1104)


def test_the_shipped_geometry_has_its_residual(printed_by, monkeypatch):
    """A cam with the numbers in `SHIPPED` is the shipped TM21 cam.

    Its sound level differs from the published curve by 0.93 dB r.m.s.
    """
    cam = cam_rig.load_cam("tm21")
    made = with_geometry(cam, 1e-3 * SHIPPED.lift, SHIPPED.event, SHIPPED.nose)
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    lift = cam_rig.build_law(cam)(angles)
    assert cam_rig.build_law(made)(angles) == pytest.approx(lift, abs=1e-9)
    scene = cam_rig.load_scene("tm21_sweep")
    rpm = np.array(scene.scene.schedule.speeds.numbers)
    left = levels(made, rpm) - scene.published_levels("tm21", rpm)
    assert round(float(np.sqrt(np.mean(left**2))), 2) == SHIPPED.rms
    monkeypatch.setattr(identify, "study", lambda _: SHIPPED)
    assert "lift 5.682 mm, event 114.54°, nose 78.60°: 0.93 dB RMS" in printed_by(identify)


@pytest.mark.long
@pytest.mark.slow
def test_the_search_ends_at_the_shipped_geometry():
    """The search for the TM21's geometry gives the numbers of the cam file.

    The seed of the search is 1.
    """
    found = study(1)
    assert (found.lift, found.event, found.nose) == (5.682, 114.54, 78.60)
    assert round(found.rms, 2) == SHIPPED.rms
