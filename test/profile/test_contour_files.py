"""Contours from tables and drawings of other programs, and their placement."""

import math
import os

import ezdxf
import numpy as np
import pytest
from ezdxf import units
from hypothesis import given, settings
from hypothesis import strategies as st

from cam_rig.errors import CamRigError, ConfigError, ProfileError
from cam_rig.profile import turn_angles
from cam_rig.profile.contour_files import MAX_BYTES, Placement, read_contour_table
from cam_rig.profile.faces import GuidedCentre, GuidedFace
from cam_rig.profile.measure import (
    closed_curve,
    find_rotation,
    require_axis_inside,
    rest_on_contour,
)
from cam_rig.profile.read_dxf import MAX_ENTITIES, read_dxf

ANGLES = turn_angles(90)
CIRCLE = turn_angles(80)
#: Points of an ellipse (mm) around the axis.
X, Y = 30.0 * np.cos(CIRCLE), 20.0 * np.sin(CIRCLE)


@pytest.fixture
def drawing(tmp_path):
    """Function that saves a drawing in DXF and returns its path.

    Its argument is a function that draws into a document.
    """

    def save(draw, version="R2010", unit=units.MM):
        document = ezdxf.new(version, units=unit)
        draw(document)
        document.saveas(tmp_path / "a.dxf")
        return tmp_path / "a.dxf"

    return save


def in_space(method, *args, **kwargs):
    """Return a function that draws one entity into a document by a method of ezdxf."""
    return lambda document: getattr(document.modelspace(), method)(*args, **kwargs)


def height(curve):
    """Return the lift (m) of a flat face on a contour, at the angles `ANGLES`."""
    return rest_on_contour(GuidedFace(0.0, 0.0, 0.0), closed_curve(curve), ANGLES)


# -- drawings


def test_dxf_of_other_programs(drawing):
    """Drawings with other units and kinds of entities give their contour in metres.

    They have old polylines, splines and mirrored entities (extrusion -z).
    """
    circle = np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)])

    def draw(document):
        space = document.modelspace()
        space.add_lwpolyline(2.0 + circle[:10])
        space.add_polyline2d(circle.tolist(), close=True)
        spline = space.add_spline(dxfattribs={"layer": "S"})
        spline.set_closed(np.column_stack([circle, 0 * CIRCLE]).tolist(), degree=3)

    for unit, factor in ((units.M, 1.0), (units.IN, 0.0254), (units.CM, 0.01)):
        found = read_dxf(drawing(draw, unit=unit))
        one, two = found.curves
        np.testing.assert_allclose(one, factor * circle.T, rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.hypot(*two), factor, rtol=2e-3)
        assert any("left out an open curve from" in note for note in found.notes)
    corners, turned = [(1.0, 0.0), (2.0, 0.0), (2.0, 1.0)], {"extrusion": (0.0, 0.0, -1.0)}
    path = drawing(in_space("add_lwpolyline", corners, close=True, dxfattribs=turned))
    (outline,) = read_dxf(path).curves
    np.testing.assert_allclose(outline.T, [(-1e-3, 0.0), (-2e-3, 0.0), (-2e-3, 1e-3)], atol=1e-18)


def stadium_of_bulges(document):
    """Draw a stadium (two half circles and two lines) as a polyline with bulges."""
    corners = [(-15.0, -12.0, 0.0), (15.0, -12.0, 1.0), (15.0, 12.0, 0.0), (-15.0, 12.0, 1.0)]
    document.modelspace().add_lwpolyline(corners, format="xyb", close=True)


def stadium_of_old_bulges(document):
    """Draw a stadium as an old polyline (POLYLINE) with bulges."""
    corners = [(-15.0, -12.0, 0.0), (15.0, -12.0, 1.0), (15.0, 12.0, 0.0), (-15.0, 12.0, 1.0)]
    document.modelspace().add_polyline2d(corners, format="xyb", close=True)


