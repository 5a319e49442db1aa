"""Tests of a cam that is cut for a point follower but used with a roller.

The contour is the path of a point with the law s. A roller on it has another lift, the law of the
cam as cut, and another jump speed (the lowest speed with a loss of contact).
"""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics.two_mass import first_lift_off
from cam_rig.laws import Law
from cam_rig.profile.contact import Motion
from cam_rig.profile.disc import Contour, Disc
from cam_rig.profile.faces import GuidedCentre
from cam_rig.profile.measure import closed_curve, rest_on_contour
from cam_rig.units import RPM
from examples.paper import as_cut as script
from examples.paper.as_cut import followed_law, study, table

BASE, ROLLER = 0.065, 0.010
ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)


def random_law(seed, lift=0.02):
    """Return a law of one Bézier curve over a turn, closed with C². `lift` is in m."""
    ordinates = np.zeros(14)
    ordinates[4:10] = lift * np.random.default_rng(seed).uniform(0.0, 1.0, 6)
    return Law(f"random {seed}", [0.0, 2.0 * np.pi], ordinates[:, None])


@pytest.fixture(scope="module")
def followed_by(laws):
    """Pairs of a law, and the law of a roller on a cam that was cut for a point."""
    made = [*(laws[name] for name in ("bezier15", "poly345", "cycloidal")), random_law(3)]
    return [(law, followed_law(law, BASE, ROLLER)) for law in made]


def test_a_roller_put_on_the_contour_has_the_lift(followed_by):
    """A roller on the points of a contour cut for a point has the computed lift.

    The tolerance is 1e-11 m.
    """
    point, at = GuidedCentre.on_base(BASE, 0.0, 0.0), ANGLES[::4]
    for law, found in followed_by:
        outline = Contour.of(Disc("", point), Motion.uniform(law, 7200)).points
        measured = rest_on_contour(
            GuidedCentre.on_base(BASE, ROLLER, 0.0), closed_curve(outline), at
        )
        assert np.abs(found(at) - measured).max() < 1e-11


def test_fifty_digits():
    """Lift and derivatives of the roller on a cut cam agree with 50-digit values.

    The reference solves for the contact with mpmath. The tolerances are 1e-15 m to 1e-9 m/rad³.
    """
    law, found = random_law(5), followed_law(random_law(5), BASE, ROLLER)
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
    """The lift of a roller on a cam cut for a point is at least the point's lift s.

    Both are equal at the extremes of s. The roller's acceleration there is s''/(1 − R_r s''/(ρ (ρ +
    R_r))), with the roller radius R_r and the distance ρ from the axis.
    """
    at = np.array([np.pi])
    for law, found in followed_by:
        assert (found(ANGLES) - law(ANGLES)).min() > -1e-14
        assert found.lift == pytest.approx(law.lift, rel=1e-12)
        assert np.abs(found.jumps(2)).max() < 1e-10
        if not law.name.startswith("random"):
            rho, second = BASE + law(at), law(at, 2)
            exact = second / (1.0 - ROLLER * second / (rho * (rho + ROLLER)))
            assert np.abs(law(at, 1)).max() < 1e-12
            assert np.abs(found(at, 2) - exact).max() < 1e-11


def test_limits_and_refusals(laws):
    """A roller on a cam cut for a point has the expected lift in two limit cases.

    With a radius of 0 the lift is the law s of the point. On a large cam it exceeds s by R_r s'²/(2
    ρ (ρ + R_r)), to the first order. A law whose contour is hollower than the roller is refused.
    """
    law = laws["bezier15"]
    assert np.abs(followed_law(law, BASE, 0.0)(ANGLES) - law(ANGLES)).max() < 1e-15
    base = 50.0
    above = followed_law(law, base, ROLLER)(ANGLES) - law(ANGLES)
    rho = base + law(ANGLES)
    first = ROLLER * law(ANGLES, 1) ** 2 / (2.0 * rho * (rho + ROLLER))
    assert np.abs(above - first).max() < 0.01 * first.max()
    with pytest.raises(ValueError, match="hollower than the roller"):
        followed_law(laws["poly345"], 0.020, 0.020)


# -- the roller on the rig


@pytest.fixture(scope="module")
def bezier():
    """Result of the study for the Bézier 15 cam as it is cut.

    The radii are those of its cam file.
    """
    (found,) = study(["bezier15"])
    return found


def test_the_jump_speed_by_the_exact_model(bezier, two_mass):
    """The jump speed of the cut Bézier 15 cam is that of the exact simulation.

    The simulation loses contact at 1 + 1e-5 times this speed, and not at 1 − 1e-5 times.
    """
    for factor, leaves in ((1.0 + 1e-5, True), (1.0 - 1e-5, False)):
        speed = factor * bezier.cut.jump * RPM
        run = first_lift_off(bezier.cut.law, two_mass, speed, np.zeros(2), 1.7)
        assert (run is not None) == leaves


def test_numbers_of_the_report(bezier):
    """The result of Bézier 15 as cut has the numbers of the report on the paper."""
    row = ["65", "10", "0.866", "-39.12", "-37.41", "569.05", "584.16", "-0.027", "+0.023"]
    assert table([bezier], "").for_report.text_rows == [["Bézier degree 15", *row, "–", "–"]]


@pytest.mark.slow
def test_jump_speeds_and_landings_of_the_other_cams():
    """Jump speeds of the other cams are those of the report on the paper.

    The table has the jump speeds (rpm) of the law s and of the cam as cut for a point, and the
    lowest speeds with landings.
    """
    rows = table(study(script.CAMS[1:]), "").for_report.text_rows
    assert [row[6:8] + row[-2:] for row in rows] == [
        ["413.44", "413.07", "–", "–"],
        ["388.60", "408.20", "380", "400"],
        ["412.10", "416.61", "–", "–"],
        ["397.88", "410.88", "390", "400"],
    ]


def test_the_script(bezier, printed_by, monkeypatch):
    """The script prints both tables and the summary, and draws the figure."""
    monkeypatch.setattr(script, "study", lambda: [bezier])
    monkeypatch.setattr(script, "over_sizes", lambda found: [found])
    assert "0.866 mm too high, noise within 0.027 dB" in printed_by(script)
