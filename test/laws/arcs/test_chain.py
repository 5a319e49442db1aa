"""Contours of arcs: every part touches the next, blends find their place, and errors say why."""

import cmath

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws.arcs import Blend, Circle, StraightLine, close

BASE, NOSE = Circle(0j, 0.025), Circle(-0.023 + 0j, 0.012)
FLANKS = {"convex": Blend(0.08), "straight": Blend(None), "concave": Blend(-0.06)}


def point(part, normal):
    """Where a part has that outward normal."""
    if isinstance(part, Circle):
        return part.centre + part.radius * normal
    return None


@pytest.mark.parametrize("kind", FLANKS)
def test_neighbours_touch_with_one_normal(kind):
    """At each joint both parts pass through one point with one outward normal."""
    flank = FLANKS[kind]
    chain = close([BASE, flank, NOSE, flank])
    for i, normal in enumerate(chain.normals):
        one, other = chain.parts[i], chain.parts[(i + 1) % 4]
        assert abs(normal) == pytest.approx(1.0, rel=1e-14)
        if isinstance(one, StraightLine) or isinstance(other, StraightLine):
            line, circle = (one, other) if isinstance(one, StraightLine) else (other, one)
            reached = (point(circle, normal) * line.normal.conjugate()).real
            assert reached == pytest.approx(line.distance, rel=1e-14)
        else:
            assert point(one, normal) == pytest.approx(point(other, normal), rel=1e-12)


def test_blends_keep_their_radius_and_sign():
    """A blend is an arc of the radius asked for; the contour turns as its sign says."""
    chain = close([BASE, Blend(0.08), NOSE, Blend(-0.06)])
    assert [part.radius for part in chain.parts] == [0.025, 0.08, 0.012, -0.06]
    turns = [chain.normals[i] / chain.normals[i - 1] for i in range(4)]
    assert [t.imag > 0 for t in turns[1:]] == [True, True, False]


def test_a_mirrored_contour_has_mirrored_joints():
    """Equal flanks stand on both sides of the nose at one angle."""
    chain = close([BASE, Blend(0.08), NOSE, Blend(0.08)])
    n = chain.normals
    assert n[0] == pytest.approx(n[3].conjugate(), abs=1e-14)
    assert n[1] == pytest.approx(n[2].conjugate(), abs=1e-14)


def test_touching_circles_need_no_blend():
    """An arc given with the centre that a blend found is taken as it is."""
    flanks = close([BASE, Blend(0.08), NOSE, Blend(0.08)]).parts
    chain = close([BASE, flanks[1], NOSE, flanks[3]])
    assert chain.parts == flanks


@pytest.mark.parametrize("radius", [0.0301, 0.05, 0.5, 5.0])
def test_event_angle_of_a_convex_flank(radius):
    """The triangle of the three centres gives the direction in which the flank leaves the base."""
    chain = close([BASE, Blend(radius), NOSE, Blend(radius)])
    a, b, c = radius - BASE.radius, abs(NOSE.centre), radius - NOSE.radius
    cosine = (a**2 + b**2 - c**2) / (2 * a * b)  # at the base's centre, towards the flank's
    leaves = abs(cmath.phase(-chain.normals[0]))  # from the nose's direction, −1
    assert leaves == pytest.approx(np.pi - np.arccos(cosine), abs=1e-9)


@pytest.mark.parametrize(
    ("specs", "words"),
    [
        (
            [BASE, Blend(0.029), NOSE, Blend(None)],
            r"arcs\[1\]: radius 29 mm is too small .* 30 mm",
        ),
        ([BASE, Blend(-0.001), Circle(-0.05 + 0j, 0.001), Blend(None)], "more than 12 mm"),
        ([BASE, Blend(None), Circle(0.001 + 0j, 0.012), Blend(None)], "one lies inside the other"),
        ([BASE, Blend(0.08), Circle(0.001 + 0j, 0.012), Blend(None)], "one lies inside the other"),
        ([BASE, Blend(0.08), Blend(0.09), NOSE], r"arcs\[1\]: has no centre and stands between"),
        ([BASE, Blend(0.08)], "two different arcs with centres"),
        ([BASE, NOSE], r"arcs\[0\] and the next do not touch: .* 23 mm apart, .* need 13 mm"),
    ],
)
def test_impossible_contours_are_refused(specs, words):
    """The error names the arc, the number, the limit and the way out."""
    with pytest.raises(LawError, match=words) as caught:
        close(specs)
    assert "allowed: " in str(caught.value)