def stadium_of_entities(document):
    """Draw a stadium as lines, arcs and an open polyline."""
    space = document.modelspace()
    space.add_line((15.0, 12.0), (-15.0, 12.0))
    space.add_arc((15.0, 0.0), 12.0, -90.0, 90.0)
    space.add_polyline2d([(-15.0, -12.0), (0.0, -12.0), (15.0, -12.0)])
    space.add_arc((-15.0, 0.0), 12.0, 90.0, 270.0)


def stadium_of_blocks(document):
    """Draw a stadium as a block and its rotated copy."""
    half = document.blocks.new("HALF")
    half.add_line((0.0, 12.0), (15.0, 12.0))
    half.add_arc((15.0, 0.0), 12.0, -90.0, 90.0)
    half.add_line((0.0, -12.0), (15.0, -12.0))
    space = document.modelspace()
    space.add_blockref("HALF", (0.0, 0.0))
    space.add_blockref("HALF", (0.0, 0.0), dxfattribs={"rotation": 180.0})


@pytest.mark.parametrize("version", ["R12", "R2000", "R2018"])
@pytest.mark.parametrize(
    "draw", [stadium_of_bulges, stadium_of_old_bulges, stadium_of_entities, stadium_of_blocks]
)
def test_lines_and_arcs_are_exact_in_each_form(drawing, draw, version):
    """A stadium of lines and arcs is read within 3 nm from each form of a drawing.

    The lift of a flat face on it is R + |L/2 sin θ|, with the end radius R and the straight length
    L.
    """
    if draw is stadium_of_bulges and version == "R12":
        pytest.skip("R12 has no LWPOLYLINE")
    (outline,) = read_dxf(drawing(draw, version), Placement(unit="mm")).curves
    expected = 0.012 + 0.015 * np.abs(np.sin(ANGLES))
    np.testing.assert_allclose(height(outline), expected, rtol=0, atol=3e-9)


def test_circles_and_ellipses_are_exact(drawing):
    """Circles and ellipses of a drawing are read within 3 nm.

    The lift of a flat face is sqrt((a sin)² + (b cos)²) on an ellipse with the half-axes a and b,
    and r + e cos on a circle with the radius r and the eccentricity e.
    """
    path = drawing(in_space("add_ellipse", (0, 0), (30.0, 0.0), 2.0 / 3.0))
    expected = np.hypot(0.030 * np.sin(ANGLES), 0.020 * np.cos(ANGLES))
    np.testing.assert_allclose(height(read_dxf(path).curves[0]), expected, atol=3e-9)
    path = drawing(in_space("add_circle", (0.0, 5.0), 20.0))
    expected = 0.020 + 0.005 * np.cos(ANGLES)
    np.testing.assert_allclose(height(read_dxf(path).curves[0]), expected, atol=3e-9)


def test_rational_splines_are_exact(drawing):
    """Rational splines of a drawing are read within 5 nm.

    They are a circle of 9 control points, and a spline of degree 1.
    """
    corner = math.sqrt(0.5)
    turn = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]

    def draw(document):
        circle = document.modelspace().add_spline(degree=2)
        circle.control_points = [(50.0 * x, 50.0 * y - 20.0, 0.0) for x, y in turn]
        circle.weights = [1.0, corner] * 4 + [1.0]
        circle.knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
        lines = document.modelspace().add_spline(degree=1)
        lines.control_points = [(0.0, 0.0, 0.0), (9.0, 0.0, 0.0), (9.0, 9.0, 0.0), (0.0, 0.0, 0.0)]
        lines.knots = [0, 0, 1, 2, 3, 3]

    circle, lines = read_dxf(drawing(draw)).curves
    expected = 0.050 - 0.020 * np.cos(ANGLES)
    np.testing.assert_allclose(height(circle), expected, rtol=0, atol=5e-9)
    assert np.ptp(np.hypot(circle[0], circle[1] + 0.020)) < 5e-9
    assert np.abs(lines).max() == pytest.approx(0.009, abs=1e-12)


