"""Checks of cams: exact extremes, and errors with angle, value, limit and remedy."""

import re

import numpy as np
import pytest
from shapely import Point, Polygon

from cam_rig.errors import ProfileError
from cam_rig.laws import build_law
from cam_rig.laws.cam import arc_cam
from cam_rig.profile import contours, discs
from cam_rig.profile.cam_checks import check_cam, require_profile
from cam_rig.profile.checks import find_min_base_radius, sharpest_concave, sharpest_convex
from cam_rig.profile.contact import Scan, greatest_between

from ..conftest import dwell
from .conftest import BREADTH, OPPOSITE, UNEVEN, make


def named(sample, name):
    """Return the checks of a sample's contour with this name."""
    return [check for check in check_cam(sample.cam, sample.law) if check.name == name]


def test_possible_cams_pass(followable_laws, cams, every_kind):
    """Shipped cams and a cam of each kind of follower pass all checks of the contour."""
    for name, law in followable_laws.items():
        assert [str(check) for check in check_cam(cams[name], law) if not check.passed] == []
    require_profile(cams["tm21"], followable_laws["tm21"])
    for sample in every_kind:
        assert all(check.passed for check in check_cam(sample.cam, sample.law))


def test_extremes_are_those_of_a_dense_contour(every_kind):
    """Smallest radius and largest pressure angle agree with 50 000 contour points.

    No point exceeds the extreme value.
    """
    for sample in every_kind:
        for number, contour in enumerate(contours(sample.cam.follower, sample.law, 50_000)):
            scan = Scan(sample.law, contour.disc.element)
            convex, dense = sharpest_convex(scan), contour.radius[contour.radius > 0.0].min()
            assert dense * (1 - 2e-7) <= convex.value <= dense * (1 + 1e-12)
            contour_there = sample.contours(np.array([convex.angle]))[number]
            assert contour_there.radius[0] == pytest.approx(convex.value, rel=1e-6)
            steepest = scan.greatest(lambda touch: np.abs(touch.pressure)).value
            dense = np.abs(contour.pressure).max()
            assert dense * (1 - 1e-12) <= steepest <= dense * (1 + 2e-7) + 1e-15
    extreme = greatest_between(lambda x: x, np.array([0.0, 1.0, 2.0]))
    assert (extreme.value, extreme.angle) == (2.0, 2.0)


def test_concave_radius_is_pitch_radius_plus_roller(cams, laws):
    """The concave pitch radius of the TM21's cam is that of its flank plus the roller.

    It is the value of the check of the concave radius, at an angle of the flank. A point follower
    has no limit of this radius.
    """
    cam, law = cams["tm21"], laws["tm21"]
    flank, _ = arc_cam(cam).radii()
    concave = sharpest_concave(Scan(law, discs(cam.follower, law)[0].element))
    assert concave is not None
    assert concave.value == pytest.approx(flank + cam.follower.roller, rel=1e-8)
    assert 122.73 <= np.degrees(concave.angle) <= 140.71
    point = cams["point"], laws["point"]  # a point reaches every concave part
    assert sharpest_concave(Scan(point[1], discs(point[0].follower, point[1])[0].element)) is None


def test_straight_flank_is_not_concave(cams, laws):
    """A straight flank under a roller has no concave radius.

    Its curvature is only rounding error.
    """
    cam, law = cams["arcs_straight"], laws["arcs_straight"]
    (contour,) = contours(cam.follower, law, 3600)
    assert sharpest_concave(Scan(law, contour.disc.element)) is None
    straight = np.isinf(contour.radius)
    assert 20 < straight.sum() < 720
    chord = contour.points[:, straight & (contour.angle < np.pi)]
    (x, y), (dx, dy) = chord - chord[:, :1], chord[:, -1] - chord[:, 0]
    assert np.abs((dx * y - dy * x) / np.hypot(dx, dy)).max() < 1e-12
    assert np.abs(contour.radius[~straight]).max() < 1.0


def test_impossible_cam_is_rejected():
    """A cam that cannot be made raises ProfileError with angle, value and limit.

    The error is one line with a remedy.
    """
    thick = {"roller_radius": 60, "base_radius": 2}
    for kind, numbers, lift, text in (
        ("flat", {"base_radius": 5}, 10, "convex radius of curvature is -3.03"),
        ("roller", thick, 20, "convex radius of curvature is -"),
        ("oscillating_roller", thick, 40, "convex radius"),
        ("oscillating_roller", {"pivot_distance": 60}, 40, "largest radius of the cam is"),
        ("oscillating_roller", {"arm": 45}, 140, "angle of the arm is 1"),
        ("oscillating_flat", {}, 100, "largest radius of the cam is"),
        ("conjugate", {"roller_distance": 120, "eccentricity": 0}, 70, "from the axis is -"),
    ):
        sample = make(kind, lift=lift, **numbers)
        with pytest.raises(ProfileError) as caught:
            require_profile(sample.cam, sample.law)
        message = str(caught.value)
        assert text in message and "\n" not in message
        assert re.search(r" at [\d.]+°; allowed: (more|less) than -?[\d.]+( mm|°|); \w", message)


def test_base_circle_out_of_reach():
    """A follower that cannot reach its base circle raises ProfileError.

    The error contains the name of the cam.
    """
    for kind, numbers, text in (
        ("roller", {"eccentricity": 48}, "eccentricity is 48 mm; allowed: less than base and rol"),
        ("oscillating_roller", {"arm": 30}, "is 48 mm from the cam's axis; allowed: between 60 a"),
        ("oscillating_flat", {"face_offset": -70}, "is 120 mm; allowed: less than the pivot's"),
    ):
        sample = make(kind, **numbers)
        with pytest.raises(ProfileError, match=f"^cam '{kind}': .*{re.escape(text)}"):
            check_cam(sample.cam, sample.law)


