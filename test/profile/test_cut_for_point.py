"""A roller on a point's contour: exact circles, 50 digits, a roller put on the contour, limits."""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.paper.as_cut.cut_for_point import followed_law
from cam_rig.profile.contact import Motion
from cam_rig.profile.disc import Contour, Disc
from cam_rig.profile.faces import GuidedCentre
from cam_rig.profile.measure import closed_curve, rest

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
    return [(law, followed_law(law, BASE, ROLLER)) for law in made]


def test_a_roller_put_on_the_contour_stands_there(followed_by):
    """The finished contour as points, the roller lowered onto it: nothing of the law is used."""
    point, at = GuidedCentre.on_base(BASE, 0.0, 0.0), ANGLES[::4]
    for law, found in followed_by:
        outline = Contour.of(Disc("", point), Motion.uniform(law, 7200)).points
        measured = rest(GuidedCentre.on_base(BASE, ROLLER, 0.0), closed_curve(outline), at)
        assert np.abs(found.law(at) - measured).max() < 1e-11


def test_fifty_digits():
    """Lift and three derivatives against mpmath, which finds the contact and differentiates."""
    law, found = random_law(5), followed_law(random_law(5), BASE, ROLLER).law
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
    for law, found in followed_by:
        assert (found.law(ANGLES) - law(ANGLES)).min() > -1e-14
        assert found.law.lift == pytest.approx(law.lift, rel=1e-12)
        assert found.error[0] < 1e-14
        assert found.error[2] < 1e-10 * np.abs(law(ANGLES, 2)).max()
        assert np.abs(found.law.jumps(2)).max() < 1e-10
        if not law.name.startswith("random"):
            rho, second = BASE + law(at), law(at, 2)
            exact = second / (1.0 - ROLLER * second / (rho * (rho + ROLLER)))
            assert np.abs(law(at, 1)).max() < 1e-12
            assert np.abs(found.law(at, 2) - exact).max() < 1e-11


def test_limits_and_refusals(laws):
    """No roller: s itself. A large cam: R_r s'²/(2 ρ (ρ + R_r)) above s, the first order."""
    law = laws["bezier15"]
    assert np.abs(followed_law(law, BASE, 0.0).law(ANGLES) - law(ANGLES)).max() < 1e-15
    base = 50.0
    above = followed_law(law, base, ROLLER).law(ANGLES) - law(ANGLES)
    rho = base + law(ANGLES)
    first = ROLLER * law(ANGLES, 1) ** 2 / (2.0 * rho * (rho + ROLLER))
    assert np.abs(above - first).max() < 0.01 * first.max()
    with pytest.raises(ProfileError, match=r"corner at \d+.*allowed: a law without"):
        followed_law(laws["worked_example_constant_velocity"], BASE, ROLLER)
    with pytest.raises(ProfileError, match="let the roller be smaller or the base circle larger"):
        followed_law(laws["poly345"], 0.020, 0.020)
    with pytest.raises(ProfileError, match="base radius is 0 mm"):
        followed_law(laws["poly345"], 0.0, ROLLER)