def test_lines_alone_are_points_of_a_smooth_curve(drawing):
    """360 lines of a drawing, in any order and direction, give a smooth contour.

    It equals the contour of a closed polyline of the same points.
    """
    points = np.column_stack([X, Y])
    path = drawing(in_space("add_lwpolyline", points, close=True))
    (expected,) = read_dxf(path).curves

    def draw(document):
        rng = np.random.default_rng(5)
        ends = list(zip(points, np.roll(points, -1, axis=0), strict=True))
        for i in rng.permutation(len(ends)).tolist():
            document.modelspace().add_line(*(ends[i] if rng.random() < 0.5 else ends[i][::-1]))

    (found,) = read_dxf(drawing(draw)).curves
    assert found.shape == expected.shape
    np.testing.assert_allclose(height(found), height(expected), atol=1e-12)


def test_bore_is_left_out_and_layer_selected(drawing):
    """A bore, a frame and dimensions are excluded from a drawing's contours.

    This applies if a number of contours is requested. `layer` selects a layer, and an unknown layer
    is an error with the existing layers.
    """

    def draw(document):
        space = document.modelspace()
        space.add_circle((0.0, 0.0), 5.0)
        space.add_ellipse((0, 0), (30.0, 0.0), 2.0 / 3.0, dxfattribs={"layer": "CAM"})
        space.add_circle((100.0, 0.0), 5.0)
        space.add_lwpolyline([(-99, -99), (200, -99), (200, 99), (-99, 99)], close=True)
        space.add_linear_dim(base=(0, 50), p1=(-30, 0), p2=(30, 0)).render()

    path = drawing(draw)
    found = read_dxf(path, count=2)
    assert len(read_dxf(path).curves) == 4 and len(found.curves) == 2
    assert "2 closed curves left out: frames, or inside of another" in found.notes
    assert len(read_dxf(path, layer="CAM").curves) == 1
    with pytest.raises(ProfileError, match=r"has no layer 'X'; allowed: 0, CAM"):
        read_dxf(path, layer="X")


@pytest.mark.parametrize("is_ambiguous", [False, True])
def test_circle_around_a_cam_is_ambiguous(drawing, is_ambiguous):
    """A circle around an eccentric curve is refused, because either may be the cam.

    A concentric circle or a frame is excluded with a note. `layer` selects the cam.
    """

    def draw(document):
        space = document.modelspace()
        space.add_circle((0.0, 0.0), 80.0, dxfattribs={"layer": "BLANK"})
        space.add_circle((0.0, 0.0), 8.0)
        space.add_lwpolyline([(-99, -99), (120, -99), (120, 99), (-99, 99)], close=True)
        if is_ambiguous:
            space.add_circle((0.0, -20.0), 50.0)

    path = drawing(draw)
    if is_ambiguous:
        with pytest.raises(
            ProfileError, match=r"a closed curve around the axis and, inside of it, .*--l"
        ):
            read_dxf(path, count=1)
    else:
        found = read_dxf(path, count=1)
        assert "2 closed curves left out: frames, or inside of another" in found.notes
    (cam,) = read_dxf(path, layer="0", count=1).curves
    assert height(cam).max() == pytest.approx(0.070 if is_ambiguous else 0.008, abs=1e-8)


def test_contour_inside_of_its_pitch_curve_is_ambiguous(drawing):
    """Two curves that could both be the cam are refused unless `layer` selects one.

    A much smaller inner curve is taken for a bore.
    """

    def draw(document, ratio=0.8):
        space = document.modelspace()
        space.add_ellipse((0, 0), (30.0, 0.0), 0.9, dxfattribs={"layer": "PITCH"})
        space.add_ellipse((0, 0), (30.0 * ratio, 0.0), 0.9, dxfattribs={"layer": "CAM"})

    path = drawing(draw)
    with pytest.raises(ProfileError, match=r"such as a contour inside of its pitch curve; .*--l"):
        read_dxf(path, count=1)
    (cam,) = read_dxf(path, layer="CAM", count=1).curves
    assert np.hypot(*cam).max() == pytest.approx(0.024)
    bore = read_dxf(drawing(lambda document: draw(document, ratio=0.4)), count=1)
    assert np.hypot(*bore.curves[0]).max() == pytest.approx(0.030)


