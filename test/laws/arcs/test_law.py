"""The law of a roller, a point and a flat face on tangent arcs: measured on the contour itself."""

from types import SimpleNamespace

import mpmath as mp
import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import Law, build_law
from cam_rig.laws.arc_law import ArcFollower, arc_follower, arc_pieces
from cam_rig.laws.arcs import Blend, Circle, StraightLine, close
from cam_rig.laws.bernstein import joined
from cam_rig.laws.law import continuity
from cam_rig.units import TURN

BASE, LIFT, NOSE = 0.025, 0.01, 0.012
FLANKS = {"convex": Blend(0.08), "straight": Blend(None), "concave": Blend(-0.06)}
FOLLOWERS = {
    "roller": ArcFollower(False, 0.008),
    "point": ArcFollower(False, 0.0),
    "flat": ArcFollower(True, 0.0),
}
RIDES = [(flank, kind) for flank in FLANKS for kind in ("roller", "point")] + [("convex", "flat")]


def chain_of(flank):
    return close([Circle(0j, BASE), flank, Circle(-(BASE + LIFT - NOSE) + 0j, NOSE), flank])


def law_of(chain, follower):
    breaks, columns = arc_pieces(chain, BASE, follower)
    return Law("arcs", np.array(breaks), joined(columns))


def contour(chain, points=20_001):
    """Points of the parts, as complex numbers y + ix, made from the arcs alone."""
    found = []
    for i, part in enumerate(chain.parts):
        start, stop = chain.normals[i - 1], chain.normals[i]
        if isinstance(part, StraightLine):
            before, after = chain.parts[i - 1], chain.parts[(i + 1) % 4]
            ends = before.centre + before.radius * start, after.centre + after.radius * stop
            found.append(np.linspace(ends[0], ends[1], points))
            continue
        turn = np.angle(stop / start)
        if part.centre == 0:
            turn %= TURN  # the base circle is the long way round
        found.append(part.centre + part.radius * start * np.exp(1j * np.linspace(0, turn, points)))
    return np.concatenate(found)


@pytest.mark.parametrize(("flank", "kind"), RIDES)
def test_follower_on_the_finished_contour_is_at_s(flank, kind):
    """Put the follower on the arcs, turn the cam, read where it is.

    A roller's edge touches the contour and nothing of it is inside the roller; a flat face has
    the highest point under it. Between 20 001 points a roller sinks by up to 0.6 nm.
    """
    chain, follower = chain_of(FLANKS[flank]), FOLLOWERS[kind]
    law, points = law_of(chain, follower), contour(chain)
    for angle in np.linspace(0.0, TURN, 73):
        turned = points * np.exp(-1j * angle)  # the follower stands on the real axis
        if follower.flat:
            reached = turned.real.max() - BASE
        elif follower.roller_radius:
            near = np.abs(turned.imag) < follower.roller_radius
            top = turned[near].real + np.sqrt(follower.roller_radius**2 - turned[near].imag ** 2)
            reached = top.max() - BASE - follower.roller_radius
        else:
            upper = turned[turned.real > 0]
            order = np.argsort(upper.imag)
            reached = np.interp(0.0, upper.imag[order], upper.real[order]) - BASE
        assert float(law(angle)) == pytest.approx(reached, abs=1e-9)


def exact_lift(part, follower, angle):
    """Eq. of the ray's intersection, or the support function, in mpmath."""
    roller = mp.mpf(follower.roller_radius)
    if isinstance(part, StraightLine):
        delta = angle - mp.arg(mp.mpc(part.normal))
        return (mp.mpf(part.distance) + roller) / mp.cos(delta) - BASE - roller
    centre, radius = mp.mpc(part.centre), mp.mpf(part.radius)
    if follower.flat:
        return radius + (centre * mp.expj(-angle)).real - BASE
    along = centre * mp.expj(-angle)
    root = mp.sqrt((radius + roller) ** 2 - along.imag**2)
    return along.real + (root if radius > 0 else -root) - BASE - roller


