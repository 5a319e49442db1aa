"""Checks: true extremes, and a refusal with angle, value and limit for a cam that cannot be."""

import re

import numpy as np
import pytest
from shapely import Point, Polygon

from cam_rig.errors import ProfileError
from cam_rig.laws import build_law
from cam_rig.laws.cam import arc_cam
from cam_rig.profile import contours, discs
from cam_rig.profile.cam_checks import check_cam, require_profile
from cam_rig.profile.checks import least_base_radius, sharpest_concave, sharpest_convex
from cam_rig.profile.contact import Scan, greatest_between

from ..conftest import dwell
from .conftest import BREADTH, OPPOSITE, UNEVEN, make


def named(made, name):
    return [check for check in check_cam(made.cam, made.law) if check.name == name]


def test_cams_that_can_be_made_pass(followed, cams, every_kind):
    for name, law in followed.items():
        assert [str(check) for check in check_cam(cams[name], law) if not check.passed] == []
    require_profile(cams["tm21"], followed["tm21"])
    for made in every_kind:
        assert all(check.passed for check in check_cam(made.cam, made.law))


def test_extremes_are_those_of_a_dense_contour(every_kind):
    """Least radius and greatest pressure angle of 50 000 points, and never beaten by one."""
    for made in every_kind:
        for number, contour in enumerate(contours(made.cam.follower, made.law, 50_000)):
            scan = Scan(made.law, contour.disc.element)
            convex, dense = sharpest_convex(scan), contour.radius[contour.radius > 0.0].min()
            assert dense * (1 - 2e-7) <= convex.value <= dense * (1 + 1e-12)
            at = made.contours(np.array([convex.angle]))[number]
            assert at.radius[0] == pytest.approx(convex.value, rel=1e-6)
            steepest = scan.greatest(lambda touch: np.abs(touch.pressure)).value
            dense = np.abs(contour.pressure).max()
            assert dense * (1 - 1e-12) <= steepest <= dense * (1 + 2e-7) + 1e-15
    found = greatest_between(lambda x: x, np.array([0.0, 1.0, 2.0]))
    assert (found.value, found.angle) == (2.0, 2.0)


def test_concave_radius_is_pitch_radius_and_roller(cams, laws):
    """On the TM21 cam the flank's circle: its radius on the pitch curve and the roller's."""
    cam, law = cams["tm21"], laws["tm21"]
    flank, _ = arc_cam(cam).radii()
    found = sharpest_concave(Scan(law, discs(cam.follower, law)[0].element))
    assert found is not None
    assert found.value == pytest.approx(flank + cam.follower.roller, rel=1e-8)
    assert 122.73 <= np.degrees(found.angle) <= 140.71
    point = cams["point"], laws["point"]  # an edge with any radius gets everywhere
    assert sharpest_concave(Scan(point[1], discs(point[0].follower, point[1])[0].element)) is None


def test_a_straight_flank_is_not_concave(cams, laws):
    """A straight line under a roller: what is left of its curvature is rounding, so no radius."""
    cam, law = cams["arcs_straight"], laws["arcs_straight"]
    (contour,) = contours(cam.follower, law, 3600)
    assert sharpest_concave(Scan(law, contour.disc.element)) is None
    straight = np.isinf(contour.radius)
    assert 20 < straight.sum() < 720
    chord = contour.points[:, straight & (contour.angle < np.pi)]
    (x, y), (dx, dy) = chord - chord[:, :1], chord[:, -1] - chord[:, 0]
    assert np.abs((dx * y - dy * x) / np.hypot(dx, dy)).max() < 1e-12
    assert np.abs(contour.radius[~straight]).max() < 1.0


