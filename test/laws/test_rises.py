"""The rises known by a name and the trigonometric law: formulas, peaks, and how they join."""

import math
from typing import get_args

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from cam_rig.laws import bernstein, build_law
from cam_rig.laws.catalogue import figures
from cam_rig.laws.law import SMOOTHEST, joints, peak
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.schema.segments import RiseName
from cam_rig.units import TURN

from ..conftest import dwell, rise

#: Coefficients of u, u², … as eq. 3.1-3.9 print them, misprints corrected.
PRINTED = {
    "bezier5": [0, 0, 10, -15, 6],
    "bezier7": [0, 0, 0, 35, -84, 70, -20],
    "bezier9": [0, 0, 0, 0, 126, -420, 540, -315, 70],
    "bezier4_start": [0, 0, 2, -1],
    "bezier6_start": [0, 0, 0, 5, -6, 2],
    "bezier8_start": [0, 0, 0, 0, 14, -28, 20, -5],
    "bezier4_end": [2, 0, -2, 1],
    "bezier6_end": [2, 0, 0, -5, 6, -2],
    "bezier8_end": [2, 0, 0, 0, -14, 28, -20, 5],
    "poly345": [0, 0, 10, -15, 6],
    "poly4567": [0, 0, 0, 35, -84, 70, -20],
    "constant_velocity": [1],
}
PI = math.pi
#: Peak velocity, acceleration, jerk in closed form, and the class; science.md §1.
KNOWN = {
    "constant_velocity": (1.0, 0.0, 0.0, 0),
    "simple_harmonic": (PI / 2, PI**2 / 2, PI**3 / 2, 1),
    "cycloidal": (2.0, 2 * PI, 4 * PI**2, 2),
    "modified_sine": (4 * PI / (PI + 4), 4 * PI**2 / (PI + 4), 16 * PI**3 / (PI + 4), 2),
    "modified_trapezoid": (2.0, 8 * PI / (PI + 2), 32 * PI**2 / (PI + 2), 2),
    "poly345": (1.875, 10 / math.sqrt(3), 60.0, 2),
    "poly4567": (2.1875, 84 * math.sqrt(5) / 25, 52.5, 3),
    "bezier5": (1.875, 10 / math.sqrt(3), 60.0, 2),
    "bezier7": (2.1875, 84 * math.sqrt(5) / 25, 52.5, 3),
    "bezier9": (315 / 128, 9.371976218494108, 78.75, 4),  # the middle one by sampling
    **{f"bezier4_{half}": (2.0, 3.0, 12.0, 2) for half in ("start", "end")},
    **{f"bezier6_{half}": (2.0, 3.75, 20 / math.sqrt(3), 3) for half in ("start", "end")},
    **{f"bezier8_{half}": (2.0, 4.375, 168 / math.sqrt(125), 4) for half in ("start", "end")},
}


def taylor(function, at):
    """Value and three derivatives at a number, of 40 digits."""
    with mp.workdps(40):
        row = mp.taylor(function, mp.mpf(at), 3)
        return [float(a * factorial) for a, factorial in zip(row, (1, 1, 2, 6), strict=True)]


def test_figures():
    """Peaks per unit rise and unit span are the closed forms, the class that of the family."""
    assert set(get_args(RiseName)) == set(NAMED_RISES) == set(KNOWN)
    for name, known in KNOWN.items():
        found = figures(name)
        peaks = (found.peak_velocity, found.peak_acceleration, found.peak_jerk)
        np.testing.assert_allclose(peaks, known[:3], rtol=5e-13, atol=1e-13)
        assert found.continuity == known[3]


def test_bezier_rises_are_the_printed_polynomials():
    """Ordinates of eq. 3.1-3.9 give the curve of the printed powers of u, of their degree."""
    u = np.linspace(0.0, 1.0, 33)
    for name, printed in PRINTED.items():
        _, (ordinates,) = unit_rise(name)
        curve = Polynomial([0, *printed])
        assert len(ordinates) == curve.coef.size
        close = {"rtol": 0, "atol": 1e-13}  # the powers cancel
        np.testing.assert_allclose(bernstein.evaluate(ordinates, u), curve(u), **close)


def simple_harmonic(u):
    return (1 - mp.cos(mp.pi * u)) / 2


def modified_sine(u):
    k, eighth = 1 / (4 + mp.pi), mp.mpf(1) / 8
    if u < eighth:
        return k * (mp.pi * u - mp.sin(4 * mp.pi * u) / 4)
    if u < 7 * eighth:
        return k * (2 + mp.pi * u - 9 * mp.sin(4 * mp.pi * u / 3 + mp.pi / 3) / 4)
    return k * (4 + mp.pi * u - mp.sin(4 * mp.pi * u) / 4)