def test_entities_drawn_twice_count_once(drawing):
    """A line drawn twice, in any direction, does not open the outline."""
    corners = [(-30.0, -20.0), (30.0, -20.0), (0.0, 40.0)]

    def draw(document):
        space = document.modelspace()
        for i, corner in enumerate(corners):
            space.add_line(corner, corners[i - 1])
        space.add_line(corners[-1], corners[0])
        space.add_line(corners[0], corners[-1])

    contour = read_dxf(drawing(draw))
    assert len(contour.curves) == 1
    assert "2 entities ignored: drawn twice" in contour.notes


def test_hidden_entities_are_ignored(drawing):
    """Entities that are invisible or on hidden layers are ignored with a note.

    `layer` reads a hidden layer.
    """

    def draw(document, visible=True):
        document.layers.add("OFF").off()
        document.layers.add("FROZEN").freeze()
        document.blocks.new("B").add_circle((0.0, 0.0), 50.0)
        space = document.modelspace()
        if visible:
            space.add_circle((0.0, 0.0), 20.0)
        space.add_circle((0.0, 0.0), 30.0, dxfattribs={"layer": "off"})
        space.add_circle((0.0, 0.0), 40.0, dxfattribs={"layer": "FROZEN"})
        space.add_blockref("B", (0.0, 0.0), dxfattribs={"layer": "OFF"})
        space.add_circle((0.0, 0.0), 60.0, dxfattribs={"invisible": 1})

    path, note = drawing(draw), "4 entities ignored: invisible, or on a layer that is off or frozen"
    found = read_dxf(path)
    assert len(found.curves) == 1 and np.hypot(*found.curves[0]) == pytest.approx(0.020)
    assert any(note in text for text in found.notes)
    (frozen,) = read_dxf(path, layer="FROZEN").curves
    assert np.hypot(*frozen) == pytest.approx(0.040)
    with pytest.raises(ProfileError, match=f"no closed curve: .*{note}"):
        read_dxf(drawing(lambda document: draw(document, visible=False)))


def test_curves_that_are_not_plane_are_refused(drawing):
    """A contour entity whose z varies is refused with its kind and layer.

    Other entities may have any z.
    """
    turn, lift = np.column_stack([X, Y]), 2.0 * np.cos(CIRCLE)
    points = np.column_stack([turn, lift])
    ends = list(zip(points.tolist(), np.roll(points, -1, axis=0).tolist(), strict=True))

    def lines(document):
        for pair in ends:
            document.modelspace().add_line(*pair)

    def spline(document):
        document.modelspace().add_spline().set_closed(points.tolist(), degree=3)

    tilted = {"layer": "CAM", "extrusion": (0.0, -0.01, 1.0)}
    for draw, kind in (
        (in_space("add_circle", (0.0, 0.0), 20.0, dxfattribs=tilted), "CIRCLE of layer 'CAM'"),
        (in_space("add_polyline3d", points.tolist(), close=True), "POLYLINE of layer '0'"),
        (lines, "LINE of layer '0'"),
        (spline, "SPLINE of layer '0'"),
    ):
        with pytest.raises(ProfileError, match=f"{kind} is not parallel to the xy plane: its z"):
            read_dxf(drawing(draw))

    def flat(document):
        level = np.column_stack([turn, 0.0 * CIRCLE + 5.0])
        document.modelspace().add_polyline3d(level.tolist(), close=True)
        document.modelspace().add_line((0.0, 0.0, -9.0), (0.0, 0.0, 9.0))

    assert len(read_dxf(drawing(flat)).curves) == 1


