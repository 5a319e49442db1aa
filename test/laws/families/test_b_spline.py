"""B-splines as Bézier pieces: the thesis's basis, its abscissae, and continuity at knots."""

from fractions import Fraction

import numpy as np
import pytest

from cam_rig.laws import bernstein, build_law
from cam_rig.laws.law import joints
from cam_rig.laws.spline import greville, pieces

DEGREE = 3
KNOTS = np.array([0, 0, 0, 1, 2.5, 2.5, 4, 4, 4], dtype=float)  # ends and 2.5 repeated
ORDINATES = np.array([0, 0.1, 0.7, 0.9, 0.4, 0.2, 0.25])


def basis(i, n, u, knots):
    """N_i^n(u) by the recursion of eq. 2.10, in fractions; ``knots`` are 1 more at each end."""
    if n == 0:
        return Fraction(1) if knots[i] <= u < knots[i + 1] else Fraction(0)
    total = Fraction(0)
    if knots[i + n] > knots[i]:
        total += (u - knots[i]) / (knots[i + n] - knots[i]) * basis(i, n - 1, u, knots)
    if knots[i + n + 1] > knots[i + 1]:
        rest = (knots[i + n + 1] - u) / (knots[i + n + 1] - knots[i + 1])
        total += rest * basis(i + 1, n - 1, u, knots)
    return total


def value(u, ordinates=ORDINATES):
    breaks, columns = pieces(KNOTS, ordinates, DEGREE)
    i = min(np.searchsorted(breaks, u, side="right") - 1, len(columns) - 1)
    at = np.array([(u - breaks[i]) / (breaks[i + 1] - breaks[i])])
    return bernstein.evaluate(columns[i], at)[0]


@pytest.mark.parametrize("u", [0.0, 0.3, 1.0, 1.7, 2.5, 3.1, 3.999])
def test_values_are_the_recursion(u):
    """The Bézier pieces are the sum of the basis functions of eq. 2.10, to rounding."""
    outer = [Fraction(k) for k in [KNOTS[0], *KNOTS, KNOTS[-1]]]
    exact = sum(
        Fraction(d) * basis(i, DEGREE, Fraction(u), outer) for i, d in enumerate(ORDINATES.tolist())
    )
    assert value(u) == pytest.approx(float(exact), abs=2e-16)


def test_begins_and_ends_on_its_ordinates():
    """End knots of multiplicity n: the curve passes through the first and last ordinate."""
    _, columns = pieces(KNOTS, ORDINATES, DEGREE)
    assert (columns[0][0], columns[-1][-1]) == (ORDINATES[0], ORDINATES[-1])


def test_local_control():
    """An ordinate moves the curve only over the n + 1 spans beside it (eq. 2.11)."""
    moved = ORDINATES.copy()
    moved[0] += 1.0  # supported on [0, 1] only
    for u in (1.0, 1.5, 3.0):
        assert value(u, moved) == value(u)
    assert value(0.5, moved) != value(0.5)


def test_greville_abscissae():
    """ξᵢ = mean of n knots: a straight line through (ξᵢ, ξᵢ) is itself (linear precision)."""
    abscissae = greville(KNOTS, DEGREE)
    assert abscissae[0] == KNOTS[0]
    assert abscissae[-1] == KNOTS[-1]
    np.testing.assert_allclose(abscissae[1], (0 + 0 + 1) / 3, rtol=1e-15)
    for u in (0.2, 1.3, 2.7, 3.9):
        assert value(u, abscissae) == pytest.approx(u, rel=1e-15)


def test_continuity_at_knots(make_cam):
    """C^(n − r) at a knot of multiplicity r, C^(n − 1) at a simple one."""
    law = build_law(
        make_cam(
            {
                "law": "b_spline",
                "span": 360,
                "degree": DEGREE,
                "knots": [0, 0, 0, 1, 2, 2, 4, 4, 4],
                "ordinates": [0, 0, 0.7, 0.9, 0.4, 0, 0],
            }
        )
    )
    np.testing.assert_allclose(law.breaks, np.radians([0, 90, 180, 360]), rtol=1e-15)
    assert [joint.continuity for joint in joints(law)] == [1, 2, 1]


def test_one_piece_is_a_bezier_curve(make_cam):
    """Without inner knots the ordinates are those of a Bézier curve."""
    ordinates = [0, 0, 0.3, 1, 0.2, 0, 0]
    knots = [0] * 6 + [1] * 6
    spline = {"law": "b_spline", "span": 360, "degree": 6, "knots": knots, "ordinates": ordinates}
    bezier = {"law": "bezier", "span": 360, "ordinates": ordinates}
    one, other = build_law(make_cam(spline)), build_law(make_cam(bezier))
    np.testing.assert_array_equal(one.ordinates, other.ordinates)
