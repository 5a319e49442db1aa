"""Tests of files of contours: chord error of polylines, cutter paths, drawings.

The chord error is the distance of a contour from its polyline. Written files are read back.
"""

import re
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
from ezdxf import units
from shapely import LinearRing, distance, points, prepare

from cam_rig.errors import ConfigError, ProfileError
from cam_rig.profile import contours, discs, turn_angles
from cam_rig.profile import drawing_files as files
from cam_rig.profile.contour_files import read_contour_table
from cam_rig.profile.measure import closed_curve, rest_on_contour
from cam_rig.profile.polyline import contour_paths, pitch_paths, polyline
from cam_rig.profile.read_dxf import read_dxf

from .conftest import make

#: Cam angles at which the chord error is measured, rad.
DENSE = np.linspace(0.0, 2.0 * np.pi, 3_001)
#: Cam angles at which the law is compared, rad.
ANGLES = turn_angles(311)


def farthest(line, path, angle=DENSE):
    """Return the largest distance (m) of a path from a closed polyline.

    It is evaluated at the path's cam angles `angle` (rad).
    """
    ring = LinearRing(line.T)
    prepare(ring)
    return distance(ring, points(path.at(angle)[0].T)).max()


def test_chord_error_is_within_the_tolerance(every_kind, followable_laws, cams):
    """The chord error of a polyline is within the tolerance, with few points.

    It is the distance of the contour from the polyline. The contours of shipped cams have jumps of
    curvature.
    """
    for i, sample in enumerate(every_kind):
        tolerance = (1e-4, 1e-6, 1e-8)[i % 3]
        for path in contour_paths(sample.cam.follower, sample.law):
            line = polyline(path, tolerance)
            off = farthest(line, path)
            assert off <= tolerance * (1 + 1e-6)
            assert line.shape[1] < 120 or off > 0.4 * tolerance
    for name, law in list(followable_laws.items())[::5]:
        (path, *_) = contour_paths(cams[name].follower, law)
        assert farthest(polyline(path, 1e-6), path) <= 1e-6 * (1 + 1e-6)


def test_corner_costs_no_points():
    """At a corner of the contour the polyline has a vertex on each side.

    There s' of the law jumps. The polyline has fewer than 1000 points, and the rest of the contour
    is within the tolerance.
    """
    up, down, dwell = (
        ("constant_velocity", 90, 1),
        ("constant_velocity", 90, 0),
        ("dwell", 90, None),
    )
    for kind in ("point", "roller", "flat"):
        sample = make(kind, [dwell, up, dwell, down], lift=25.4)
        (path,) = contour_paths(sample.cam.follower, sample.law)
        line = polyline(path, 1e-6)
        assert line.shape[1] < 1000
        dense = np.unique(np.append(DENSE, sample.law.breaks))
        assert farthest(line, path, dense) <= 1e-6 * (1 + 1e-6)
        for joint in sample.law.breaks[:-1]:
            for side in (joint, np.nextafter(joint or 2.0 * np.pi, 0.0)):
                off = np.hypot(*(line - path.at(np.array([side]))[0]))
                assert off.min() < 1e-11


def test_cutter_paths(cams, laws):
    """The path of a cutter with the roller's radius is the roller's pitch curve.

    The path of any other cutter is one cutter radius outside the contour. A cutter that is too
    large for a concave part is rejected.
    """
    for kind in ("roller", "oscillating_roller", "conjugate"):
        sample = make(kind)
        cutters = contour_paths(
            sample.cam.follower, sample.law, "CUTTER", sample.cam.follower.roller
        )
        pitches = pitch_paths(sample.cam.follower, sample.law)
        for cutter, pitch, contour in zip(cutters, pitches, sample.contours(DENSE), strict=True):
            np.testing.assert_allclose(cutter.at(DENSE)[0], contour.pitch, rtol=0, atol=1e-16)
            np.testing.assert_array_equal(cutter.at(DENSE)[0], pitch.at(DENSE)[0])
    sample = make("flat")
    (path,) = contour_paths(sample.cam.follower, sample.law, "CUTTER", 0.012)
    ring = LinearRing(sample.contours(DENSE)[0].points.T)
    away = distance(ring, points(path.at(turn_angles(100))[0].T))
    np.testing.assert_allclose(away, 0.012, rtol=0, atol=1e-6)  # m: chords of the ring
    tm21 = cams["tm21"].follower, laws["tm21"]
    (path,) = contour_paths(*tm21, "CUTTER", 0.5)
    path.require_room()
    (path,) = contour_paths(*tm21, "CUTTER", 0.51)
    text = "cutter radius is 510 mm; allowed: less than the concave radius of curvature 507.69"
    with pytest.raises(ProfileError, match=re.escape(text)):
        path.require_room()


def test_pitch_curve_of_a_face_and_small_tolerance_are_rejected():
    """The pitch curve of a flat face, which does not exist, is refused.

    A tolerance below 1e-5 µm, the rounding of a coordinate of 1 m, is refused too.
    """
    sample = make("flat")
    with pytest.raises(ConfigError, match="a flat follower has no pitch curve; allowed: "):
        pitch_paths(sample.cam.follower, sample.law)
    (path,) = contour_paths(sample.cam.follower, sample.law)
    for wrong in (0.0, -1.0, 1e-12, float("nan")):
        with pytest.raises(ProfileError, match=r"tolerance is .* µm; allowed: at least 1e-05 µm"):
            polyline(path, wrong)