def test_drawing_without_a_contour(drawing):
    """A drawing without a closed curve is refused with its kinds of entities."""

    def draw(document):
        for i in range(3):
            document.modelspace().add_line((10.0 * i, 0.0), (10.0 * i, 30.0))
        document.modelspace().add_text("CAM 7")

    words = r"no closed curve: its model space has 3 LINE, 1 TEXT; allowed: .* 3 open curves, one "
    with pytest.raises(ProfileError, match=words):
        read_dxf(drawing(draw))


def test_drawing_without_a_header_has_no_unit(tmp_path):
    """A drawing without a header, as OpenSCAD writes it, is refused without `--unit`."""
    path = tmp_path / "entities.dxf"
    circle = "0\nCIRCLE\n8\n0\n10\n0.0\n20\n0.0\n40\n2.0\n"
    path.write_text(f"0\nSECTION\n2\nENTITIES\n{circle}0\nENDSEC\n0\nEOF\n")
    with pytest.raises(ProfileError, match=r"unit .* is not stated; allowed: .* or --unit mm, cm"):
        read_dxf(path)
    (outline,) = read_dxf(path, Placement(unit="in")).curves
    assert np.hypot(*outline) == pytest.approx(0.0508, abs=1e-9)


def test_drawing_without_a_unit(drawing):
    """A drawing without a unit requires `--unit`.

    The option cannot replace the unit of a drawing that has one.
    """
    circle = in_space("add_circle", (0.0, 0.0), 2.0)
    path = drawing(circle, "R12", unit=0)
    with pytest.raises(ProfileError, match=r"unit .* is not stated; allowed: .* or --unit mm, cm"):
        read_dxf(path)
    (outline,) = read_dxf(path, Placement(unit="in")).curves
    assert np.hypot(*outline) == pytest.approx(0.0508, abs=1e-9)
    with pytest.raises(ProfileError, match=r"unit .* is mm, not in"):
        read_dxf(drawing(circle), Placement(unit="in"))
    with pytest.raises(ProfileError, match=r"unit .* is .*; allowed: millimetres"):
        read_dxf(drawing(circle, unit=units.KM))