def modified_trapezoid(u):
    """The handbooks' formulas; the second half by s(u) = 1 − s(1 − u)."""
    if u > mp.mpf(1) / 2:
        return 1 - modified_trapezoid(1 - u)
    k, v = 1 / (2 + mp.pi), u - mp.mpf(1) / 8
    if v < 0:
        return k * (2 * u - mp.sin(4 * mp.pi * u) / (2 * mp.pi))
    if v < mp.mpf(1) / 4:
        return k * (mp.mpf(1) / 4 - 1 / (2 * mp.pi) + 2 * v + 4 * mp.pi * v**2)
    return k * (-mp.pi / 2 + 2 * (1 + mp.pi) * u + mp.sin(4 * mp.pi * u) / (2 * mp.pi))


def cycloidal(u):
    return u - mp.sin(2 * mp.pi * u) / (2 * mp.pi)


@pytest.mark.parametrize("formula", [simple_harmonic, cycloidal, modified_sine, modified_trapezoid])
def test_fit_against_forty_digits(formula):
    """Value to 1e-14 and third derivative to 1e-11 of their peaks, off the sections' joints."""
    breaks, columns = unit_rise(formula.__name__)
    u, errors, sizes = np.linspace(0.03, 0.97, 5), [], []
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        expected = np.array([taylor(formula, start + x * (stop - start)) for x in u]).T
        for order in range(4):
            errors.append((order, np.abs(bernstein.evaluate(column, u) - expected[order]).max()))
            column = bernstein.derivative(column) / (stop - start)  # noqa: PLW2901
        sizes.append(np.abs(expected).max(axis=1))
    size = np.max(sizes, axis=0)
    for order, error in errors:
        assert error <= (1e-14, 1e-13, 1e-12, 1e-11)[order] * size[order]


def test_halves_meet_at_one_slope(make_cam):
    """A start and an end half of equal span meet with velocity 2h/β: C4 for degree 8."""
    for degree, expected in ((4, 2), (6, 3), (8, 4)):
        start, end = f"bezier{degree}_start", f"bezier{degree}_end"
        up, down = ((rise(60, 0.5, start), rise(60, level, end)) for level in (1, 0))
        law = build_law(make_cam(*up, dwell(60), *down, dwell(60)))
        classes = [joint.continuity for joint in joints(law)]
        assert [classes[i] for i in (0, 2, 3, 5)] == [expected] * 4  # against the dwells
        assert min(classes) == expected
        assert law(np.radians(60.0), 1) == pytest.approx(0.05 / np.radians(60.0), rel=1e-14)


# Trigonometric polynomials: the fit is the sum of waves, all around.

COSINE, SINE, MEAN, LIFT = [-0.4, 0.05, 0, 0.02], [0.1, -0.03, 0.01], 0.5, 0.05


def test_trigonometric_law_against_fifty_digits(make_cam):
    """Value and derivatives of eq. 2.2, relative to their peaks; no joint is seen at C4."""
    segment = {"law": "trigonometric", "span": 360, "mean": MEAN, "cosine": COSINE, "sine": SINE}
    wavy, angles = build_law(make_cam(segment, lift=LIFT)), np.linspace(0.0, TURN, 49)
    assert {joint.continuity for joint in joints(wavy)} == {SMOOTHEST}

    def exact(theta, order):
        total = mp.mpf(MEAN) if order == 0 else mp.mpf(0)
        for waves, phase in ((COSINE, order), (SINE, order - 1)):
            for i, size in enumerate(waves, start=1):
                total += mp.mpf(size) * mp.mpf(i) ** order * mp.cos(i * theta + phase * mp.pi / 2)
        return total

    for order, tolerance in enumerate((1e-14, 1e-13, 1e-12, 1e-11)):
        with mp.workdps(50):
            expected = LIFT * np.array([float(exact(mp.mpf(x), order)) for x in angles])
        limit = tolerance * np.abs(expected).max()
        np.testing.assert_allclose(wavy(angles, order), expected, rtol=0, atol=limit)


def test_fifty_harmonics(make_cam):
    """The highest harmonic allowed is followed: its slope is 50 times its size."""
    cosine = [0.0] * 49 + [0.5]
    law = build_law(make_cam({"law": "trigonometric", "span": 360, "mean": 0.5, "cosine": cosine}))
    assert law.lift == pytest.approx(LIFT, rel=1e-12)
    assert abs(peak(law, 1).value) == pytest.approx(25.0 * LIFT, rel=1e-12)
    assert abs(peak(law, 3).value) == pytest.approx(0.5 * 50**3 * LIFT, rel=1e-10)


def test_shipped_trigonometric_law_is_flat_at_both_ends(laws):
    """Its velocity is 15/16 sin⁵: five derivatives vanish at the bottom and at the top."""
    angles = np.linspace(0.0, TURN, 61)
    velocity = laws["trigonometric"](angles, 1) / LIFT
    np.testing.assert_allclose(velocity, 15 / 16 * np.sin(angles) ** 5, rtol=0, atol=1e-13)
