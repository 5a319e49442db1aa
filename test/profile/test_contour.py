"""Tests of contours: tangent, curvature and pressure angle satisfy the equations.

The equations are those of the profile thesis (see docs/glossary.md).
"""

import numpy as np
import pytest

from cam_rig.profile import contours, turn_angles

from .conftest import make

#: Step of the difference quotients, rad.
STEP = 1e-5


def close(actual, expected, limit):
    """Assert that arrays differ by at most `limit`."""
    np.testing.assert_allclose(actual, expected, rtol=0, atol=limit)


def test_uniform_contour_equals_the_contour_at_its_angles(every_kind):
    """A contour computed for equal angles agrees with that for the listed angles.

    The functions `contours` and `contours_at` agree to 1e-15 m and 1e-12 rad.
    """
    for sample in every_kind:
        fast, slow = (
            contours(sample.cam.follower, sample.law, 720),
            sample.contours(turn_angles(720)),
        )
        for uniform, other in zip(fast, slow, strict=True):
            close(uniform.points, other.points, 1e-15)
            close(uniform.pressure, other.pressure, 1e-12)


def test_rate_tangent_and_curvature_are_derivatives(every_kind, angles):
    """The contour's rate times its tangent is its derivative by the cam angle.

    The radius of curvature is the arc length per rad of the normal's rotation. The references are
    central differences.
    """
    for sample in every_kind:
        ahead, behind = sample.contours(angles + STEP), sample.contours(angles - STEP)
        for here, fore, aft in zip(sample.contours(angles), ahead, behind, strict=True):
            difference = (fore.points - aft.points) / (2.0 * STEP)
            close(here.rate * here.tangent, difference, 2e-8)
            np.testing.assert_allclose(np.hypot(*here.normal), 1.0, rtol=1e-14)
            change = (fore.normal - aft.normal) / (2.0 * STEP)
            close(here.rate / here.radius, np.sum(change * here.tangent, axis=0), 1e-6)


def test_roller_equations(angles):
    """Pitch curve, radius and pressure angle of a roller satisfy the equations.

    The equations are eq. 2.19-2.25 and 2.46 of the profile thesis, and tan φ = (d' − ε)/d.
    """
    prime, roller, sine, cosine = 0.048, 0.008, np.sin(angles), np.cos(angles)
    for eccentricity in (-6.0, 0.0, 9.0):
        sample, e = make("roller", eccentricity=eccentricity), eccentricity * 1e-3
        s, v, a = (sample.law(angles, order) for order in range(3))
        d = np.sqrt(prime**2 - e**2) + s
        contour = sample.contours(angles)[0]
        pitch = np.stack([e * cosine + d * sine, -e * sine + d * cosine])
        close(contour.pitch, pitch, 1e-16)
        turned = (v - e) * (2 * v - e) - d * (a - d)
        radius = (d**2 + (v - e) ** 2) ** 1.5 / turned - roller
        np.testing.assert_allclose(1.0 / contour.radius, 1.0 / radius, rtol=1e-12)
        close(np.tan(contour.pressure), (v - e) / d, 1e-14)
        np.testing.assert_allclose(np.hypot(*(contour.points - pitch)), roller, rtol=1e-13)


def test_face_equations(angles):
    """Contour and radius of a flat face satisfy eq. 2.17 and 2.40.

    The equations are those of the profile thesis. Misprints are corrected. The eccentricity moves
    the guide along the face and does not change the contour.
    """
    for kind, inclination in (("flat", 0.0), ("inclined_flat", 12.0)):
        sample = make(kind)
        beta, e, base = np.radians(inclination), 3e-3, sample.cam.follower.base_radius.si
        s, v, a = (sample.law(angles, order) for order in range(3))
        d = (base + e * np.sin(beta)) / np.cos(beta) + s
        contour = sample.contours(angles)[0]
        in_face = v * np.cos(beta) + 1j * (d * np.cos(beta) - e * np.sin(beta))
        point = in_face * np.exp(1j * (beta - angles))
        close(contour.points, [point.real, point.imag], 1e-16)
        radius = (d + a) * np.cos(beta) - e * np.sin(beta)
        np.testing.assert_allclose(contour.radius, radius, rtol=1e-13)
        close(contour.pressure, beta, 1e-16)
        moved = make(kind, eccentricity=-7.0)
        close(contour.points, moved.contours(angles)[0].points, 1e-16)


def test_conjugate_rollers_keep_their_distance(angles):
    """The rollers of a conjugate cam are 2 R_p + s_max apart at each cam angle.

    Both have the prime radius R_p (§2.2.2 of the profile thesis). The cam file can require another
    distance.
    """
    for numbers, distance in (({}, 0.126), ({"roller_distance": 140.0}, 0.140)):
        first, second = make("conjugate", eccentricity=0.0, **numbers).contours(angles)
        np.testing.assert_allclose(np.hypot(*(first.pitch - second.pitch)), distance, rtol=1e-13)
    sample = make("conjugate")
    for contour in contours(sample.cam.follower, sample.law, 3600):
        assert np.hypot(*contour.pitch).min() == pytest.approx(0.058, rel=1e-12)


def test_conjugate_arms_are_one_rocker(angles):
    """The angle between the arms of a conjugate rocker is 2 γ + s_max / arm.

    This is so at each cam angle. γ is the angle of an arm on the prime circle. The cam file can
    require another angle.
    """
    pivot = 0.090 * np.exp(-1j * angles)  # in the cam's frame
    gamma = np.arccos((0.075**2 + 0.090**2 - 0.048**2) / (2 * 0.075 * 0.090))
    default = 2 * gamma + 0.010 / 0.075
    for numbers, expected in (({}, default), ({"arms_angle": 80.0}, np.radians(80.0))):
        sample = make("oscillating_conjugate", **numbers)
        arms = [pivot - (c.pitch[0] + 1j * c.pitch[1]) for c in sample.contours(angles)]
        np.testing.assert_allclose(np.abs(arms), 0.075, rtol=1e-13)
        np.testing.assert_allclose(np.angle(arms[1] / arms[0]), expected, rtol=1e-13)
    sample = make("oscillating_conjugate")
    for contour in contours(sample.cam.follower, sample.law, 3600):
        assert np.hypot(*contour.pitch).min() == pytest.approx(0.048, rel=1e-12)