def test_excessive_files_are_rejected(drawing, tmp_path):
    """Devices, excessively large numbers and files, and damaged blocks are rejected.

    Each error is one line.
    """

    def nested(document):
        block = document.blocks.new("A")
        block.add_circle((0.0, 0.0), 1.0)
        for name in "BCDEFG":
            outer = document.blocks.new(name)
            for i in range(10):
                outer.add_blockref(chr(ord(name) - 1), (i, 0.0))
        document.modelspace().add_blockref("G", (0.0, 0.0))

    def empty(document):
        document.blocks.new("E")
        spaced = {"row_count": 1000, "column_count": 1000, "row_spacing": 1, "column_spacing": 1}
        document.modelspace().add_blockref("E", (0.0, 0.0), dxfattribs=spaced)

    os.mkfifo(tmp_path / "pipe.dxf")
    (tmp_path / "large.dxf").write_bytes(b"0\n" * MAX_BYTES)
    (tmp_path / "no.dxf").write_text("no drawing")
    whole = drawing(in_space("add_circle", (0.0, 0.0), 2.0)).read_bytes()
    (tmp_path / "cut.dxf").write_bytes(whole[:4000])
    bulge = [(0.0, 0.0, 1e6), (8.0, 0.0, 0.0), (8.0, 8.0, 0.0)]
    for path, words in (
        (tmp_path / "pipe.dxf", "is a pipe or a device"),
        (tmp_path / "large.dxf", "MiB; allowed: 8 MiB"),
        (tmp_path / "no.dxf", "cannot be read as DXF"),
        (tmp_path / "cut.dxf", r"cannot be read as DXF \(\w+"),
        (tmp_path / "none.dxf", "none.dxf: no such file$"),
    ):
        with pytest.raises(ProfileError, match=words):
            read_dxf(path)
    for draw, words in (
        (nested, f"more than {MAX_ENTITIES} entities"),
        (empty, f"more than {MAX_ENTITIES} entities"),
        (in_space("add_lwpolyline", bulge, format="xyb", close=True), "no finite points within"),
        (in_space("add_circle", (0.0, 0.0), 1e300), "no finite points within"),
        (in_space("add_circle", (0.0, 0.0), math.nan), "no finite points within|cannot be read"),
        (in_space("add_circle", (0.0, 0.0), 1e-6), "reaches 1e-09 m"),
        (in_space("add_line", (0.0, 0.0), (1.0, 0.0)), "no closed curve"),
    ):
        with pytest.raises(ProfileError, match=words):
            read_dxf(drawing(draw))


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_damaged_drawings_are_read_or_refused_in_one_line(tmp_path_factory, data):
    """A randomly damaged drawing is read with finite points, or refused in one line."""
    path = tmp_path_factory.getbasetemp() / "damaged.dxf"
    document = ezdxf.new("R2010", units=units.MM)
    stadium_of_blocks(document)
    document.saveas(path)
    lines = path.read_bytes().split(b"\n")
    words = st.sampled_from(
        [b"nan", b"inf", b"1e308", b"-1", b"", b"LINE", b"0", b"INSERT", b"\xff"]
    )
    for _ in range(data.draw(st.integers(1, 4))):
        lines[data.draw(st.integers(0, len(lines) - 1))] = data.draw(words)
    cut = data.draw(st.one_of(st.none(), st.integers(1, len(lines))))
    path.write_bytes(b"\n".join(lines[:cut]))
    try:
        found = read_dxf(path)
    except CamRigError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert all(np.isfinite(curve).all() for curve in found.curves)


# -- tables


def table(heading, columns, separator=",", mark="."):
    """Return a table as text, with a separator and a decimal mark."""
    rows = [
        separator.join(f"{x:.6f}".replace(".", mark) for x in row)
        for row in zip(*columns, strict=True)
    ]
    return "\n".join([heading, *rows]) + "\n"


