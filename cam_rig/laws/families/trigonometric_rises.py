"""The two industrial standards: modified sine and modified trapezoid.

Both are made of sections of sine and constant acceleration that join C²: the acceleration
rises within the first eighth along a quarter sine, and falls so in the last (any cam handbook).
The second half is the first turned about the middle of the rise.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws.fit import Curve, Section


def simple_harmonic(u: FloatArray, order: int) -> FloatArray:
    """The rise or its derivative in u, order 0 to 3."""
    if order == 0:
        return np.asarray(np.sin(0.5 * np.pi * u) ** 2)  # the same, without cancellation near 0
    half = 0.5 * np.pi**order
    if order == 2:
        return np.asarray(half * np.cos(np.pi * u))
    return np.asarray((half if order == 1 else -half) * np.sin(np.pi * u))


def cycloidal(u: FloatArray, order: int) -> FloatArray:
    """The rise or its derivative in u, order 0 to 3."""
    turn = 2.0 * np.pi * u
    if order == 0:
        return np.asarray(u - np.sin(turn) / (2.0 * np.pi))
    if order == 1:
        return np.asarray(1.0 - np.cos(turn))
    if order == 2:
        return np.asarray(2.0 * np.pi * np.sin(turn))
    return np.asarray(4.0 * np.pi**2 * np.cos(turn))


PI = np.pi
SINE = 1.0 / (PI + 4.0)
TRAPEZOID = 1.0 / (PI + 2.0)
#: Lift, slope and curvature of the modified trapezoid at u = 1/8, where the sine ends.
AT_EIGHTH = TRAPEZOID * np.array([0.25 - 0.5 / PI, 2.0, 8.0 * PI])
#: Slope at u = 3/8, where the constant acceleration ends; with its lift the curve meets (½, ½).
SLOPE_AT_THREE = TRAPEZOID * (2.0 + 2.0 * PI)


def _wave(constant: float, slope: float, size: float, frequency: float, phase: float) -> Curve:
    """Constant + slope·u − size·sin(frequency·u + phase), with its derivatives."""

    def curve(u: FloatArray, order: int) -> FloatArray:
        turned = size * frequency**order * np.sin(frequency * u + phase + 0.5 * PI * order)
        line = (constant + slope * u, np.full_like(u, slope))
        return np.asarray((line[order] if order < 2 else 0.0) - turned)

    return curve


def _constant_acceleration(u: FloatArray, order: int) -> FloatArray:
    lift, slope, curvature = AT_EIGHTH
    v = u - 0.125
    terms = (lift + slope * v + 0.5 * curvature * v**2, slope + curvature * v, curvature + 0.0 * v)
    return np.asarray(terms[order] if order < 3 else 0.0 * v)


def _turned(curve: Curve, u: FloatArray, order: int) -> FloatArray:
    """The rise's second half, 1 − s(1 − u)."""
    value = curve(1.0 - u, order)
    return np.asarray(1.0 - value if order == 0 else value * (-1.0) ** (order + 1))


def _whole(first: list[Section], middle: Section) -> list[Section]:
    last = [(1.0 - b, 1.0 - a, partial(_turned, curve)) for a, b, curve in reversed(first)]
    return [*first, middle, *last]


#: s = (πu − sin(4πu)/4)/(π + 4) to 1/8, then (2 + πu − 9/4·sin((4πu + π)/3))/(π + 4) to 7/8.
MODIFIED_SINE = _whole(
    [(0.0, 0.125, _wave(0.0, PI * SINE, 0.25 * SINE, 4.0 * PI, 0.0))],
    (0.125, 0.875, _wave(2.0 * SINE, PI * SINE, 2.25 * SINE, 4.0 * PI / 3.0, PI / 3.0)),
)
#: s = (2u − sin(4πu)/2π)/(π + 2) to 1/8, a parabola to 3/8, then again a sine to 5/8.
MODIFIED_TRAPEZOID = _whole(
    [
        (0.0, 0.125, _wave(0.0, 2.0 * TRAPEZOID, 0.5 * TRAPEZOID / PI, 4.0 * PI, 0.0)),
        (0.125, 0.375, _constant_acceleration),
    ],
    (
        0.375,
        0.625,
        _wave(0.5 - 0.5 * SLOPE_AT_THREE, SLOPE_AT_THREE, -0.5 * TRAPEZOID / PI, 4.0 * PI, 0.0),
    ),
)
