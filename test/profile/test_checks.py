"""Checks: true extremes, and a refusal with angle, value and limit for a cam that cannot be."""

import re

import numpy as np
import pytest
from shapely import Point, Polygon

from cam_rig.errors import ProfileError
from cam_rig.laws import build_law
from cam_rig.laws.cam import arc_cam
from cam_rig.profile import contours, discs
from cam_rig.profile.check_table import check_cam, require_profile
from cam_rig.profile.checks import least_base_radius, sharpest_concave, sharpest_convex
from cam_rig.profile.contact import Scan, greatest_between

from .conftest import OPPOSITE, UNEVEN, make

#: A lobe that is wider at its end than at its foot, for a thick roller.
LOBE = [("dwell", 125, None), ("cycloidal", 48, 1), ("dwell", 14, None), ("cycloidal", 48, 0)]
NECK = [*LOBE, ("dwell", 125, None)]


def named(made, name):
    return [check for check in check_cam(made.cam, made.law) if check.name == name]


def test_shipped_cams_pass(followed, cams):
    for law in followed.values():
        failed = [str(check) for check in check_cam(cams[law.name], law) if not check.passed]
        assert failed == []
        require_profile(cams[law.name], law)


def test_made_cams_pass(every_kind):
    for made in every_kind:
        assert all(check.passed for check in check_cam(made.cam, made.law))


def test_extremes_are_those_of_a_dense_contour(made):
    """Least radius and greatest pressure angle of 200 000 points, and never beaten by one."""
    for contour in contours(made.cam.follower, made.law, 200_000):
        scan = Scan(made.law, contour.disc.element)
        convex = sharpest_convex(scan)
        dense = contour.radius[contour.radius > 0.0].min()
        assert dense * (1 - 1e-8) <= convex.value <= dense * (1 + 1e-12)
        at = made.contours(np.array([convex.angle]))[made.discs.index(contour.disc)]
        assert at.radius[0] == pytest.approx(convex.value, rel=1e-6)
        steepest = scan.greatest(lambda touch: np.abs(touch.pressure)).value
        dense = np.abs(contour.pressure).max()
        assert dense * (1 - 1e-12) <= steepest <= dense * (1 + 1e-8) + 1e-15


def test_concave_radius_is_pitch_radius_and_roller(cams, laws):
    """On the TM21 cam the flank's circle: its radius on the pitch curve and the roller's."""
    cam, law = cams["tm21"], laws["tm21"]
    flank, _ = arc_cam(cam).radii()
    (contour,) = contours(cam.follower, law, 36)
    found = sharpest_concave(Scan(law, contour.disc.element))
    assert found is not None
    assert found.value == pytest.approx(flank + cam.follower.roller, rel=1e-8)
    start = np.degrees(found.angle)
    assert 122.73 <= start <= 140.71


def test_a_straight_flank_is_not_concave(cams, laws):
    cam, law = cams["arcs_straight"], laws["arcs_straight"]
    (contour,) = contours(cam.follower, law, 3600)
    assert sharpest_concave(Scan(law, contour.disc.element)) is None
    straight = np.isinf(contour.radius)
    assert 20 < straight.sum() < 720
    chord = contour.points[:, straight & (contour.angle < np.pi)]
    (x, y), (dx, dy) = chord - chord[:, :1], chord[:, -1] - chord[:, 0]
    off = (dx * y - dy * x) / np.hypot(dx, dy)
    assert np.abs(off).max() < 1e-12
    assert np.abs(contour.radius[~straight]).max() < 1.0


def test_greatest_between_finds_an_end():
    found = greatest_between(lambda x: x, np.array([0.0, 1.0, 2.0]))
    assert (found.value, found.angle) == (2.0, 2.0)