def test_a_cam_that_cannot_exist_is_refused():
    """The line has the angle, the value, the limit and a remedy."""
    thick = {"roller_radius": 60, "base_radius": 2}
    for kind, numbers, lift, words in (
        ("flat", {"base_radius": 5}, 10, "convex radius of curvature is -3.03"),
        ("roller", thick, 20, "convex radius of curvature is -"),
        ("oscillating_roller", thick, 40, "convex radius"),
        ("oscillating_roller", {"pivot_distance": 60}, 40, "largest radius of the cam is"),
        ("oscillating_roller", {"arm": 45}, 140, "angle of the arm is 1"),
        ("oscillating_flat", {}, 100, "largest radius of the cam is"),
        ("conjugate", {"roller_distance": 120, "eccentricity": 0}, 70, "from the axis is -"),
    ):
        made = make(kind, lift=lift, **numbers)
        with pytest.raises(ProfileError) as caught:
            require_profile(made.cam, made.law)
        message = str(caught.value)
        assert words in message and "\n" not in message
        assert re.search(r" at [\d.]+°; allowed: (more|less) than -?[\d.]+( mm|°|); \w", message)


def test_out_of_reach_of_the_base_circle():
    """No contour to speak of: refused at once, by the cam's name."""
    for kind, numbers, words in (
        ("roller", {"eccentricity": 48}, "eccentricity is 48 mm; allowed: less than base and rol"),
        ("oscillating_roller", {"arm": 30}, "is 48 mm from the cam's axis; allowed: between 60 a"),
        ("oscillating_flat", {"face_offset": -70}, "is 120 mm; allowed: less than the pivot's"),
    ):
        made = make(kind, **numbers)
        with pytest.raises(ProfileError, match=f"^cam '{kind}': .*{re.escape(words)}"):
            check_cam(made.cam, made.law)


def test_a_cam_has_its_shaft_inside():
    """Shapely has the axis outside where the check fails, inside on the base radius it names."""
    down, axis = [("cycloidal", 180, -1), ("cycloidal", 180, 0)], Point(0.0, 0.0)
    far = {"base_radius": 15, "roller_radius": 60, "pivot_distance": 120}
    for kind, depth, numbers in (
        ("flat", 20, {"base_radius": 12, "eccentricity": 0}),
        ("inclined_flat", 20, {"base_radius": 12, "eccentricity": 0}),
        ("oscillating_flat", 20, {"base_radius": 12, "face_offset": 0}),
        ("roller", 20, {"base_radius": 15, "roller_radius": 8, "eccentricity": 0}),
        ("oscillating_roller", 30, far),
        ("point", 20, {"base_radius": 15, "eccentricity": 0}),
    ):
        made = make(kind, down, lift=depth, **numbers)
        (contour,) = contours(made.cam.follower, made.law, 3600)
        assert not Polygon(contour.points.T).buffer(0).contains(axis)
        (check,) = named(made, "distance from the axis")
        assert check.vital and not check.passed
        assert check.degrees == pytest.approx(180.0)
        words = r"axis is -[\d.]+ mm at 180°; allowed: more than 0 mm"
        with pytest.raises(ProfileError, match=words):
            require_profile(made.cam, made.law)
        least = least_base_radius(made.cam.follower, made.law)
        assert least is not None
        above = make(kind, down, lift=depth, **numbers | {"base_radius": 1001 * least})
        assert named(above, "distance from the axis")[0].passed
        (contour,) = contours(above.cam.follower, above.law, 3600)
        assert Polygon(contour.points.T).contains(axis)


def test_breadth_condition():
    """s(θ) + s(θ + π) = s_max: the worst angle and how much it lacks."""
    name, angle = "s(θ) + s(θ + 180°) − s_max", np.linspace(0.0, 2.0 * np.pi, 100_001)
    for kind in BREADTH:
        (check,) = named(make(kind, OPPOSITE), name)
        assert check.value < 1e-16  # m: rounding
        made = make(kind)
        (check,) = named(made, name)
        off = np.abs(made.law(angle) + made.law(angle + np.pi) - 0.010)
        assert check.value == pytest.approx(off.max(), rel=1e-8)
        assert np.interp(check.angle, angle, off) == pytest.approx(off.max(), rel=1e-6)
        assert check.vital and not check.passed


