"""Contours: tangents, curvature and pressure angle agree with each other and the equations."""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.paper.as_cut.study import followed_law
from cam_rig.profile import contours, turn_angles
from cam_rig.profile.contact import Motion
from cam_rig.profile.disc import Contour, Disc
from cam_rig.profile.faces import GuidedCentre
from cam_rig.profile.measure import closed_curve, rest

from .conftest import OPPOSITE, make

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


def test_constant_breadth_and_diameter_are_constant(angles):
    """Opposite tangents are 2 R_b + s_max apart, opposite centres 2 R_p + s_max (§2.2.2)."""
    one, two = (make(kind, OPPOSITE) for kind in ("constant_breadth", "constant_diameter"))
    here, there = (one.contours(angles + turn)[0] for turn in (0.0, np.pi))
    breadth = sum(np.sum(side.points * side.normal, axis=0) for side in (here, there))
    np.testing.assert_allclose(breadth, 2 * 0.050 + 0.010, rtol=1e-13)
    here, there = (two.contours(angles + turn)[0] for turn in (0.0, np.pi))
    np.testing.assert_allclose(np.hypot(*(here.pitch - there.pitch)), 2 * 0.058 + 0.010, rtol=1e-13)


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


# -- a roller on a point's contour: exact circles, 50 digits, a roller put on the contour, limits


BASE, ROLLER = 0.065, 0.010
ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)


def random_law(seed, lift=0.02):
    """A whole turn of one Bézier curve that joins its own start with C²."""
    ordinates = np.zeros(14)
    ordinates[4:10] = lift * np.random.default_rng(seed).uniform(0.0, 1.0, 6)
    return Law(f"random {seed}", [0.0, 2.0 * np.pi], ordinates[:, None])


@pytest.fixture(scope="module")
def followed_by(laws):
    """The roller's law on each cam cut for a point, computed once."""
    made = [*(laws[name] for name in ("bezier15", "poly345", "cycloidal")), random_law(3)]
    return [(law, *followed_law(law, BASE, ROLLER)) for law in made]


def test_a_roller_put_on_the_contour_stands_there(followed_by):
    """The finished contour as points, the roller lowered onto it: nothing of the law is used."""
    point, at = GuidedCentre.on_base(BASE, 0.0, 0.0), ANGLES[::4]
    for law, found, _ in followed_by:
        outline = Contour.of(Disc("", point), Motion.uniform(law, 7200)).points
        measured = rest(GuidedCentre.on_base(BASE, ROLLER, 0.0), closed_curve(outline), at)
        assert np.abs(found(at) - measured).max() < 1e-11


def test_fifty_digits():
    """Lift and three derivatives against mpmath, which finds the contact and differentiates."""
    law, found = random_law(5), followed_law(random_law(5), BASE, ROLLER)[0]
    ordinates = [mp.mpf(float(y)) for y in law.ordinates[:, 0]]
    with mp.workdps(50):

        def curve(b, phi):
            u, n = phi / (2 * mp.pi), len(b) - 1
            return mp.fdot((mp.binomial(n, i) * u**i * (1 - u) ** (n - i) for i in range(n + 1)), b)

        slopes = [13 * (b - a) / (2 * mp.pi) for a, b in pairwise(ordinates)]

        def centre(phi):
            rho, slope = mp.mpf(BASE) + curve(ordinates, phi), curve(slopes, phi)
            return mp.expj(phi) * (rho + mp.mpf(ROLLER) * (rho - 1j * slope) / mp.hypot(rho, slope))

        def lift(theta):
            phi = mp.findroot(lambda x: mp.im(centre(x) * mp.expj(-theta)), theta)
            return abs(centre(phi)) - mp.mpf(BASE) - mp.mpf(ROLLER)

        series = mp.taylor(lift, mp.mpf(2.7), 3)
    for order, bound in enumerate((1e-15, 1e-14, 1e-12, 1e-9)):
        exact = float(series[order]) * (1, 1, 2, 6)[order]
        assert abs(float(found(2.7, order)) - exact) < bound


def test_lift_is_kept_and_never_below(followed_by):
    """It stands above s, at its extremes on it, with s''/(1 − R_r s''/(ρ (ρ + R_r))) there."""
    at = np.array([np.pi])
    for law, found, error in followed_by:
        assert (found(ANGLES) - law(ANGLES)).min() > -1e-14
        assert found.lift == pytest.approx(law.lift, rel=1e-12)
        assert error[0] < 1e-14
        assert error[2] < 1e-10 * np.abs(law(ANGLES, 2)).max()
        assert np.abs(found.jumps(2)).max() < 1e-10
        if not law.name.startswith("random"):
            rho, second = BASE + law(at), law(at, 2)
            exact = second / (1.0 - ROLLER * second / (rho * (rho + ROLLER)))
            assert np.abs(law(at, 1)).max() < 1e-12
            assert np.abs(found(at, 2) - exact).max() < 1e-11


def test_limits_and_refusals(laws):
    """No roller: s itself. A large cam: R_r s'²/(2 ρ (ρ + R_r)) above s, the first order."""
    law = laws["bezier15"]
    assert np.abs(followed_law(law, BASE, 0.0)[0](ANGLES) - law(ANGLES)).max() < 1e-15
    base = 50.0
    above = followed_law(law, base, ROLLER)[0](ANGLES) - law(ANGLES)
    rho = base + law(ANGLES)
    first = ROLLER * law(ANGLES, 1) ** 2 / (2.0 * rho * (rho + ROLLER))
    assert np.abs(above - first).max() < 0.01 * first.max()
    with pytest.raises(ProfileError, match=r"corner at \d+.*allowed: a law without"):
        followed_law(laws["worked_example_constant_velocity"], BASE, ROLLER)
    with pytest.raises(ProfileError, match="let the roller be smaller or the base circle larger"):
        followed_law(laws["poly345"], 0.020, 0.020)
    with pytest.raises(ProfileError, match="base radius is 0 mm"):
        followed_law(laws["poly345"], 0.0, ROLLER)