@pytest.mark.parametrize(("flank", "kind"), RIDES)
@pytest.mark.parametrize(("order", "tolerance"), [(0, 1e-13), (1, 1e-12), (2, 1e-11), (3, 1e-10)])
def test_law_against_forty_digits(flank, kind, order, tolerance):
    """Value within 1e-13 and third derivative within 1e-10 of the formula, of their peaks."""
    chain, follower = chain_of(FLANKS[flank]), FOLLOWERS[kind]
    law = law_of(chain, follower)
    ends = [np.angle(n) % TURN for n in chain.normals] if follower.flat else None
    worst = size = 0.0
    for i, part in enumerate(chain.parts):
        if isinstance(part, Circle) and part.centre == 0:
            continue
        start, stop = (ends[i - 1], ends[i]) if ends else _span(chain, i, follower)
        angles = np.linspace(start, stop, 16)[1:-1]
        with mp.workdps(40):
            expected = [
                float(mp.diff(lambda x, p=part: exact_lift(p, follower, x), mp.mpf(x), order))
                for x in angles
            ]
        worst = max(worst, np.abs(law(angles, order) - expected).max())
        size = max(size, np.abs(expected).max())
    assert worst <= tolerance * size


def _span(chain, i, follower):
    """Cam angles of a part, from the pitch points of its two joints."""

    def angle(j):
        parts = chain.parts[j % 4], chain.parts[(j + 1) % 4]
        circle = next(part for part in parts if isinstance(part, Circle))
        pitch = circle.centre + (circle.radius + follower.roller_radius) * chain.normals[j % 4]
        return np.angle(pitch) % TURN

    return angle(i - 1), angle(i)


@pytest.mark.parametrize(("flank", "kind"), RIDES)
def test_acceleration_jumps_and_nothing_before_it(flank, kind):
    """Tangent arcs give C1: that is the cam of fig. 1 of the paper."""
    law = law_of(chain_of(FLANKS[flank]), FOLLOWERS[kind])
    assert continuity(law) == 1
    assert law.largest_step < 1e-16
    assert law.lift == pytest.approx(LIFT, rel=1e-13)


@pytest.mark.parametrize("flank", ["straight", "concave"])
def test_a_flat_face_bridges_what_is_not_convex(flank):
    """It would jump from one end of the flank to the other."""
    with pytest.raises(LawError, match=rf"arcs\[1\]: is {flank}, which a flat face bridges"):
        arc_pieces(chain_of(FLANKS[flank]), BASE, FOLLOWERS["flat"])


def test_a_roller_must_fit_the_concave_flank():
    """A roller as large as the flank's radius touches all of it at once."""
    with pytest.raises(LawError, match=r"concave radius 60 mm, the roller's is 60 mm"):
        arc_pieces(chain_of(FLANKS["concave"]), BASE, ArcFollower(False, 0.06))


def test_an_overhang_is_refused():
    """A nose wide on a thin neck: under its overhang no follower goes."""
    chain = close([Circle(0j, 0.01), Blend(-0.002), Circle(-0.025 + 0j, 0.012), Blend(-0.002)])
    with pytest.raises(LawError, match="folds back on itself"):
        arc_pieces(chain, 0.01, FOLLOWERS["point"])


def test_arcs_against_the_cam_angle_are_refused():
    """Given counterclockwise, the same arcs make no contour."""
    right = chain_of(FLANKS["convex"])
    with pytest.raises(LawError, match="folds back"):
        arc_pieces(close([right.parts[i] for i in (0, 3, 2, 1)]), BASE, FOLLOWERS["point"])


def test_radii_and_centres_are_one_cam(cams):
    """arcs_by_radii is the chain of its circles, bit for bit but for the fit."""
    law = build_law(cams["arcs_convex"])
    other = law_of(chain_of(Blend(0.08)), ArcFollower(False, 0.008))
    np.testing.assert_allclose(law.ordinates, other.ordinates, rtol=0, atol=1e-17)