POLAR = (np.degrees(np.arctan2(X, Y)) % 360.0, np.hypot(X, Y))
TABLES = {
    "own": table("x_mm,y_mm", (X, Y)),
    "semicolons": table("X [mm];Y [mm]", (X, Y), ";", ","),
    "inches": table("X (in),Y (in)", (X / 25.4, Y / 25.4)),
    "micrometres": table("X [1/1000 mm]\tY [1/1000 mm]", (1e3 * X, 1e3 * Y), "\t"),
    "units below": table("x;y\nmm;mm", (X, Y), ";", ","),
    "three coordinates": table("x_mm,y_mm,z_mm", (X, Y, 0.0 * X)),
    "other columns": table("angle_deg,x_mm,y_mm,curvature_radius_mm", (POLAR[0], X, Y, X)),
    "polar": table("angle_deg,radius_mm", POLAR),
    "polar radians": table(
        "theta (rad) r (mm)".replace(" r", ";r"), (np.radians(POLAR[0]), POLAR[1]), ";"
    ),
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_contour_tables_in_many_forms(tmp_path, text):
    """Tables in each of their usual formats give the same points.

    They differ in separator, decimal mark, unit, factor and coordinates.
    """
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    (points,) = read_contour_table(tmp_path / "a.csv").curves
    np.testing.assert_allclose(points, 1e-3 * np.array([X, Y]), rtol=0, atol=3e-8)


def test_missing_unit_is_assumed_or_given(tmp_path):
    """A table without a unit is read in the given unit, or else in mm with a note.

    A given unit that contradicts the table is refused.
    """
    (tmp_path / "a.csv").write_text(table("x,y", (X, Y)))
    found = read_contour_table(tmp_path / "a.csv")
    assert "no unit of length in 'y': mm assumed" in found.notes
    given_cm = read_contour_table(tmp_path / "a.csv", Placement(unit="cm"))
    np.testing.assert_allclose(given_cm.curves[0], 10.0 * found.curves[0])
    (tmp_path / "a.csv").write_text(table("x_in,y_in", (X, Y)))
    given_in = read_contour_table(tmp_path / "a.csv", Placement(unit="in"))
    np.testing.assert_allclose(given_in.curves[0], 25.4 * found.curves[0])
    with pytest.raises(ConfigError, match=r"'y_in' has another unit than mm; allowed: --unit for"):
        read_contour_table(tmp_path / "a.csv", Placement(unit="mm"))


def test_polar_points_are_placed_like_x_and_y(tmp_path):
    """Polar points are placed like the same points in x and y.

    The placement has an axis, a zero direction and mirroring. The tolerance is 3e-8 m.
    """
    x, y = X + 5.0, Y - 3.0
    (tmp_path / "xy.csv").write_text(table("x_mm,y_mm", (x, y)))
    polar = (np.degrees(np.arctan2(x, y)) % 360.0, np.hypot(x, y))
    (tmp_path / "polar.csv").write_text(table("angle_deg,radius_mm", polar))
    for placement in (
        Placement(axis=(0.005, -0.003)),
        Placement(zero=0.3),
        Placement(is_mirrored=True),
        Placement(axis=(0.005, -0.003), zero=4.0, is_mirrored=True),
    ):
        (expected,) = read_contour_table(tmp_path / "xy.csv", placement).curves
        (points,) = read_contour_table(tmp_path / "polar.csv", placement).curves
        np.testing.assert_allclose(closest(points, expected), 0.0, atol=3e-8)


def closest(points, others):
    """Return the distance of each point from the closest of other points."""
    return np.hypot(*(points[:, :, None] - others[:, None])).min(axis=1)


def test_polar_rows_are_sorted_and_crank_angles_halved(tmp_path):
    """Shuffled rows of polar points give the contour of sorted rows, with a note.

    Crank angles, of which a cam turn has 720°, are halved.
    """
    angle, radius = 4.5 * np.arange(80), 30.0 + np.cos(CIRCLE)
    (tmp_path / "a.csv").write_text(table("angle_deg,radius_mm", (angle, radius)))
    (expected,) = read_contour_table(tmp_path / "a.csv").curves
    mixed = np.random.default_rng(2).permutation(80)
    (tmp_path / "a.csv").write_text(table("angle_deg,radius_mm", (angle[mixed], radius[mixed])))
    found = read_contour_table(tmp_path / "a.csv")
    np.testing.assert_array_equal(found.curves[0], expected)
    assert "rows sorted by angle" in found.notes
    (tmp_path / "a.csv").write_text(table("crank deg,radius mm", (2.0 * angle, radius)))
    found = read_contour_table(tmp_path / "a.csv")
    np.testing.assert_allclose(found.curves[0], expected, rtol=0, atol=1e-15)
    assert any("angle of the crank" in note and "halved" in note for note in found.notes)


def test_tables_without_a_contour_are_rejected(tmp_path):
    """A table that contains no contour raises an error of one line.

    It has the file name and the fault.
    """
    turns = "".join(f"{angle},30\n" for angle in range(0, 720, 10))
    for name, text, words in (
        ("a.csv", "", "is empty; allowed: a heading and"),
        ("a.csv", "1,2\n3,4\n", "has no heading above numbers"),
        ("a.csv", "angle_deg,lift_mm\n1,2\n", "its columns are angle_deg, lift_mm; allowed: among"),
        ("a.csv", "x_mm,y_in\n1,2\n", "'x_mm' and 'y_in' have different units"),
        ("a.csv", "x_mm,y_mm\n1,2\n3,no\n", "line 3: y_mm is 'no'; allowed: a number"),
        ("a.csv", "x_mm,y_mm\n1,2\n3,\n", "line 3: has the row '3,'; allowed: finite numbers"),
        ("a.csv", "x,y,z\n1,2,5\n3,4,5.002\n", "line 3: 'z' differs by 0.002 mm from the first"),
        ("a.csv", "deg,r\n" + turns, "angles cover 710 deg; allowed: one turn"),
        (
            "a.csv",
            "deg,r\n0,3\n9,4\n18,4\n0,5\n9,5\n",
            "the angle 0 deg has several radii, and the rows",
        ),
        ("a.csv", "x_mm,y_mm\n1,2\n3\n", "line 3: has 1 cells under 2 columns"),
        ("a.csv", "x_mm,y_mm\n1e9,2\n3,4\n", "reaches 1e+06 m from the cam's axis"),
        ("a.csv", "x_mm,y_mm\n" + "1" * 140_000, "cannot be read (field larger than"),
        ("a.csv", "\n" * (MAX_BYTES + 1), "has 8 MiB; allowed: 8 MiB"),
        ("b.csv", None, "no such file"),
    ):
        path = tmp_path / name
        if text is not None:
            path.write_text(text)
        with pytest.raises((ConfigError, ProfileError)) as caught:
            read_contour_table(path)
        assert words in str(caught.value) and name in str(caught.value)


# -- placement


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(0.0, 360.0), st.booleans())
def test_placement_restores_the_contour(x, y, zero, is_mirrored):
    """A placement undoes shift, rotation and mirroring of a contour in a file.

    The tolerance is 1e-15 m.
    """
    cam = 1e-3 * np.array([X, Y])
    drawn = cam[0] + 1j * cam[1]
    drawn = -drawn.conj() if is_mirrored else drawn
    drawn = drawn * np.exp(1j * (math.radians(zero) - 0.5 * math.pi)) + 1e-3 * (x + 1j * y)
    placement = Placement(None, (1e-3 * x, 1e-3 * y), math.radians(zero), is_mirrored)
    points = placement.place(np.array([drawn.real, drawn.imag]))
    np.testing.assert_allclose(points, cam, atol=1e-15)
    np.testing.assert_allclose(placement.in_file(points), [drawn.real, drawn.imag], atol=1e-15)