def test_cam_surrounds_its_shaft():
    """A cam whose contour does not contain the axis fails a check.

    With the base radius that the error suggests, the contour contains the axis.
    """
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
        sample = make(kind, down, lift=depth, **numbers)
        (contour,) = contours(sample.cam.follower, sample.law, 3600)
        assert not Polygon(contour.points.T).buffer(0).contains(axis)
        (check,) = named(sample, "distance from the axis")
        assert check.is_fatal and not check.passed
        assert check.degrees == pytest.approx(180.0)
        text = r"axis is -[\d.]+ mm at 180°; allowed: more than 0 mm"
        with pytest.raises(ProfileError, match=text):
            require_profile(sample.cam, sample.law)
        least = find_min_base_radius(sample.cam.follower, sample.law)
        assert least is not None
        above = make(kind, down, lift=depth, **numbers | {"base_radius": 1001 * least})
        assert named(above, "distance from the axis")[0].passed
        (contour,) = contours(above.cam.follower, above.law, 3600)
        assert Polygon(contour.points.T).contains(axis)


def test_breadth_condition():
    """The check of a constant-breadth cam has the largest violation and its angle.

    The violation is |s(θ) + s(θ + π) − s_max|, in m.
    """
    name, angle = "s(θ) + s(θ + 180°) − s_max", np.linspace(0.0, 2.0 * np.pi, 100_001)
    for kind in BREADTH:
        (check,) = named(make(kind, OPPOSITE), name)
        assert check.value < 1e-16  # m: rounding
        sample = make(kind)
        (check,) = named(sample, name)
        off = np.abs(sample.law(angle) + sample.law(angle + np.pi) - 0.010)
        assert check.value == pytest.approx(off.max(), rel=1e-8)
        assert np.interp(check.angle, angle, off) == pytest.approx(off.max(), rel=1e-6)
        assert check.is_fatal and not check.passed


def test_corner_is_rejected(make_cam):
    """A law whose slope jumps raises ProfileError with the jump and its angle.

    The contour would have a corner.
    """
    corner = {"law": "bezier", "span": 180, "ordinates": [0.0, 2.0, 0.0]}
    cam = make_cam(dwell(180), corner, lift=0.01)
    with pytest.raises(ProfileError, match=r"step of the slope s' is 12\.732 mm/rad at 0°"):
        require_profile(cam, build_law(cam))


def test_neck_narrower_than_the_roller():
    """A contour that crosses itself at a narrow neck is rejected.

    Its radii of curvature are all sufficient, so they do not detect it.
    """
    lobe = [("cycloidal", 48, 1), ("dwell", 14, None), ("cycloidal", 48, 0)]
    neck = [("dwell", 125, None), *lobe, ("dwell", 125, None)]
    sample = make("roller", neck, lift=188, base_radius=7, roller_radius=28, eccentricity=0)
    assert named(sample, "convex radius of curvature")[0].passed
    (check,) = named(sample, "contour across itself")
    assert not check.passed
    assert min(abs(check.degrees - 128.4), abs(check.degrees - 231.6)) < 1.0
    with pytest.raises(ProfileError, match="contour across itself is 1 crossings at"):
        require_profile(sample.cam, sample.law)


def test_no_base_radius_if_the_cam_cuts_the_pivot():
    """No base radius is suggested if the larger cam would cut the arm's pivot.

    The remedy is then a longer span of the motion.
    """
    numbers = {"base_radius": 40, "roller_radius": 9, "pivot_distance": 90, "arm": 75}
    far = [("dwell", 90, None), ("cycloidal", 110, 1), ("dwell", 50, None), ("cycloidal", 110, 0)]
    sample = make("oscillating_roller", far, lift=200, **numbers)
    (check,) = named(sample, "convex radius of curvature")
    assert not check.passed
    assert check.remedy.startswith("no base_radius would do: let the spans be longer")
    assert find_min_base_radius(sample.cam.follower, sample.law) is None


def test_limit_of_the_pressure_angle():
    """The limit of the pressure angle is 30° for a guide and 45° for a pivot.

    The cam file can state another limit. A cam above the limit is poor, but possible.
    """
    for kind, usual in (("roller", 30.0), ("oscillating_point", 45.0)):
        (check,) = named(make(kind), "pressure angle")
        assert np.degrees(check.limit) == pytest.approx(usual)
    sample = make("roller", most_pressure_angle=10)
    (check,) = named(sample, "pressure angle")
    assert not check.passed
    require_profile(sample.cam, sample.law)


def test_least_base_radius_of_a_face_is_eq_2_42():
    """The minimum base radius of a flat face is r_min − min (s + s'') (eq. 2.42).

    r_min is the smallest allowed radius of curvature. The equation is that of the profile thesis
    (see docs/glossary.md). The error of a smaller base radius states the minimum.
    """
    sample = make("flat", least_curvature_radius=4)
    angle = np.linspace(0.0, 2.0 * np.pi, 400_001)
    expected = 0.004 - (sample.law(angle) + sample.law(angle, 2)).min()
    assert find_min_base_radius(sample.cam.follower, sample.law) == pytest.approx(
        expected, rel=1e-9
    )
    sample = make("flat", base_radius=5)
    with pytest.raises(ProfileError, match=r"let base_radius be more than 8\.0371 mm"):
        require_profile(sample.cam, sample.law)


@pytest.mark.variants(6)
def test_least_base_radius_is_at_the_cusp(sample):
    """The contour is sound at 1.001 of the minimum base radius, and undercut at 0.999.

    At 0.999 the follower may instead be unable to reach the cam, or the axis be outside.
    """
    kind = sample.cam.follower.type
    least = find_min_base_radius(sample.cam.follower, sample.law)
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
