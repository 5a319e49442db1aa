"""Largest and smallest value of a derivative over the turn, from roots, not from samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.laws import bernstein
from cam_rig.laws.law import Law

#: Of values that differ by less than this fraction of the largest ordinate the first is taken.
TIE = 1e-12


@dataclass(frozen=True)
class Extreme:
    """A value of a derivative (m/rad^order) and the cam angle (rad) where it is reached."""

    value: float
    angle: float


def extremes(law: Law, order: int) -> tuple[Extreme, Extreme]:
    """Smallest and largest value of the derivative of an order.

    Candidates are the ends of each piece, so both sides of a joint, and inside each piece every
    root of the next derivative.
    """
    here = law.derivative_ordinates(order)
    slope = law.derivative_ordinates(order + 1)
    low = high = Extreme(float(here[0, 0]), 0.0)
    tie = TIE * float(np.abs(here).max())
    for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
        at = np.array([0.0, *bernstein.crossings(slope[:, i]), 1.0])
        values = bernstein.evaluate(here[:, i], at)
        worst, best = int(np.argmin(values)), int(np.argmax(values))
        if values[worst] < low.value - tie:
            low = Extreme(float(values[worst]), float(start + span * at[worst]))
        if values[best] > high.value + tie:
            high = Extreme(float(values[best]), float(start + span * at[best]))
    return low, high


def peak(law: Law, order: int) -> Extreme:
    """The extreme of largest magnitude, with its sign."""
    low, high = extremes(law, order)
    return low if -low.value > high.value else high
