"""Polylines, cutter paths and drawings on disk: the chord error is proven, and all can be read again."""

import re
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
from ezdxf import units
from shapely import LinearRing, distance, points, prepare

from cam_rig.errors import ConfigError, ProfileError
from cam_rig.profile import contours, discs, turn_angles
from cam_rig.profile.drawing_files import (
    HEADER,
    read_contour,
    read_dxf,
    write_contour,
    write_dxf,
    write_law,
    write_svg,
)
from cam_rig.profile.faces import GuidedFace
from cam_rig.profile.measure import closed_curve, rest
from cam_rig.profile.polyline import contour_paths, cutter_paths, pitch_paths, polyline

from .conftest import UNEVEN, Made, make

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


def test_a_corner_costs_no_points():
    """Constant velocity: where s' jumps a vertex stands on each side, the rest is smooth.

    Each smooth stretch keeps the tolerance, corners and all, with no more points than a law without
    corners takes.
    """
    for kind in ["point", "roller", "flat"]:
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
    made = make("flat", UNEVEN)
    (path,) = contour_paths(made.cam.follower, made.law)
    for wrong in (0.0, -1.0, 1e-12, float("nan")):
        with pytest.raises(ProfileError, match=r"tolerance is .* µm; allowed: at least 1e-05 µm"):
            polyline(path, wrong)


def test_cutter_of_the_rollers_radius_runs_on_the_pitch_curve():
    """Profile thesis §2.2.3; the pitch curve here is the follower's own, not an offset."""
    for kind in ["roller", "oscillating_roller", "conjugate"]:
        made = make(kind, UNEVEN)
        cutters = cutter_paths(made.cam.follower, made.law, made.cam.follower.roller)
        pitches = pitch_paths(made.cam.follower, made.law)
        for cutter, pitch, contour in zip(cutters, pitches, made.contours(DENSE), strict=True):
            np.testing.assert_allclose(cutter.at(DENSE)[0], contour.pitch, rtol=0, atol=1e-16)
            np.testing.assert_array_equal(cutter.at(DENSE)[0], pitch.at(DENSE)[0])


def test_any_cutter_is_its_radius_away():
    made = make("flat", UNEVEN)
    (path,) = cutter_paths(made.cam.follower, made.law, 0.012)
    ring = LinearRing(made.contours(DENSE)[0].points.T)
    prepare(ring)
    away = distance(ring, points(path.uniform(100)[0].T))
    np.testing.assert_allclose(away, 0.012, rtol=0, atol=1e-6)  # m: chords of the ring


def test_cutter_too_large_for_a_hollow(cams, laws):
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
    made = make("flat", UNEVEN)
    with pytest.raises(ConfigError, match="a flat follower has no pitch curve; allowed: "):
        pitch_paths(made.cam.follower, made.law)


ANGLES = turn_angles(311)


@pytest.fixture(params=["poly345", "oscillating_flat", "conjugate"])
def cam(request, cams, laws):
    """A shipped cam, its law and the paths of its contours."""
    cam, law = cams[request.param], laws[request.param]
    return cam, law, contour_paths(cam.follower, law)


def lines_of(paths, tolerance=1e-6):
    return {path.name: polyline(path, tolerance) for path in paths}


def test_dxf_is_one_closed_polyline_a_layer(cam, tmp_path):
    lines = lines_of(cam[2])
    write_dxf(tmp_path / "a.dxf", lines)
    document = ezdxf.readfile(tmp_path / "a.dxf")
    assert document.units == units.MM
    assert not document.audit().has_issues
    entities = list(document.modelspace())
    assert [e.dxf.layer for e in entities] == list(lines)
    assert all(e.dxftype() == "LWPOLYLINE" and e.closed for e in entities)
    for entity, points in zip(entities, lines.values(), strict=True):
        np.testing.assert_allclose(np.array(entity.get_points("xy")), 1e3 * points.T, rtol=1e-15)


def test_law_comes_back_from_a_dxf(cam, tmp_path):
    """The follower on the polyline of 1 µm finds s(θ) within 5 nm: a spline joins its points."""
    write_dxf(tmp_path / "a.dxf", lines_of(cam[2]))
    law_comes_back(cam, read_dxf(tmp_path / "a.dxf"), 5e-9)