def test_shipped_pitch_curve_lies_on_its_arcs(cams, laws):
    """The roller's centre of arcs_centres is one roller radius off the circles in the file.

    Law and file agree on the frame: +y at cam angle 0, from there towards +x.
    """
    law, follower = laws["arcs_centres"], cams["arcs_centres"].follower
    angle = np.linspace(0.0, TURN, 721)
    pitch = follower.base_radius.si + follower.roller + law(angle)
    x, y = pitch * np.sin(angle), pitch * np.cos(angle)
    on_base = np.abs(np.hypot(x, y) - 0.030 - follower.roller) < 1e-12
    on_nose = np.abs(np.hypot(x, y + 0.020) - 0.018 - follower.roller) < 1e-12
    assert on_base.sum() > 300
    assert on_nose.sum() > 80
    rising, falling = law(np.radians([140.0, 220.0]), 1)
    assert rising > 0 > falling


def arcs_of(make_cam, **changes):
    segment = {
        "law": "arcs_by_radii",
        "span": 360,
        "flank": "convex",
        "flank_radius": 0.2,
        "nose_radius": 0.012,
    } | changes
    return make_cam(segment, lift=0.01, roller_radius=0.008)


def test_radii_that_are_no_cam_are_refused(make_cam):
    """Nose too large, flank too small: named with the limit."""
    with pytest.raises(LawError, match=r"'made': nose_radius: is 50 mm; allowed: below 45 mm"):
        build_law(arcs_of(make_cam, nose_radius=0.05))
    with pytest.raises(LawError, match=r"'made': arcs\[1\]: radius 30 mm is too small"):
        build_law(arcs_of(make_cam, flank_radius=0.03))


def test_lift_must_be_the_arcs_own(make_cam):
    """A file whose arcs rise by something else than its lift says by how much."""

    def length(value):
        return {"assumed": value, "unit": "m"}

    base = {"radius": length(0.04), "x": length(0), "y": length(0)}
    nose = {"radius": length(0.02), "x": length(0), "y": length(-0.03)}
    arcs = [base, {}, nose, {}]
    segment = {"law": "arcs_by_centres", "span": 360, "arcs": arcs}
    assert build_law(make_cam(segment, lift=0.01)).lift == pytest.approx(0.01, rel=1e-12)
    with pytest.raises(LawError, match=r"lift from 0 mm to 1\d\.?\d* mm .* the lift, 11 mm"):
        build_law(make_cam(segment, lift=0.011))


@pytest.mark.parametrize(
    ("follower", "expected"),
    [
        ({"type": "flat"}, ArcFollower(True, 0.0)),
        ({"type": "flat", "eccentricity": SimpleNamespace(si=0.01)}, ArcFollower(True, 0.0)),
        ({"type": "point", "eccentricity": SimpleNamespace(si=0.0)}, ArcFollower(False, 0.0)),
    ],
)
def test_what_may_ride_on_arcs(follower, expected):
    """Roller, point and flat on the centre line; a flat face is the same beside it."""
    cam = SimpleNamespace(name="made", follower=SimpleNamespace(roller=0.0, **follower))
    assert arc_follower(cam) == expected


@pytest.mark.parametrize(
    ("follower", "words"),
    [
        ({"type": "oscillating_roller"}, "'oscillating_roller'; allowed: roller, point, flat"),
        ({"type": "roller", "eccentricity": SimpleNamespace(si=0.01)}, "10 mm beside"),
    ],
)
def test_what_may_not(follower, words):
    """The polar radius is the lift only for a follower on the centre line."""
    cam = SimpleNamespace(name="made", follower=SimpleNamespace(roller=0.0, **follower))
    with pytest.raises(LawError, match=words):
        arc_follower(cam)
