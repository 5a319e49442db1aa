"""Contours: tangents, curvature and pressure angle agree with each other and the equations."""

import numpy as np
import pytest

from cam_rig.profile import contours, turn_angles

from .conftest import make

STEP = 1e-5


def close(found, expected, limit):
    np.testing.assert_allclose(found, expected, rtol=0, atol=limit)


def test_uniform_contour_is_the_one_at_its_angles(every_kind):
    for made in every_kind:
        fast, slow = contours(made.cam.follower, made.law, 720), made.contours(turn_angles(720))
        for one, other in zip(fast, slow, strict=True):
            close(one.points, other.points, 1e-15)
            close(one.pressure, other.pressure, 1e-12)


def test_rate_tangent_and_curvature_are_derivatives(every_kind, angles):
    """dP/dθ is along the tangent, at the rate; r_c is the way a rad of the normal."""
    for made in every_kind:
        ahead, behind = made.contours(angles + STEP), made.contours(angles - STEP)
        for here, fore, aft in zip(made.contours(angles), ahead, behind, strict=True):
            difference = (fore.points - aft.points) / (2.0 * STEP)
            close(here.rate * here.tangent, difference, 2e-8)
            np.testing.assert_allclose(np.hypot(*here.normal), 1.0, rtol=1e-14)
            change = (fore.normal - aft.normal) / (2.0 * STEP)
            close(here.rate / here.radius, np.sum(change * here.tangent, axis=0), 1e-6)


def test_roller_equations(angles):
    """Eq. 2.19-2.25 for the pitch curve, 2.46 for its radius, tan φ = (d' − ε)/d."""
    prime, roller, sine, cosine = 0.048, 0.008, np.sin(angles), np.cos(angles)
    for eccentricity in (-6.0, 0.0, 9.0):
        made, e = make("roller", eccentricity=eccentricity), eccentricity * 1e-3
        s, v, a = (made.law(angles, order) for order in range(3))
        d = np.sqrt(prime**2 - e**2) + s
        contour = made.contours(angles)[0]
        pitch = np.stack([e * cosine + d * sine, -e * sine + d * cosine])
        close(contour.pitch, pitch, 1e-16)
        turned = (v - e) * (2 * v - e) - d * (a - d)
        radius = (d**2 + (v - e) ** 2) ** 1.5 / turned - roller
        np.testing.assert_allclose(1.0 / contour.radius, 1.0 / radius, rtol=1e-12)
        close(np.tan(contour.pressure), (v - e) / d, 1e-14)
        np.testing.assert_allclose(np.hypot(*(contour.points - pitch)), roller, rtol=1e-13)


def test_face_equations(angles):
    """Eq. 2.17 and 2.40 (corrected); the eccentricity moves the guide along the face alone."""
    for kind, inclination in (("flat", 0.0), ("inclined_flat", 12.0)):
        made = make(kind)
        beta, e, base = np.radians(inclination), 3e-3, made.cam.follower.base_radius.si
        s, v, a = (made.law(angles, order) for order in range(3))
        d = (base + e * np.sin(beta)) / np.cos(beta) + s
        contour = made.contours(angles)[0]
        own = v * np.cos(beta) + 1j * (d * np.cos(beta) - e * np.sin(beta))
        point = own * np.exp(1j * (beta - angles))
        close(contour.points, [point.real, point.imag], 1e-16)
        radius = (d + a) * np.cos(beta) - e * np.sin(beta)
        np.testing.assert_allclose(contour.radius, radius, rtol=1e-13)
        close(contour.pressure, beta, 1e-16)
        beside = make(kind, eccentricity=-7.0)
        close(contour.points, beside.contours(angles)[0].points, 1e-16)


def test_conjugate_rollers_keep_their_distance(angles):
    """2 R_p + s_max apart, with one prime circle (§2.2.2), or what the file asks for."""
    for asked, distance in (({}, 0.126), ({"roller_distance": 140.0}, 0.140)):
        first, second = make("conjugate", eccentricity=0.0, **asked).contours(angles)
        np.testing.assert_allclose(np.hypot(*(first.pitch - second.pitch)), distance, rtol=1e-13)
    made = make("conjugate")
    for contour in contours(made.cam.follower, made.law, 3600):
        assert np.hypot(*contour.pitch).min() == pytest.approx(0.058, rel=1e-12)


def test_conjugate_arms_are_one_rocker(angles):
    """2 γ + s_max / arm between the arms, with one prime circle, or what the file asks for."""
    pivot = 0.090 * np.exp(-1j * angles)  # in the cam's frame
    gamma = np.arccos((0.075**2 + 0.090**2 - 0.048**2) / (2 * 0.075 * 0.090))
    own = 2 * gamma + 0.010 / 0.075
    for asked, expected in (({}, own), ({"arms_angle": 80.0}, np.radians(80.0))):
        made = make("oscillating_conjugate", **asked)
        arms = [pivot - (c.pitch[0] + 1j * c.pitch[1]) for c in made.contours(angles)]
        np.testing.assert_allclose(np.abs(arms), 0.075, rtol=1e-13)
        np.testing.assert_allclose(np.angle(arms[1] / arms[0]), expected, rtol=1e-13)
    made = make("oscillating_conjugate")
    for contour in contours(made.cam.follower, made.law, 3600):
        assert np.hypot(*contour.pitch).min() == pytest.approx(0.048, rel=1e-12)