def test_law_comes_back_from_a_csv(cam, tmp_path):
    """3600 points give s(θ) to 1e-9 of the lift."""
    write_contour(tmp_path / "a.csv", cam[2], 3600)
    law_comes_back(cam, read_contour(tmp_path / "a.csv"), 1e-9 * cam[1].lift)


def law_comes_back(cam, outlines, tolerance):
    plates = discs(cam[0].follower, cam[1])
    for disc, outline in zip(plates, outlines, strict=True):
        lift = rest(disc.element, closed_curve(outline), ANGLES)
        np.testing.assert_allclose(lift, cam[1](ANGLES), rtol=0, atol=tolerance)


def test_csv_has_every_digit(cam, tmp_path):
    write_contour(tmp_path / "a.csv", cam[2], 100)
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    several = len(cam[2]) > 1
    assert tuple(header.split(",")) == (("disc", *HEADER) if several else HEADER)
    numbers = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    found = numbers[:, int(several) :].reshape(len(cam[2]), 100, 5)
    for table, contour in zip(found, contours(cam[0].follower, cam[1], 100), strict=True):
        np.testing.assert_allclose(np.radians(table[:, 0]), contour.angle, rtol=1e-15)
        np.testing.assert_array_equal(table[:, 1:3].T, 1e3 * contour.points)
        np.testing.assert_array_equal(table[:, 3], 1e3 * contour.radius)
        np.testing.assert_array_equal(table[:, 4], np.degrees(contour.pressure))


def read_svg(path):
    """Paths of a drawing by their names, ``(2, n)`` in mm from its page's corner, y up.

    Also width and height of the page, mm.
    """
    page = ElementTree.parse(path).getroot()
    size = [float(page.get(side).removesuffix("mm")) for side in ("width", "height")]
    assert [float(number) for number in page.get("viewBox").split()] == [0.0, 0.0, *size]
    found = {}
    for drawn in page.iter("{http://www.w3.org/2000/svg}path"):
        start, *words, end = drawn.get("d").split()
        assert (start, end) == ("M", "Z")
        points = np.array([word.split(",") for word in words], dtype=float)
        found[drawn.get("id")] = points.T * [[1.0], [-1.0]]
    return size, found


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_svg_is_true_to_scale_and_within_its_tolerance(cam, tmp_path, tolerance):
    """Read back, each closed path is the polyline to the rounding asked for, on one page.

    The corner of the page is 5 mm beside the cam.
    """
    lines, rounding = lines_of(cam[2], tolerance), 0.1 * tolerance
    write_svg(tmp_path / "a.svg", lines, rounding)
    page, found = read_svg(tmp_path / "a.svg")
    every = 1e3 * np.concatenate(list(lines.values()), axis=1)
    np.testing.assert_allclose(page, np.ptp(every, axis=1) + 10.0, atol=1.0)
    corner = np.array([[every[0].min() - 5.0], [every[1].max() + 5.0]])
    assert list(found) == list(lines)
    for name, line in lines.items():
        off = np.hypot(*(found[name] + corner - 1e3 * line))
        assert off.max() <= 1e3 * rounding


def test_dxf_of_others(tmp_path):
    for unit, factor in [(units.M, 1.0), (units.IN, 0.0254), (units.CM, 0.01)]:
        angle = np.linspace(0.0, 2.0 * np.pi, 80, endpoint=False)
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        document = ezdxf.new("R2010", units=unit)
        space = document.modelspace()
        space.add_lwpolyline(circle[:10])
        space.add_polyline2d(circle.tolist(), close=True)
        spline = space.add_spline(dxfattribs={"layer": "S"})
        spline.set_closed(np.column_stack([circle, 0 * angle]).tolist(), degree=3)
        document.saveas(tmp_path / "b.dxf")
        one, two = read_dxf(tmp_path / "b.dxf")
        np.testing.assert_allclose(one, factor * circle.T, rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.hypot(*two), factor, rtol=2e-3)


