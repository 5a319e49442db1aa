"""A law from measured points: interpolation, smoothing within the tolerance, and what it gives."""

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import Law, build_law
from cam_rig.laws.bernstein import joined, turned_to_zero
from cam_rig.laws.law import SMOOTHEST, continuity
from cam_rig.laws.segments import smoothed
from cam_rig.laws.spline import smooth
from cam_rig.units import TURN


def law_of(found):
    breaks, columns = found.pieces
    return Law("table", np.array(breaks), joined(columns))


def wave(angle):
    """A smooth periodic lift of 10 mm."""
    return 0.005 * (1.0 - np.cos(angle)) + 0.0004 * np.sin(3.0 * angle)


@pytest.mark.parametrize("start", [0.0, 0.02])
def test_zero_tolerance_goes_through_every_point(start):
    """An interpolating quintic: at the points to rounding, between them to h⁶."""
    angles = start + np.linspace(0.0, TURN, 72, endpoint=False)
    found = smooth(angles, wave(angles), 0.0)
    assert found.largest < 1e-16
    law = law_of(found)
    between = np.linspace(0.0, TURN, 1000, endpoint=False)
    assert np.abs(law(between) - wave(between)).max() < 3.0**6 * (TURN / 72) ** 6 * 0.0004
    assert continuity(law) == SMOOTHEST


@pytest.mark.parametrize("tolerance", [2e-6, 2e-5, 2e-4])
def test_smoothing_stays_within_the_tolerance(tolerance):
    """The r.m.s. distance is the tolerance (within FITPACK's 0.1 %): no more, and used up."""
    angles = np.linspace(0.0, TURN, 120, endpoint=False)
    noise = np.random.default_rng(3).normal(scale=tolerance, size=angles.size)
    found = smooth(angles, wave(angles) + noise, tolerance)
    assert found.rms <= 1.001 * tolerance
    assert found.rms >= 0.99 * tolerance
    assert continuity(law_of(found)) == SMOOTHEST


def test_smoothing_brings_the_derivative_back():
    """Readings rounded to 0.01 mm: smoothed, the acceleration is far nearer the truth."""
    angles = np.linspace(0.0, TURN, 120, endpoint=False)
    rounded = np.round(wave(angles), 5)
    h = 1e-3
    fine = np.linspace(0.0, TURN, 1000, endpoint=False)
    true = (wave(fine + h) - 2.0 * wave(fine) + wave(fine - h)) / h**2
    errors = [
        np.sqrt(np.mean((law_of(smooth(angles, rounded, tolerance))(fine, 2) - true) ** 2))
        for tolerance in (0.0, 1e-5 / np.sqrt(12.0))
    ]
    assert errors[1] < 0.1 * errors[0]


def test_a_repeated_first_point_is_averaged():
    """A table that closes at 360° may say the first point twice, a little apart."""
    angles = np.linspace(0.0, TURN, 73)
    lifts = wave(angles)
    lifts[-1] += 2e-7
    found = law_of(smooth(angles, lifts, 0.0))
    assert float(found(0.0)) == pytest.approx(1e-7, abs=1e-16)


def test_the_spline_is_c4_where_the_turn_closes():
    """Cut and turned to begin at angle 0, it is still one periodic spline."""
    angles = 0.013 + np.linspace(0.0, TURN, 40, endpoint=False)
    law = law_of(smooth(angles, wave(angles), 1e-6))
    for order in range(5):
        size = np.abs(law.derivative_ordinates(order)).max()
        assert abs(law.jumps(order)[0]) < 1e-8 * size


def test_shipped_table_follows_its_points(cams, laws):
    """The r.m.s. distance of measured.csv is the file's tolerance; no point is off by 4 of them."""
    segment = cams["measured"].segments[0]
    found = smoothed(segment, cams["measured"])
    tolerance = segment.tolerance.si
    assert tolerance * 0.99 <= found.rms <= 1.001 * tolerance
    assert found.largest < 4.0 * tolerance
    away = laws["measured"](np.array(segment.file.angles)) - segment.file.lifts
    assert np.sqrt(np.mean(away**2)) == pytest.approx(found.rms, rel=1e-9)


def test_lift_must_be_the_points(cams):
    """A file whose lift is not that of its points says both."""
    cam = cams["measured"]
    wrong = cam.model_copy(update={"lift": cam.lift.model_copy(update={"assumed": 12})})
    with pytest.raises(LawError, match=r"lift is 12 mm, the points of measured.csv rise by 10"):
        build_law(wrong)


def test_turning_cuts_at_zero_only():
    """Pieces that begin anywhere become the same curve from 0, one cut more."""
    column = np.array([0.0, 1.0, 4.0, 9.0])
    breaks, columns = turned_to_zero(([-1.0, 2.0, TURN - 1.0], [column, column[::-1]]), TURN)
    assert breaks == pytest.approx([0.0, 2.0, TURN - 1.0, TURN])
    cut = Law("turned", np.array(breaks), joined(columns))
    assert float(cut(0.0)) == pytest.approx(float(np.polyval([1, 0, 0], 1.0)), abs=9)
    left, right = cut.ordinates[-1, -1], cut.ordinates[0, 0]
    assert left == pytest.approx(right, rel=1e-15)


def test_turning_at_a_breakpoint_cuts_nothing():
    """A piece that ends at 0 stays whole."""
    column = np.array([0.0, 1.0])
    breaks, columns = turned_to_zero(([-2.0, 0.0, TURN - 2.0], [column, column[::-1]]), TURN)
    assert breaks == pytest.approx([0.0, TURN - 2.0, TURN])
    assert len(columns) == 2
