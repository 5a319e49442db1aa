"""The rises known by a name: the sources' formulas, their peaks, and how they join."""

import math
from fractions import Fraction
from typing import get_args

import mpmath as mp
import numpy as np
import pytest

from cam_rig.laws import bernstein
from cam_rig.laws.catalogue import figures
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.schema.segments import RiseName

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


def test_schema_and_registry_name_the_same_rises():
    """What a file may name is what there is."""
    assert set(get_args(RiseName)) == set(NAMED_RISES) == set(KNOWN)


@pytest.mark.parametrize("name", PRINTED)
def test_bezier_rises_are_the_printed_polynomials(name):
    """Ordinates of eq. 3.1-3.9, turned into powers of u in fractions."""
    _, (ordinates,) = unit_rise(name)
    n = len(ordinates) - 1
    exact = [Fraction(b).limit_denominator(1000) for b in ordinates]  # thirds are rounded in floats
    np.testing.assert_allclose([float(b) for b in exact], ordinates, rtol=2e-16)
    powers = [
        sum((-1) ** (k - i) * math.comb(n, k) * math.comb(k, i) * exact[i] for i in range(k + 1))
        for k in range(n + 1)
    ]
    assert powers == [0, *PRINTED[name]]


@pytest.mark.parametrize("name", KNOWN)
def test_figures(name):
    """Peaks per unit rise and unit span are the closed forms, the class that of the family."""
    found, known = figures(name), KNOWN[name]
    peaks = (found.peak_velocity, found.peak_acceleration, found.peak_jerk)
    np.testing.assert_allclose(peaks, known[:3], rtol=5e-13, atol=1e-13)
    assert found.continuity == known[3]


def harmonic(u):
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
    k, eighth = 1 / (2 + mp.pi), mp.mpf(1) / 8
    if u < eighth:
        return k * (2 * u - mp.sin(4 * mp.pi * u) / (2 * mp.pi))
    if u < 3 * eighth:
        return k * (
            mp.mpf(1) / 4 - 1 / (2 * mp.pi) + 2 * (u - eighth) + 4 * mp.pi * (u - eighth) ** 2
        )
    return k * (-mp.pi / 2 + 2 * (1 + mp.pi) * u + mp.sin(4 * mp.pi * u) / (2 * mp.pi))


FORMULAS = {
    "simple_harmonic": harmonic,
    "modified_sine": modified_sine,
    "modified_trapezoid": modified_trapezoid,
}


@pytest.mark.parametrize("name", FORMULAS)
@pytest.mark.parametrize(("order", "tolerance"), [(0, 1e-14), (1, 1e-13), (2, 1e-12), (3, 1e-11)])
def test_fit_against_forty_digits(name, order, tolerance):
    """Value to 1e-14 and third derivative to 1e-11 of their peaks, off the sections' joints."""
    breaks, columns = unit_rise(name)
    worst, size = 0.0, 0.0
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        for _ in range(order):
            column = bernstein.derivative(column) / (stop - start)  # noqa: PLW2901
        u = np.linspace(0.03, 0.97, 7)
        with mp.workdps(40):
            expected = [
                float(mp.diff(FORMULAS[name], mp.mpf(start) + x * mp.mpf(stop - start), order))
                for x in map(mp.mpf, u)
            ]
        worst = max(worst, np.abs(bernstein.evaluate(column, u) - expected).max())
        size = max(size, np.abs(expected).max())
    assert worst <= tolerance * size


@pytest.mark.parametrize("name", [n for n in NAMED_RISES if NAMED_RISES[n].slopes == (0.0, 0.0)])
def test_full_rises_are_skew_symmetric(name):
    """s(u) + s(1 − u) = 1: as gentle at the end as at the start."""
    breaks, columns = unit_rise(name)
    u = np.linspace(0.0, 1.0, 51)
    for i, column in enumerate(columns):
        total = bernstein.evaluate(column, u) + bernstein.evaluate(columns[-1 - i], 1.0 - u)
        np.testing.assert_allclose(total, 1.0, rtol=0, atol=4e-15)
        assert breaks[i] + breaks[-1 - i] == pytest.approx(1.0, abs=1e-16)


def test_halves_meet_at_one_slope(make_cam):
    """A start and an end half of equal span meet with velocity 2h/β: C4 for degree 8."""
    from cam_rig.laws import build_law
    from cam_rig.laws.law import joints

    def half(law, to):
        return {"law": law, "span": 60, "to": to}

    for degree, expected in ((4, 2), (6, 3), (8, 4)):
        start, end = f"bezier{degree}_start", f"bezier{degree}_end"
        up, down = (half(start, 0.5), half(end, 1)), (half(start, 0.5), half(end, 0))
        dwell = {"law": "dwell", "span": 60}
        law = build_law(make_cam(*up, dwell, *down, dwell))
        classes = [joint.continuity for joint in joints(law)]
        assert [classes[i] for i in (0, 2, 3, 5)] == [expected] * 4  # against the dwells
        assert min(classes) == expected
        assert law(np.radians(60.0), 1) == pytest.approx(0.05 / np.radians(60.0), rel=1e-14)
