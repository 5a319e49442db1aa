"""Cams of tangent arcs: contours, and laws of followers measured on the contour."""

import cmath
from types import SimpleNamespace

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import Law, build_law
from cam_rig.laws.arc_law import ArcFollower, arc_follower, arc_pieces
from cam_rig.laws.arcs import Blend, Circle, ConcaveFlankCam, StraightLine, close_chain
from cam_rig.laws.bernstein import join_pieces
from cam_rig.laws.law import continuity
from cam_rig.units import TURN

from ..conftest import assumed, dwell

BASE, LIFT, NOSE = 0.025, 0.01, 0.012
BASE_CIRCLE, NOSE_CIRCLE = Circle(0j, BASE), Circle(-(BASE + LIFT - NOSE) + 0j, NOSE)
FLANKS = {"convex": Blend(0.08), "straight": Blend(None), "concave": Blend(-0.06)}
FOLLOWERS = {
    "roller": ArcFollower(False, 0.008),
    "point": ArcFollower(False, 0.0),
    "flat": ArcFollower(True, 0.0),
}
CASES = [(flank, kind) for flank in FLANKS for kind in ("roller", "point")] + [("convex", "flat")]


def chain_of(flank):
    return close_chain([BASE_CIRCLE, flank, NOSE_CIRCLE, flank])


def law_of(chain, follower):
    breaks, columns = arc_pieces(chain, BASE, follower)
    return Law("arcs", np.array(breaks), join_pieces(columns))


# Contours: every part touches the next, and blends fit between their neighbours.


def test_blends_touch_their_neighbours():
    """A blend has the requested radius and touches both neighbouring arcs.

    The sign of the radius turns the normal, and equal blends are mirror images.
    """
    chain = close_chain([BASE_CIRCLE, Blend(0.08), NOSE_CIRCLE, Blend(-0.06)])
    assert [part.radius for part in chain.parts] == pytest.approx([BASE, 0.08, NOSE, -0.06])
    turns = [chain.normals[i] / chain.normals[i - 1] for i in range(1, 4)]
    assert [turn.imag > 0 for turn in turns] == [True, True, False]
    chain = chain_of(Blend(0.08))
    n = chain.normals
    assert n[0] == pytest.approx(n[3].conjugate(), abs=1e-14)
    assert n[1] == pytest.approx(n[2].conjugate(), abs=1e-14)
    again = close_chain([BASE_CIRCLE, chain.parts[1], NOSE_CIRCLE, chain.parts[3]])
    assert again.parts == chain.parts


def test_impossible_contours_are_refused():
    """Arcs that do not form a closed contour raise LawError with arc and limit."""
    inner, line = Circle(0.001 + 0j, 0.012), Blend(None)
    for specs, message in (
        ([BASE_CIRCLE, Blend(0.029), NOSE_CIRCLE, line], r"\[1\]: radius 29 mm is too .* 30 mm"),
        ([BASE_CIRCLE, Blend(-0.001), Circle(-0.05 + 0j, 0.001), line], "more than 12 mm"),
        ([BASE_CIRCLE, line, inner, line], "one is inside the other"),
        ([BASE_CIRCLE, Blend(0.08), inner, line], "one is inside the other"),
        (
            [BASE_CIRCLE, Blend(0.08), Blend(0.09), NOSE_CIRCLE],
            r"arcs\[1\]: has no centre, and its",
        ),
        ([BASE_CIRCLE, Blend(0.08)], "two different arcs with centres"),
        ([BASE_CIRCLE, NOSE_CIRCLE], r"arcs\[0\] and the next do not touch: .* 23 mm .* 13 mm"),
    ):
        with pytest.raises(LawError, match=message) as refused:
            close_chain(specs)
        assert "allowed: " in str(refused.value)


# Laws of a roller, a point and a flat face on the arcs.


def contour(chain, points=20_001):
    """Return points y + ix of the contour, computed from its arcs alone."""
    curves = []
    for i, part in enumerate(chain.parts):
        start, stop = chain.normals[i - 1], chain.normals[i]
        if isinstance(part, StraightLine):
            before, after = chain.parts[i - 1], chain.parts[(i + 1) % 4]
            ends = before.centre + before.radius * start, after.centre + after.radius * stop
            curves.append(np.linspace(*ends, points))
            continue
        turn = np.angle(stop / start)
        if part.centre == 0:
            turn %= TURN  # the base circle is the long way round
        curves.append(part.centre + part.radius * start * np.exp(1j * np.linspace(0, turn, points)))
    return np.concatenate(curves)