def test_arcs_of_a_polyline_are_arcs(tmp_path):
    """A stadium of two straight sides and two half circles (bulge 1), 12 mm round, 30 mm long.

    A face on it stands where the farthest circle's centre puts it: R + |L/2 cos| exactly.
    """
    for kind in ["LWPOLYLINE", "POLYLINE"]:
        document = ezdxf.new("R2010", units=units.MM)
        corners = [(-15.0, -12.0, 0.0), (15.0, -12.0, 1.0), (15.0, 12.0, 0.0), (-15.0, 12.0, 1.0)]
        space = document.modelspace()
        if kind == "LWPOLYLINE":
            space.add_lwpolyline(corners, format="xyb", close=True)
        else:
            space.add_polyline2d(corners, format="xyb", close=True)
        document.saveas(tmp_path / "a.dxf")
        (outline,) = read_dxf(tmp_path / "a.dxf")
        x, y = outline
        off = np.hypot(np.maximum(np.abs(x) - 0.015, 0.0), y) - 0.012
        assert np.abs(off).max() < 2e-9
        height = rest(GuidedFace(0.0, 0.0, 0.0), closed_curve(outline), ANGLES)
        np.testing.assert_allclose(
            height, 0.012 + 0.015 * np.abs(np.sin(ANGLES)), rtol=0, atol=3e-9
        )


def test_a_mirrored_polyline_is_read_where_it_is(tmp_path):
    """CAD mirrors by turning the plane of a polyline over (extrusion −z): x changes its sign."""
    document = ezdxf.new("R2010", units=units.MM)
    corners = [(1.0, 0.0), (2.0, 0.0), (2.0, 1.0)]
    attributes = {"extrusion": (0.0, 0.0, -1.0)}
    document.modelspace().add_lwpolyline(corners, close=True, dxfattribs=attributes)
    document.saveas(tmp_path / "a.dxf")
    (outline,) = read_dxf(tmp_path / "a.dxf")
    np.testing.assert_allclose(outline.T, [(-1e-3, 0.0), (-2e-3, 0.0), (-2e-3, 1e-3)], atol=1e-18)


def test_law_table(tmp_path):
    write_law(tmp_path / "a.csv", np.radians([0.0, 90.0]), np.array([0.0, 0.0125]))
    assert (tmp_path / "a.csv").read_text() == "angle_deg,lift_mm\n0.0,0.0\n90.0,12.5\n"


def test_files_that_are_no_contour(tmp_path):
    for name, text, words in [
        ("a.csv", "", "its columns are none; allowed: among them x_mm and y_mm"),
        ("a.csv", "x,y\n1,2\n", "its columns are x, y; allowed: "),
        ("a.csv", "x_mm,y_mm\n1,2\n3,no\n", "has the row '3,no'; allowed: finite numbers"),
        ("a.csv", "x_mm,y_mm\n1\n", "has the row '1'; allowed: finite numbers"),
        ("a.csv", "x_mm,y_mm\n1,nan\n", "has the row '1,nan'"),
        ("a.csv", "x_mm,y_mm,disc\n1,2\n", "has the row '1,2'; allowed: x_mm,y_mm,disc"),
        ("a.csv", "x_mm,y_mm\n" + "1" * 140_000, "cannot be read (field larger than"),
        ("a.csv", "x_mm,y_mm\n1," + "a" * 100_000, "aaa...; allowed: finite numbers"),
        ("a.csv", "\n" * (8 * 2**20 + 1), "has 8 MiB; allowed: 8 MiB"),
        ("a.dxf", "no drawing", "cannot be read as DXF"),
        ("b.dxf", None, "cannot be read as DXF"),
        ("b.csv", None, "cannot be read"),
    ]:
        path = tmp_path / name
        if text is not None:
            path.write_text(text)
        with pytest.raises(ProfileError, match=re.escape(words)) as caught:
            (read_contour if name.endswith("csv") else read_dxf)(path)
        assert str(caught.value).startswith(f"{path}: ")


def test_dxf_without_a_contour_or_a_unit(tmp_path):
    for unit, words in ((units.MM, "has no closed polyline"), (0, r"its unit \(\$INSUNITS\) is ")):
        ezdxf.new("R2010", units=unit).saveas(tmp_path / "a.dxf")
        with pytest.raises(ProfileError, match=words):
            read_dxf(tmp_path / "a.dxf")