def test_axis_outside_of_the_contour_is_refused():
    """A contour that does not surround the axis is refused with a remedy.

    The error states axis and contour in coordinates of the file.
    """
    points = 1e-3 * np.array([X + 120.0, Y + 80.0])
    placement = Placement(None, (0.12, 0.08), 1.0, True)
    require_axis_inside(placement.place(points), placement)
    wrong = Placement(None, (0.1, 0.06), 1.0, True)
    words = (
        r"axis of the cam \(100, 60 mm\) is outside .* \(x 90 to 150, y 60 to 100 mm\); .*--axis"
    )
    with pytest.raises(ProfileError, match=words):
        require_axis_inside(wrong.place(points), wrong)
    with pytest.raises(ProfileError, match=r"\(x -15 to 15, y 5 to 5 mm\) encloses no area"):
        require_axis_inside(1e-3 * np.array([np.arange(-15, 16), np.full(31, 5.0)]), Placement())


@pytest.mark.parametrize("turned", [0.0, 0.3, 123.456, 359.9])
def test_align_finds_the_rotation(laws, turned):
    """`find_rotation` finds by how much a contour is rotated relative to its law.

    The tolerance is 1e-7 rad.
    """
    law, element = laws["poly345"], GuidedCentre(0.0, 0.0, 0.05)
    angle = turn_angles(7200)
    radius = 0.05 + law(angle + math.radians(turned))
    contour = closed_curve(radius * np.array([np.sin(angle), np.cos(angle)]))
    rotation, error = find_rotation(element, contour, law)
    away = (rotation + math.radians(turned) + math.pi) % (2.0 * math.pi) - math.pi
    assert abs(away) < 1e-7
    assert error < 1e-3