@pytest.mark.parametrize(("flank", "kind"), CASES)
def test_follower_on_the_finished_contour_is_at_s(flank, kind):
    """A follower placed on the arcs of the turned cam is at the lift s(θ) of the law.

    The law is C1, as in fig. 1 of the paper.
    """
    chain, follower = chain_of(FLANKS[flank]), FOLLOWERS[kind]
    law, points = law_of(chain, follower), contour(chain)
    assert continuity(law) == 1
    assert law.largest_step < 1e-16
    assert law.lift == pytest.approx(LIFT, rel=1e-13)
    for angle in np.linspace(0.0, TURN, 37):
        turned = points * np.exp(-1j * angle)  # the follower is on the real axis
        if follower.flat:
            reached = turned.real.max() - BASE
        elif follower.roller_radius:
            below = np.abs(turned.imag) < follower.roller_radius
            top = turned[below].real + np.sqrt(follower.roller_radius**2 - turned[below].imag ** 2)
            reached = top.max() - BASE - follower.roller_radius
        else:
            upper = turned[turned.real > 0]
            order = np.argsort(upper.imag)
            reached = np.interp(0.0, upper.imag[order], upper.real[order]) - BASE
        assert float(law(angle)) == pytest.approx(reached, abs=1e-9)


def test_contours_that_a_follower_cannot_follow_are_refused():
    """Arcs that a follower cannot follow raise LawError.

    These are concave arcs under a flat face or a large roller, overhangs, and arcs in the
    reverse order.
    """
    for flank in ("straight", "concave"):
        with pytest.raises(LawError, match=rf"arcs\[1\]: is {flank}, which a flat face bridges"):
            arc_pieces(chain_of(FLANKS[flank]), BASE, FOLLOWERS["flat"])
    with pytest.raises(LawError, match=r"concave radius 60 mm, the roller's is 60 mm"):
        arc_pieces(chain_of(FLANKS["concave"]), BASE, ArcFollower(False, 0.06))
    over = close_chain([Circle(0j, 0.01), Blend(-0.002), Circle(-0.025 + 0j, 0.012), Blend(-0.002)])
    parts = chain_of(FLANKS["convex"]).parts
    for chain in (over, close_chain([parts[i] for i in (0, 3, 2, 1)])):
        with pytest.raises(LawError, match="folds back on itself"):
            arc_pieces(chain, BASE, FOLLOWERS["point"])


def test_only_some_followers_are_allowed_on_arcs():
    """Only guided rollers, points and flat faces are allowed on a cam of arcs.

    Rollers and points must be on the centre line. A flat face may be eccentric.
    """

    def ride(**follower):
        follower = SimpleNamespace(roller=0.0, **follower)
        return arc_follower(SimpleNamespace(name="made", follower=follower))

    centre, eccentric = (SimpleNamespace(si=x) for x in (0.0, 0.01))
    assert ride(type="flat") == ride(type="flat", eccentricity=eccentric) == ArcFollower(True, 0.0)
    assert ride(type="point", eccentricity=centre) == ArcFollower(False, 0.0)
    with pytest.raises(LawError, match="'oscillating_roller'; allowed: roller, point, flat"):
        ride(type="oscillating_roller")
    with pytest.raises(LawError, match="eccentricity 10 mm"):
        ride(type="roller", eccentricity=eccentric)


# Cam files of arcs.


def test_shipped_pitch_curve_lies_on_its_arcs(cams, laws):
    """The pitch curve of a shipped cam of arcs is one roller radius off its circles.

    It turns from +y towards +x.
    """
    law, follower = laws["arcs_centres"], cams["arcs_centres"].follower
    angle = np.linspace(0.0, TURN, 721)
    pitch = follower.base_radius.si + follower.roller + law(angle)
    x, y = pitch * np.sin(angle), pitch * np.cos(angle)
    assert (np.abs(np.hypot(x, y) - 0.030 - follower.roller) < 1e-12).sum() > 300
    assert (np.abs(np.hypot(x, y + 0.020) - 0.018 - follower.roller) < 1e-12).sum() > 80
    rising, falling = law(np.radians([140.0, 220.0]), 1)
    assert rising > 0 > falling
    other = law_of(chain_of(Blend(0.08)), ArcFollower(False, 0.008))
    np.testing.assert_allclose(laws["arcs_convex"].ordinates, other.ordinates, rtol=0, atol=1e-17)


