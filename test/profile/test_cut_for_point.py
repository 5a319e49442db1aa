"""A roller on a point's contour: exact circles, 50 digits, a roller put on the contour, limits."""

import mpmath as mp
import numpy as np
import pytest

from cam_rig.errors import ProfileError
from cam_rig.laws import Law, build_law
from cam_rig.laws.bernstein import joined
from cam_rig.laws.sampling import fit
from cam_rig.paper.as_cut.cut_for_point import followed_law, roller_centre
from cam_rig.profile.contact import Motion
from cam_rig.profile.disc import Contour, Disc
from cam_rig.profile.faces import GuidedCentre
from cam_rig.profile.measure import closed_curve, rest
from cam_rig.schema import load_cam
from cam_rig.schema.load import config_root

BASE, ROLLER = 0.065, 0.010
ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)
TABLE_2 = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")


def shipped(name):
    return build_law(load_cam(config_root() / "cams" / f"{name}.yaml"))


def random_law(seed, lift=0.02):
    """A whole turn of one Bézier curve that joins its own start with C²."""
    ordinates = np.zeros(14)
    ordinates[4:10] = lift * np.random.default_rng(seed).uniform(0.0, 1.0, 6)
    return Law(f"random {seed}", [0.0, 2.0 * np.pi], ordinates[:, None])


def eccentric(a, e):
    """Polar law of a circle of radius a whose centre is e beside the axis, above its own base."""

    def polar(angle, order):
        series = np.polynomial.chebyshev.Chebyshev.interpolate(
            lambda x: e * np.cos(x) + np.sqrt(a**2 - (e * np.sin(x)) ** 2),
            70,
            [0.0, 2.0 * np.pi],
        )
        return series.deriv(order)(angle) - (a - e if order == 0 else 0.0)

    breaks, columns = fit(polar, 0.0, 2.0 * np.pi, accepted_tail=1e-9)
    return Law("eccentric", np.array(breaks), joined(columns))


def test_circle():
    """A roller on a circle beside the axis runs on the circle of a + R_r about the same centre."""
    a, e = 0.060, 0.012
    found = followed_law(eccentric(a, e), a - e, ROLLER).law
    wide = a + ROLLER
    exact = e * np.cos(ANGLES) + np.sqrt(wide**2 - (e * np.sin(ANGLES)) ** 2) - (wide - e)
    assert np.abs(found(ANGLES) - exact).max() < 1e-12


@pytest.mark.parametrize("law", [*map(shipped, ("bezier15", "poly345")), random_law(3)])
def test_a_roller_put_on_the_contour_stands_there(law):
    point = GuidedCentre.on_base(BASE, 0.0, 0.0)
    points = Contour.of(Disc("", point), Motion.uniform(law, 7200)).points
    measured = rest(GuidedCentre.on_base(BASE, ROLLER, 0.0), closed_curve(points), ANGLES)
    assert np.abs(followed_law(law, BASE, ROLLER).law(ANGLES) - measured).max() < 1e-11


def test_fifty_digits():
    law, found = random_law(5), followed_law(random_law(5), BASE, ROLLER).law
    ordinates = [mp.mpf(float(y)) for y in law.ordinates[:, 0]]
    with mp.workdps(50):

        def rho(phi):
            u, n = phi / (2 * mp.pi), len(ordinates) - 1
            terms = (mp.binomial(n, i) * u**i * (1 - u) ** (n - i) for i in range(n + 1))
            return mp.mpf(BASE) + mp.fdot(terms, ordinates)

        def centre(phi):
            slope = mp.diff(rho, phi)
            return mp.expj(phi) * (
                rho(phi) + mp.mpf(ROLLER) * (rho(phi) - 1j * slope) / mp.hypot(rho(phi), slope)
            )

        def lift(theta):
            phi = mp.findroot(lambda x: mp.im(centre(x) * mp.expj(-theta)), theta)
            return abs(centre(phi)) - mp.mpf(BASE) - mp.mpf(ROLLER)

        for angle in (1.1, 2.7):
            for order, bound in enumerate((1e-15, 1e-14, 1e-12, 1e-9)):
                exact = mp.diff(lift, mp.mpf(angle), order)
                assert abs(float(found(angle, order)) - float(exact)) < bound


@pytest.mark.parametrize("seed", range(6))
def test_lift_is_kept_and_never_below(seed):
    law = random_law(seed)
    found = followed_law(law, BASE, ROLLER)
    assert (found.law(ANGLES) - law(ANGLES)).min() > -1e-14
    assert found.law.lift == pytest.approx(law.lift, rel=1e-12)
    assert found.error[0] < 1e-14
    assert found.error[2] < 1e-10 * np.abs(law(ANGLES, 2)).max()
    assert np.abs(found.law.jumps(2)).max() < 1e-10


@pytest.mark.parametrize("name", TABLE_2)
def test_flatter_at_the_crest(name):
    """Where s' = 0 the roller's s'' is s''/(1 − R_r s''/(ρ (ρ + R_r)))."""
    law, found = shipped(name), followed_law(shipped(name), BASE, ROLLER).law
    at = np.array([np.pi])
    rho, bend = BASE + law(at), law(at, 2)
    exact = bend / (1.0 - ROLLER * bend / (rho * (rho + ROLLER)))
    assert np.abs(law(at, 1)).max() < 1e-12
    assert np.abs(found(at, 2) - exact).max() < 1e-11


def test_derivatives_by_differences():
    """d', d'', d''' of `roller_centre` are the differences of d over θ, to the second order."""
    ordinates = random_law(8).ordinates

    def rows(phi):
        law = Law("", [0.0, 2.0 * np.pi], ordinates)
        found = np.stack([law(phi, order) for order in range(4)])
        found[0] += BASE
        return found

    def theta(phi):
        rho, slope = rows(phi)[:2]
        q = np.hypot(rho, slope)
        return phi + np.angle(rho + ROLLER * (rho - 1j * slope) / q)

    phi, step = np.linspace(1.0, 5.0, 9), 1e-4
    distance, rate = roller_centre(rows(phi), ROLLER)
    ahead, behind = (roller_centre(rows(phi + sign * step), ROLLER)[0] for sign in (1, -1))
    turned = theta(phi + step) - theta(phi - step)
    assert np.abs(turned / (2.0 * step) - rate).max() < 1e-7
    for order in range(3):
        slope = (ahead[order] - behind[order]) / (2.0 * step) / rate
        assert np.abs(slope - distance[order + 1]).max() < 1e-7


def test_limits():
    """No roller: s itself. A large cam: R_r s'²/(2 ρ (ρ + R_r)) above s, the first order."""
    law = shipped("bezier15")
    assert np.abs(followed_law(law, BASE, 0.0).law(ANGLES) - law(ANGLES)).max() < 1e-15
    base = 50.0
    above = followed_law(law, base, ROLLER).law(ANGLES) - law(ANGLES)
    rho = base + law(ANGLES)
    first = ROLLER * law(ANGLES, 1) ** 2 / (2.0 * rho * (rho + ROLLER))
    assert np.abs(above - first).max() < 0.01 * first.max()


def test_refusals():
    with pytest.raises(ProfileError, match=r"corner at \d+.*allowed: a law without"):
        followed_law(shipped("worked_example_constant_velocity"), BASE, ROLLER)
    with pytest.raises(ProfileError, match="let the roller be smaller or the base circle larger"):
        followed_law(shipped("poly345"), 0.020, 0.020)
    with pytest.raises(ProfileError, match="base radius is 0 mm"):
        followed_law(shipped("poly345"), 0.0, ROLLER)