# -- drawings on disk: accepted by the audit of ezdxf, true to scale, and readable


@pytest.fixture(params=["poly345", "oscillating_flat", "conjugate"])
def cam(request, cams, laws):
    """A shipped cam, its law and the paths of its contours.

    The test runs once for each of several cams.
    """
    cam, law = cams[request.param], laws[request.param]
    return cam, law, contour_paths(cam.follower, law)


def lines_of(paths, tolerance=1e-6):
    """Return the polylines of some paths by name, within a tolerance (m)."""
    return {path.name: polyline(path, tolerance) for path in paths}


def law_comes_back(cam, outlines, tolerance):
    """Assert that the follower of a cam measures its law on outlines.

    `tolerance` is in m.
    """
    plates = discs(cam[0].follower, cam[1])
    for disc, outline in zip(plates, outlines, strict=True):
        lift = rest_on_contour(disc.element, closed_curve(outline), ANGLES)
        np.testing.assert_allclose(lift, cam[1](ANGLES), rtol=0, atol=tolerance)


def test_dxf(cam, tmp_path):
    """A written DXF has layers and mm, and passes the audit of ezdxf.

    The follower measures s(θ) on it within 5 nm.
    """
    lines, path = lines_of(cam[2]), tmp_path / "a.dxf"
    files.to_document(lines).saveas(path)
    document = ezdxf.readfile(path)
    assert document.units == units.MM
    assert not document.audit().has_issues
    entities = list(document.modelspace())
    assert [e.dxf.layer for e in entities] == list(lines)
    assert all(e.dxftype() == "LWPOLYLINE" and e.closed for e in entities)
    for entity, line in zip(entities, lines.values(), strict=True):
        np.testing.assert_allclose(np.array(entity.get_points("xy")), 1e3 * line.T, rtol=1e-15)
    law_comes_back(cam, read_dxf(path).curves, 5e-9)


def test_csv(cam, tmp_path):
    """A written table has all digits, and 3600 points give s(θ) to 1e-9 of the lift."""
    path, has_discs = tmp_path / "a.csv", len(cam[2]) > 1
    files.write_contour(path, cam[2], 100)
    header, *rows = path.read_text().splitlines()
    assert tuple(header.split(",")) == (("disc", *files.HEADER) if has_discs else files.HEADER)
    numbers = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    tables = numbers[:, int(has_discs) :].reshape(len(cam[2]), 100, 5)
    for table, contour in zip(tables, contours(cam[0].follower, cam[1], 100), strict=True):
        np.testing.assert_allclose(np.radians(table[:, 0]), contour.angle, rtol=1e-15)
        np.testing.assert_array_equal(table[:, 1:3].T, 1e3 * contour.points)
        np.testing.assert_array_equal(table[:, 3], 1e3 * contour.radius)
        np.testing.assert_array_equal(table[:, 4], np.degrees(contour.pressure))
    files.write_contour(path, cam[2], 3600)
    law_comes_back(cam, read_contour_table(path).curves, 1e-9 * cam[1].lift)
    files.write_law(path, np.radians([0.0, 90.0]), np.array([0.0, 0.0125]))
    assert path.read_text() == "angle_deg,lift_mm\n0.0,0.0\n90.0,12.5\n"


def read_svg(path):
    """Return width and height (mm) of an SVG page, and its paths by name.

    The points of a path, shape (2, n), are relative to the corner of the page, y upwards.
    """
    page = ElementTree.parse(path).getroot()
    size = [float(page.get(side).removesuffix("mm")) for side in ("width", "height")]
    assert [float(number) for number in page.get("viewBox").split()] == [0.0, 0.0, *size]
    paths = {}
    for drawn in page.iter("{http://www.w3.org/2000/svg}path"):
        start, *texts, end = drawn.get("d").split()
        assert (start, end) == ("M", "Z")
        line = np.array([text.split(",") for text in texts], dtype=float)
        paths[drawn.get("id")] = line.T * [[1.0], [-1.0]]
    return size, paths


def test_svg_is_true_to_scale_and_within_its_tolerance(cam, tmp_path):
    """A written SVG has the polylines in mm, on a page with a margin of 5 mm."""
    for tolerance in (1e-4, 1e-6, 1e-8):
        lines, rounding = lines_of(cam[2], tolerance), 0.1 * tolerance
        files.write_svg(tmp_path / "a.svg", lines, rounding)
        page, paths = read_svg(tmp_path / "a.svg")
        all_points = 1e3 * np.concatenate(list(lines.values()), axis=1)
        np.testing.assert_allclose(page, np.ptp(all_points, axis=1) + 10.0, atol=1.0)
        corner = np.array([[all_points[0].min() - 5.0], [all_points[1].max() + 5.0]])
        assert list(paths) == list(lines)
        for name, line in lines.items():
            assert np.hypot(*(paths[name] + corner - 1e3 * line)).max() <= 1e3 * rounding