def test_a_cam_that_cannot_exist_is_refused():
    for kind, numbers, lift, words in [
        ("flat", {"base_radius": 5}, 10, "convex radius of curvature is -3.03"),
        ("roller", {"base_radius": 2, "roller_radius": 60}, 20, "convex radius of curvature is -"),
        ("oscillating_roller", {"roller_radius": 60, "base_radius": 2}, 40, "convex radius"),
        ("oscillating_roller", {"pivot_distance": 60}, 40, "largest radius of the cam is"),
        ("oscillating_roller", {"arm": 45}, 140, "angle of the arm is 1"),
        ("oscillating_flat", {}, 100, "largest radius of the cam is"),
        (
            "conjugate",
            {"roller_distance": 120, "eccentricity": 0},
            70,
            "distance from the axis is -",
        ),
    ]:
        made = make(kind, UNEVEN, lift=lift, **numbers)
        with pytest.raises(ProfileError) as caught:
            require_profile(made.cam, made.law)
        message = str(caught.value)
        assert words in message
        assert re.search(r" at [\d.]+°; allowed: (more|less) than -?[\d.]+( mm|°|); \w", message)
        assert "\n" not in message


def test_out_of_reach_of_the_base_circle():
    for kind, numbers, words in [
        ("roller", {"eccentricity": 48}, "eccentricity is 48 mm; allowed: less than base and rol"),
        ("oscillating_roller", {"arm": 30}, "is 48 mm from the cam's axis; allowed: between 60 an"),
        ("oscillating_flat", {"face_offset": -70}, "is 120 mm; allowed: less than the pivot's"),
    ]:
        made = make(kind, UNEVEN, **numbers)
        with pytest.raises(ProfileError, match=re.escape(words)) as caught:
            check_cam(made.cam, made.law)
        assert str(caught.value).startswith(f"cam '{kind}': ")


def test_a_cam_has_its_shaft_inside():
    """Shapely has the axis outside where the check fails, inside on the base radius it names.

    Down from the base circle and up again, gently: the curvature of each is right.
    """
    for kind, numbers, depth in [
        ("flat", {"base_radius": 12, "eccentricity": 0}, 20),
        ("inclined_flat", {"base_radius": 12, "eccentricity": 0}, 20),
        ("oscillating_flat", {"base_radius": 12, "face_offset": 0}, 20),
        ("roller", {"base_radius": 15, "roller_radius": 8, "eccentricity": 0}, 20),
        ("oscillating_roller", {"base_radius": 15, "roller_radius": 60, "pivot_distance": 120}, 30),
        ("point", {"base_radius": 15, "eccentricity": 0}, 20),
    ]:
        down = [("cycloidal", 180, -1), ("cycloidal", 180, 0)]
        made = make(kind, down, lift=depth, **numbers)
        (contour,) = contours(made.cam.follower, made.law, 3600)
        assert not Polygon(contour.points.T).buffer(0).contains(Point(0.0, 0.0))
        (check,) = named(made, "distance from the axis")
        assert not check.passed
        assert check.vital
        assert check.degrees == pytest.approx(180.0)
        with pytest.raises(
            ProfileError, match=r"axis is -[\d.]+ mm at 180°; allowed: more than 0 mm"
        ):
            require_profile(made.cam, made.law)
        least = least_base_radius(made.cam.follower, made.law)
        assert least is not None
        above = make(kind, down, lift=depth, **numbers | {"base_radius": 1001 * least})
        assert named(above, "distance from the axis")[0].passed
        (contour,) = contours(above.cam.follower, above.law, 3600)
        assert Polygon(contour.points.T).contains(Point(0.0, 0.0))


def test_breadth_condition():
    """s(θ) + s(θ + π) = s_max: the worst angle and how much it lacks."""
    for kind in ["constant_breadth", "constant_diameter"]:
        (check,) = named(make(kind, OPPOSITE), "s(θ) + s(θ + 180°) − s_max")
        assert check.value < 1e-16  # m: rounding
        made = make(kind, UNEVEN)
        (check,) = named(made, "s(θ) + s(θ + 180°) − s_max")
        angle = np.linspace(0.0, 2.0 * np.pi, 100_001)
        off = np.abs(made.law(angle) + made.law(angle + np.pi) - 0.010)
        assert check.value == pytest.approx(off.max(), rel=1e-8)
        assert np.interp(check.angle, angle, off) == pytest.approx(off.max(), rel=1e-6)
        assert check.vital
        assert not check.passed


def test_a_corner_is_refused():
    half = [("dwell", 180, None), ("bezier", 180, None)]
    made = make("point", UNEVEN)
    data = made.cam.model_dump(exclude_none=True)
    ordinates = {"assumed": [0.0, 1.0, 0.0], "unit": "1"}
    data["segments"] = [
        {"law": law, "span": {"assumed": span, "unit": "deg"}}
        | ({"ordinates": ordinates} if law == "bezier" else {})
        for law, span, _ in half
    ]
    cam = type(made.cam).model_validate(data)
    with pytest.raises(ProfileError, match=r"step of the slope s' is 6\.3662 mm/rad at 0°"):
        require_profile(cam, build_law(cam))