def test_invalid_radii_and_lifts_are_refused(make_cam):
    """Radii or lifts that no arcs can join raise LawError with the limit."""
    radii = {"law": "arcs_by_radii", "span": 360, "flank": "convex"}
    for flank, nose, message in (
        (0.2, 0.05, r"nose_radius: is 50 mm; allowed: below 45 mm"),
        (0.03, 0.012, r"arcs\[1\]: radius 30 mm is too small"),
    ):
        segment = radii | {"flank_radius": flank, "nose_radius": nose}
        with pytest.raises(LawError, match=f"'made': {message}"):
            build_law(make_cam(segment, lift=0.01, roller_radius=0.008))

    circles = {"radius": 0.04, "x": 0, "y": 0}, {"radius": 0.02, "x": 0, "y": -0.03}
    first, second = ({key: assumed(x, "m") for key, x in circle.items()} for circle in circles)
    arcs = [first, {}, second, {}]
    segment = {"law": "arcs_by_centres", "span": 360, "arcs": arcs}
    assert build_law(make_cam(segment, lift=0.01)).lift == pytest.approx(0.01, rel=1e-12)
    with pytest.raises(LawError, match=r"lift from 0 mm to 1\d\.?\d* mm .* the lift, 11 mm"):
        build_law(make_cam(segment, lift=0.011))
    for nose_half in (0.01, 5.0):
        with pytest.raises(LawError, match=r"40 mm to lift 10 mm with event half angle 58°"):
            ConcaveFlankCam(PITCH, LIFT, HALF, np.radians(nose_half)).radii()


# Tangent-arc cam with concave flanks, given by its event angles.

PITCH = 0.04  # m, radius of the base circle on the pitch curve
HALF, NOSE_HALF = np.radians(58.0), np.radians(39.0)


@pytest.fixture(scope="module")
def geometry():
    return ConcaveFlankCam(PITCH, LIFT, HALF, NOSE_HALF)


@pytest.fixture(scope="module")
def arc_law(make_cam):
    event = {"law": "tangent_arcs", "span": 116, "nose_span": 78}
    return build_law(make_cam(dwell(122), event, dwell(122), lift=LIFT))


def test_tangent_arcs_have_the_law_of_their_circles(geometry, arc_law):
    """The law of a segment of tangent arcs is that of the contour of its circles."""
    flank, nose = (
        Circle(-cmath.rect(arc.distance, arc.direction), arc.radius * (-1.0) ** arc.concave)
        for arc in geometry.arcs()
    )
    mirrored = Circle(flank.centre.conjugate(), flank.radius)
    chain = close_chain([Circle(0j, PITCH), flank, nose, mirrored])
    breaks, columns = arc_pieces(chain, PITCH, ArcFollower(False, 0.0))
    law, angle = Law("arcs", np.array(breaks), join_pieces(columns)), np.linspace(0.01, TURN, 721)
    for order, tolerance in enumerate((1e-13, 1e-12, 1e-11)):
        limit = tolerance * np.abs(law.derivative_ordinates(order)).max()
        np.testing.assert_allclose(arc_law(angle, order), law(angle, order), rtol=0, atol=limit)
    joint = chain.parts[1].centre + chain.parts[1].radius * chain.normals[1]
    assert np.angle(joint) % TURN == pytest.approx(np.pi - NOSE_HALF, abs=1e-12)


def test_acceleration_jumps_at_joints_and_the_fall_mirrors_the_rise(geometry, arc_law):
    """At the base circle r'' of tangent arcs jumps by R_b(R_b + ρ)/ρ, and r' does not.

    The fall mirrors the rise bit for bit.
    """
    flank, _ = geometry.arcs()
    assert np.abs(arc_law.jumps(0)).max() < 1e-15
    assert np.abs(arc_law.jumps(1)).max() < 1e-13
    jumps = arc_law.jumps(2)
    start = int(np.argmin(np.abs(arc_law.breaks - (np.pi - HALF))))
    expected = PITCH * (PITCH + flank.radius) / flank.radius
    assert jumps[start] == pytest.approx(expected, rel=1e-10)
    assert np.count_nonzero(np.abs(jumps) > 1e-6 * expected) == 4  # the four joints of arcs
    event, angle = arc_law.ordinates[:, 1:-1], np.linspace(0.0, HALF, 101)
    np.testing.assert_array_equal(event, event[::-1, ::-1])
    np.testing.assert_allclose(arc_law(np.pi + angle), arc_law(np.pi - angle), rtol=0, atol=1e-15)
