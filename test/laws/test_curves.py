"""Curves of laws are the laws' own derivatives, with both limits where they jump."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.laws import Law
from cam_rig.laws.catalogue import (
    ORDERS,
    LawCurves,
    cam_curves,
    common_unit,
    families,
    figures,
    rise_curves,
    rise_values,
)
from cam_rig.laws.segments import NAMED_RISES, cycloidal, simple_harmonic
from cam_rig.schema import CamConfig


@pytest.mark.parametrize("name", NAMED_RISES)
def test_a_rise_goes_from_0_to_1_with_the_slopes_it_is_made_for(name: str) -> None:
    """Unit rise: s(0) = 0, s(1) = 1; s' there is that of the dwell or line beside it."""
    curves, slopes = rise_curves(name), NAMED_RISES[name].slopes
    assert curves.x[0] == 0.0
    assert curves.x[-1] == pytest.approx(1.0, abs=1e-15)
    assert curves.motion[0, [0, -1]] == pytest.approx((0.0, 1.0), abs=1e-14)
    if figures(name).continuity >= 1:
        assert curves.infinite == ()
        assert curves.motion[1, [0, -1]] == pytest.approx(slopes, abs=1e-11)
    else:
        gained = [jump for _, jump in curves.infinite]
        assert gained == pytest.approx([1.0 - slopes[0], slopes[1] - 1.0])


@pytest.mark.parametrize("name", NAMED_RISES)
def test_peaks_of_the_curves_are_those_of_the_table(name: str) -> None:
    """The largest value drawn comes within the grid's reach of the root that is listed."""
    known = figures(name)
    peaks = (known.peak_velocity, known.peak_acceleration, known.peak_jerk)
    drawn = np.abs(rise_curves(name).motion[1:]).max(axis=1)
    assert drawn == pytest.approx(peaks, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("name", NAMED_RISES)
def test_each_curve_is_the_slope_of_the_one_above(name: str) -> None:
    """∫ s^(r+1) du over each interval drawn is the difference of s^(r), by Simpson's rule."""
    u = np.linspace(0.0, 1.0, 4001)
    motion = rise_values(name, u)
    for order in (0, 1, 2):
        low, middle, high = (motion[order + 1, i : 4001 - 2 + i : 2] for i in range(3))
        area = (low + 4.0 * middle + high) * (u[1] / 3.0)
        gained = np.diff(motion[order, ::2])
        assert np.abs(area - gained).max() < 1e-2 * u[1]  # s''' may jump inside an interval
        assert np.median(np.abs(area - gained)) < 1e-9


@pytest.mark.parametrize(
    ("name", "formula"), [("simple_harmonic", simple_harmonic), ("cycloidal", cycloidal)]
)
def test_rises_by_formula(name: str, formula: object) -> None:
    """Curve and table of values are the closed form, to its third derivative."""
    assert callable(formula)
    curves = rise_curves(name)
    u = np.linspace(0.0, 1.0, 101)
    for order in ORDERS:
        size = np.abs(formula(u, order)).max()
        np.testing.assert_allclose(
            curves.motion[order], formula(curves.x, order), rtol=0, atol=1e-9 * size
        )
        np.testing.assert_allclose(
            rise_values(name, u)[order], formula(u, order), rtol=0, atol=1e-9 * size
        )


def test_a_half_rise_to_rest_is_the_one_from_rest_turned() -> None:
    """Eq. 3.7-3.9 are 1 − s(1 − u) of eq. 3.4-3.6."""
    u = np.linspace(0.0, 1.0, 65)
    for degree in (4, 6, 8):
        start, end = (rise_values(f"bezier{degree}_{part}", u) for part in ("start", "end"))
        turned = start[:, ::-1] * np.array([-1.0, 1.0, -1.0, 1.0])[:, None]
        turned[0] += 1.0
        np.testing.assert_allclose(end, turned, rtol=0, atol=1e-10)


def test_every_rise_is_in_one_family() -> None:
    """Complete, without repetition; half-rises with half-rises of the same end."""
    found = families()
    named = [name for family in found.values() for name in family.rises]
    assert sorted(named) == sorted(NAMED_RISES)
    slopes = {key: {NAMED_RISES[n].slopes for n in family.rises} for key, family in found.items()}
    assert slopes == {
        "polynomial": {(0.0, 0.0)},
        "start": {(0.0, 2.0)},
        "end": {(2.0, 0.0)},
        "classical": {(0.0, 0.0)},
    }


def curves_of(laws: dict[str, Law], cam: str) -> LawCurves:
    """Those of a shipped cam."""
    return cam_curves(cam, laws[cam])


def test_a_cams_curves_are_its_law(laws: dict[str, Law]) -> None:
    """Off the joints each is the law's derivative, over one whole turn."""
    for cam in ("poly345", "bezier15", "tm21"):
        curves = curves_of(laws, cam)
        assert (curves.x[0], curves.x[-1]) == pytest.approx((0.0, 360.0))
        knots = np.degrees(laws[cam].breaks)
        inside = np.abs(curves.x[:, None] - knots).min(axis=1) > 1e-6
        for order in ORDERS:
            value = laws[cam](np.radians(curves.x[inside]), order)
            size = np.abs(value).max()
            np.testing.assert_allclose(
                curves.motion[order, inside], value, rtol=0, atol=1e-9 * size
            )


def test_the_velocity_jumps_of_the_worked_example(laws: dict[str, Law]) -> None:
    """Constant velocity: the lift over 90° up and down, so s'' is infinite at four joints."""
    curves = curves_of(laws, "worked_example_constant_velocity")
    assert [x for x, _ in curves.infinite] == pytest.approx([0.0, 90.0, 180.0, 270.0])
    slope = 0.0254 / (np.pi / 2.0)
    gained = [jump for _, jump in curves.infinite]
    assert gained == pytest.approx([slope, slope, -slope, -slope], rel=1e-9)


def test_cams_of_several_units_are_drawn_in_mm(cams: dict[str, CamConfig]) -> None:
    """The files' own unit where they agree."""
    inch, metre = cams["worked_example_quintic"], cams["poly345"]
    assert common_unit([inch, inch]) == ("in", 0.0254)
    assert common_unit([inch, metre]) == ("mm", 1e-3)
