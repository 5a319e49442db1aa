"""The tangent-arc cam: circles that touch, and a law that is their polar radius."""

import mpmath as mp
import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import build_law
from cam_rig.laws.arcs import ConcaveFlankCam

BASE, LIFT = 0.04, 0.01  # m; pitch radius and lift of the cam of these tests
HALF, NOSE_HALF = np.radians(58.0), np.radians(39.0)


@pytest.fixture(scope="module")
def geometry():
    return ConcaveFlankCam(BASE, LIFT, HALF, NOSE_HALF)


@pytest.fixture(scope="module")
def arc_law(make_cam):
    dwell = {"law": "dwell", "span": 122}
    return build_law(
        make_cam(dwell, {"law": "tangent_arcs", "span": 116, "nose_span": 78}, dwell, lift=LIFT)
    )


def centre(arc) -> complex:
    return complex(arc.distance * np.exp(1j * arc.direction))


def test_circles_touch(geometry):
    """Centres stand at the sum of radii apart: base and flank, flank and nose are tangent."""
    flank, nose = geometry.arcs()
    assert abs(centre(flank)) == pytest.approx(BASE + flank.radius, rel=1e-14)
    assert abs(centre(flank) - centre(nose)) == pytest.approx(flank.radius + nose.radius, rel=1e-13)
    assert nose.distance + nose.radius == pytest.approx(BASE + LIFT, rel=1e-15)


def test_joint_has_the_asked_direction(geometry):
    """The point where flank and nose touch is seen from the cam's centre at the nose angle."""
    flank, nose = geometry.arcs()
    towards = (centre(flank) - centre(nose)) / abs(centre(flank) - centre(nose))
    touch = centre(nose) + nose.radius * towards
    assert np.angle(touch) == pytest.approx(-NOSE_HALF, abs=1e-13)


@pytest.mark.parametrize("part", ["flank", "nose"])
def test_pitch_point_lies_on_its_circle(geometry, arc_law, part):
    """The true distance of the pitch point to the arc's centre is the arc's radius."""
    flank, nose = geometry.arcs()
    arc, low, high = (flank, -HALF, -NOSE_HALF) if part == "flank" else (nose, -NOSE_HALF, 0.0)
    angle = np.linspace(low, high, 501)
    point = (BASE + arc_law(np.pi + angle)) * np.exp(1j * angle)
    np.testing.assert_allclose(np.abs(point - centre(arc)), arc.radius, rtol=1e-13)


@pytest.mark.parametrize("part", ["flank", "nose"])
@pytest.mark.parametrize(("order", "tolerance"), [(0, 1e-14), (1, 1e-12), (2, 1e-11), (3, 1e-9)])
def test_law_against_closed_form(geometry, arc_law, part, order, tolerance):
    """s to s''' are those of the ray's intersection with the circle, differentiated in mpmath.

    Relative to the largest value; the fit promises s''' from a series cut at 1e-13, and
    evaluating it from ordinates of s over pieces of 2.4° costs some 4 digits.
    """
    flank, nose = geometry.arcs()
    arc, low, high = (flank, -HALF, -NOSE_HALF) if part == "flank" else (nose, -NOSE_HALF, 0.0)
    sign = -1 if arc.concave else 1

    def radius(x):
        delta = x - mp.mpf(arc.direction)
        across = mp.mpf(arc.distance) * mp.sin(delta)
        along = mp.mpf(arc.distance) * mp.cos(delta)
        return along + sign * mp.sqrt(mp.mpf(arc.radius) ** 2 - across**2) - mp.mpf(BASE)

    angle = np.linspace(low, high, 23)[1:-1]
    with mp.workdps(40):
        expected = np.array([float(mp.diff(radius, mp.mpf(x), order)) for x in angle])
    size = np.abs(expected).max() if order else BASE + LIFT
    np.testing.assert_allclose(
        arc_law(np.pi + angle, order), expected, rtol=0, atol=tolerance * size
    )


def test_smooth_to_first_order_only(geometry, arc_law):
    """At each joint r and r' go on; r'' jumps by R_b(R_b + ρ)/ρ where the flank leaves the base."""
    flank, _ = geometry.arcs()
    assert np.abs(arc_law.jumps(0)).max() < 1e-15
    assert np.abs(arc_law.jumps(1)).max() < 1e-13
    jumps = arc_law.jumps(2)
    start = int(np.argmin(np.abs(arc_law.breaks - (np.pi - HALF))))
    expected = BASE * (BASE + flank.radius) / flank.radius
    assert jumps[start] == pytest.approx(expected, rel=1e-10)
    assert np.count_nonzero(np.abs(jumps) > 1e-6 * expected) == 4  # the four joints of arcs


def test_event_is_symmetric(arc_law):
    """The fall is the rise in a mirror, bit for bit in the ordinates."""
    event = arc_law.ordinates[:, 1:-1]
    np.testing.assert_array_equal(event, event[::-1, ::-1])
    angle = np.linspace(0.0, HALF, 101)
    np.testing.assert_allclose(arc_law(np.pi + angle), arc_law(np.pi - angle), rtol=0, atol=1e-15)


@pytest.mark.parametrize("nose_half", [0.01, 5.0])
def test_impossible_geometry_is_refused(nose_half):
    """No such pair of arcs: the error names all four numbers."""
    with pytest.raises(LawError, match=r"40 mm to lift 10 mm with event half angle 58°"):
        ConcaveFlankCam(BASE, LIFT, HALF, np.radians(nose_half)).radii()