def test_a_corner_is_refused(make_cam):
    corner = {"law": "bezier", "span": 180, "ordinates": [0.0, 2.0, 0.0]}
    cam = make_cam(dwell(180), corner, lift=0.01)
    with pytest.raises(ProfileError, match=r"step of the slope s' is 12\.732 mm/rad at 0°"):
        require_profile(cam, build_law(cam))


def test_a_neck_narrower_than_the_roller():
    """Curvature passes everywhere, yet the two flanks are in each other's way."""
    lobe = [("cycloidal", 48, 1), ("dwell", 14, None), ("cycloidal", 48, 0)]
    neck = [("dwell", 125, None), *lobe, ("dwell", 125, None)]
    made = make("roller", neck, lift=188, base_radius=7, roller_radius=28, eccentricity=0)
    assert named(made, "convex radius of curvature")[0].passed
    (check,) = named(made, "contour across itself")
    assert not check.passed
    assert min(abs(check.degrees - 128.4), abs(check.degrees - 231.6)) < 1.0
    with pytest.raises(ProfileError, match="contour across itself is 1 crossings at"):
        require_profile(made.cam, made.law)


def test_no_base_radius_is_named_that_would_cut_the_pivot():
    """An arm near its cam: free of undercut only where the cam is at the pivot already."""
    numbers = {"base_radius": 40, "roller_radius": 9, "pivot_distance": 90, "arm": 75}
    far = [("dwell", 90, None), ("cycloidal", 110, 1), ("dwell", 50, None), ("cycloidal", 110, 0)]
    made = make("oscillating_roller", far, lift=200, **numbers)
    (check,) = named(made, "convex radius of curvature")
    assert not check.passed
    assert check.remedy.startswith("no base_radius would do: let the spans be longer")
    assert least_base_radius(made.cam.follower, made.law) is None


def test_pressure_angle_limit_is_the_files():
    """30° for a guide, 45° for a pivot, or what the file says; too steep is bad, not impossible."""
    for kind, usual in (("roller", 30.0), ("oscillating_point", 45.0)):
        (check,) = named(make(kind), "pressure angle")
        assert np.degrees(check.limit) == pytest.approx(usual)
    made = make("roller", most_pressure_angle=10)
    (check,) = named(made, "pressure angle")
    assert not check.passed
    require_profile(made.cam, made.law)


def test_least_base_radius_of_a_face_is_eq_2_42():
    """R_b > r_min − min (s + s''), at the true minimum of the sum; a refusal names it."""
    made = make("flat", least_curvature_radius=4)
    angle = np.linspace(0.0, 2.0 * np.pi, 400_001)
    expected = 0.004 - (made.law(angle) + made.law(angle, 2)).min()
    assert least_base_radius(made.cam.follower, made.law) == pytest.approx(expected, rel=1e-9)
    made = make("flat", base_radius=5)
    with pytest.raises(ProfileError, match=r"let base_radius be more than 8\.0371 mm"):
        require_profile(made.cam, made.law)


@pytest.mark.variants(6)
def test_least_base_radius_is_where_the_cusp_is(made):
    """A thousandth above it no part is undercut; below it one is, or nothing is reached."""
    kind = made.cam.follower.type
    least = least_base_radius(made.cam.follower, made.law)
    assert least is not None
    assert (least == 0.0) == (kind in BREADTH)
    if least == 0.0:
        return
    above = make(kind, UNEVEN, base_radius=least * 1e3 * 1.001)
    assert named(above, "convex radius of curvature")[0].value > 0.0
    below = make(kind, UNEVEN, base_radius=least * 1e3 * 0.999)
    try:
        undercut = [c for c in named(below, "convex radius of curvature") if c.value <= 0.0]
        low = [c for c in named(below, "distance from the axis") if not c.passed]
    except ProfileError:
        return
    assert undercut or low