def test_a_neck_narrower_than_the_roller():
    """Curvature passes everywhere, yet the two flanks are in each other's way."""
    made = make("roller", NECK, lift=188, base_radius=7, roller_radius=28, eccentricity=0)
    assert named(made, "convex radius of curvature")[0].passed
    (check,) = named(made, "contour across itself")
    assert not check.passed
    assert check.degrees is not None
    assert min(abs(check.degrees - 128.4), abs(check.degrees - 231.6)) < 1.0
    with pytest.raises(ProfileError, match="contour across itself is 1 crossings at"):
        require_profile(made.cam, made.law)


@pytest.mark.long
def test_no_base_radius_is_named_that_would_cut_the_pivot():
    """An arm near its cam: free of undercut only where the cam is at the pivot already."""
    numbers = {"base_radius": 40, "roller_radius": 9, "pivot_distance": 90, "arm": 75}
    far = [("dwell", 90, None), ("cycloidal", 110, 1), ("dwell", 50, None), ("cycloidal", 110, 0)]
    made = make("oscillating_roller", far, lift=200, **numbers)
    (check,) = named(made, "convex radius of curvature")
    assert not check.passed
    assert check.remedy.startswith("no base_radius would do: let the spans be longer")
    assert least_base_radius(made.cam.follower, made.law) is None
    for base in range(41, 130):
        other = make("oscillating_roller", far, lift=200, **numbers | {"base_radius": base})
        try:
            assert any(
                check.vital and not check.passed for check in check_cam(other.cam, other.law)
            )
        except ProfileError:
            return


def test_pressure_angle_limit_is_the_files():
    """30° for a guide, 45° for a pivot, or what the file says; too steep is bad, not impossible."""
    for kind, usual in (("roller", 30.0), ("oscillating_point", 45.0)):
        assert np.degrees(named(make(kind, UNEVEN), "pressure angle")[0].limit) == pytest.approx(
            usual
        )
    made = make("roller", UNEVEN, most_pressure_angle=10)
    (check,) = named(made, "pressure angle")
    assert not check.passed
    require_profile(made.cam, made.law)


def test_least_base_radius_of_a_face_is_eq_2_42():
    """R_b > r_min − min (s + s''), at the true minimum of the sum."""
    made = make("flat", UNEVEN, least_curvature_radius=4)
    angle = np.linspace(0.0, 2.0 * np.pi, 400_001)
    expected = 0.004 - (made.law(angle) + made.law(angle, 2)).min()
    assert least_base_radius(made.cam.follower, made.law) == pytest.approx(expected, rel=1e-9)


@pytest.mark.variants(8)
def test_least_base_radius_is_where_the_cusp_is(made):
    kind = made.cam.follower.type
    segments = OPPOSITE if kind in ("constant_breadth", "constant_diameter") else UNEVEN
    least = least_base_radius(made.cam.follower, made.law)
    assert least is not None
    assert (least == 0.0) == (kind in ("constant_breadth", "constant_diameter"))
    if least == 0.0:
        return
    above = make(kind, segments, base_radius=least * 1e3 * 1.001)
    assert named(above, "convex radius of curvature")[0].value > 0.0
    below = make(kind, segments, base_radius=least * 1e3 * 0.999)
    try:
        undercut = [c for c in named(below, "convex radius of curvature") if c.value <= 0.0]
        low = [c for c in named(below, "distance from the axis") if not c.passed]
    except ProfileError:
        return
    assert undercut or low


def test_the_refusal_names_the_base_radius_that_would_do():
    """For a face it is that of eq. 2.42."""
    made = make("flat", UNEVEN, base_radius=5)
    with pytest.raises(ProfileError, match=r"let base_radius be more than 8\.0371 mm"):
        require_profile(made.cam, made.law)


def test_the_shipped_point_cam_can_be_made(cams, laws):
    cam, law = cams["point"], laws["point"]
    assert all(check.passed for check in check_cam(cam, law))
    assert sharpest_concave(Scan(law, discs(cam.follower, law)[0].element)) is None
