"""The same cam, stepped by Siconos: Moreau and Jean's scheme knows no events and no closed form.

Its motions are held in siconos.csv: 50 speeds from rest on the cam, restitution 0.7, 32 000 steps a
turn, MoreauJeanOSI with theta 1/2, Siconos 4.4.0 of Debian 12. benchmark/siconos_bounce.py made it.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

import cam_rig
from cam_rig.bounce.motion import IN_CONTACT, IRREGULAR, PERIODIC

TABLE = Path(__file__).with_name("siconos.csv")
#: Turns that were stepped at each speed, and those of them at the end that were classed.
TURNS, KEPT = 130, 30
#: mm: so far apart are two turns that its steps cannot tell to differ, as a landing is up to a step
#: late; a motion is told by a scheme of first order to about as much.
STEPS_APART = 0.025


@pytest.fixture(scope="module")
def stepped():
    """Rows of the table, in order of speed."""
    return list(csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines()))


@pytest.fixture(scope="module")
def exact(stepped):
    """The same speeds by roots and closed forms."""
    law, rig = cam_rig.build_law(cam_rig.load_cam("tm21")), cam_rig.load_rig("tm21")
    rpm = [float(row["rpm"]) for row in stepped]
    settle = TURNS - KEPT
    return cam_rig.bounce_map(law, rig, rpm=rpm, restitution=0.7, turns=KEPT, settle=settle).rows


def test_motions_are_those_of_time_stepping(stepped, exact):
    """In contact, periodic with its period, irregular: the same at each of 50 speeds."""
    assert len(stepped) == 50
    found = [(row.rpm, row.motion, str(row.period or "")) for row in exact]
    assert found == [(float(row["rpm"]), row["motion"], row["period"]) for row in stepped]
    assert {motion for _, motion, _ in found} == {IN_CONTACT, PERIODIC, IRREGULAR}


def test_gaps_at_the_section_are_those_of_time_stepping(stepped, exact):
    """Least and greatest of a period's turns, as near as its steps tell; the irregular overlap."""
    for row, own in zip(stepped, exact, strict=True):
        gaps = 1e3 * own.states[:, 0]
        ends = np.array([float(row["least_gap_mm"]), float(row["greatest_gap_mm"])])
        if own.motion == IRREGULAR:
            assert gaps.min() < ends[1] and ends[0] < gaps.max()
        else:
            np.testing.assert_allclose([gaps.min(), gaps.max()], ends, atol=STEPS_APART)
