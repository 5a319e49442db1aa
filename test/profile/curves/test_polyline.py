"""Polylines and cutter paths: the chord error is proven, and the pitch curve is a cutter's path."""

import re

import numpy as np
import pytest
from shapely import LinearRing, distance, points, prepare

from cam_rig.errors import ConfigError, ProfileError
from cam_rig.profile.polyline import contour_paths, cutter_paths, pitch_paths, polyline

from ..conftest import UNEVEN, Made, make

DENSE = np.linspace(0.0, 2.0 * np.pi, 3_001)


@pytest.mark.variants(7)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_chord_error_is_within_the_tolerance(made, tolerance):
    """By shapely: 3000 points of the contour, each that near to the polyline."""
    for path in contour_paths(made.cam.follower, made.law):
        line = polyline(path, tolerance)
        ring = LinearRing(line.T)
        prepare(ring)
        off = distance(ring, points(path.at(DENSE)[0].T)).max()
        assert off <= tolerance * (1 + 1e-6)
        assert line.shape[1] < 120 or off > 0.4 * tolerance  # and no more points than it takes


@pytest.mark.variants(21)
def test_shipped_contours_too(law, cams):
    """Among them the TM21 cam, whose curvature jumps."""
    (path, *_) = contour_paths(cams[law.name].follower, law)
    ring = LinearRing(polyline(path, 1e-6).T)
    prepare(ring)
    assert distance(ring, points(path.at(DENSE)[0].T)).max() <= 1e-6 * (1 + 1e-6)


@pytest.mark.parametrize("kind", ["point", "roller", "flat"])
def test_a_corner_costs_no_points(kind):
    """Constant velocity: where s' jumps a vertex stands on each side, the rest is smooth.

    Each smooth stretch keeps the tolerance, corners and all, with no more points than a law without
    corners takes.
    """
    segments = [
        ("dwell", 90, None),
        ("constant_velocity", 90, 1),
        ("dwell", 90, None),
        ("constant_velocity", 90, 0),
    ]
    made = make(kind, segments, lift=25.4)
    (path,) = contour_paths(made.cam.follower, made.law)
    line = polyline(path, 1e-6)
    assert line.shape[1] < 1000
    ring = LinearRing(line.T)
    prepare(ring)
    dense = np.unique(np.append(DENSE, made.law.breaks))
    assert distance(ring, points(path.at(dense)[0].T)).max() <= 1e-6 * (1 + 1e-6)
    for joint in made.law.breaks[:-1]:
        for side in (joint, np.nextafter(joint or 2.0 * np.pi, 0.0)):
            off = np.hypot(*(line - path.at(np.array([side]))[0]))
            assert off.min() < 1e-11


def test_impossible_tolerance():
    """Less than the rounding of a metre is no tolerance."""
    made = make("flat", UNEVEN)
    (path,) = contour_paths(made.cam.follower, made.law)
    for wrong in (0.0, -1.0, 1e-12, float("nan")):
        with pytest.raises(ProfileError, match=r"tolerance is .* µm; allowed: at least 1e-05 µm"):
            polyline(path, wrong)


@pytest.mark.parametrize("kind", ["roller", "oscillating_roller", "conjugate"])
def test_cutter_of_the_rollers_radius_runs_on_the_pitch_curve(kind):
    """Profile thesis §2.2.3; the pitch curve here is the follower's own, not an offset."""
    made = make(kind, UNEVEN)
    cutters = cutter_paths(made.cam.follower, made.law, made.cam.follower.roller)
    pitches = pitch_paths(made.cam.follower, made.law)
    for cutter, pitch, contour in zip(cutters, pitches, made.contours(DENSE), strict=True):
        np.testing.assert_allclose(cutter.at(DENSE)[0], contour.pitch, rtol=0, atol=1e-16)
        np.testing.assert_array_equal(cutter.at(DENSE)[0], pitch.at(DENSE)[0])


def test_any_cutter_is_its_radius_away():
    """Nearest point of the contour to the cutter's centre: one cutter radius."""
    made = make("flat", UNEVEN)
    (path,) = cutter_paths(made.cam.follower, made.law, 0.012)
    ring = LinearRing(made.contours(DENSE)[0].points.T)
    prepare(ring)
    away = distance(ring, points(path.uniform(100)[0].T))
    np.testing.assert_allclose(away, 0.012, rtol=0, atol=1e-6)  # m: chords of the ring


def test_cutter_too_large_for_a_hollow(cams, laws):
    """Refused with the angle, the hollow's radius and the cutter's; one that fits is not."""
    tm21 = Made(cams["tm21"], laws["tm21"])
    for radius, fits in ((0.5, True), (0.51, False)):
        (path,) = cutter_paths(tm21.cam.follower, tm21.law, radius)
        if fits:
            path.require_room()
            continue
        words = "cutter radius is 510 mm; allowed: less than the concave radius of curvature 507.69"
        with pytest.raises(ProfileError, match=re.escape(words)):
            path.require_room()


def test_a_face_has_no_pitch_curve():
    """It has no centre; its cutter's path is asked for by the cutter's radius."""
    made = make("flat", UNEVEN)
    with pytest.raises(ConfigError, match="a flat follower has no pitch curve; allowed: "):
        pitch_paths(made.cam.follower, made.law)
