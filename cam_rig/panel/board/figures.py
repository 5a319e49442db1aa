"""Figures of a motion law on the drawing board: its peaks, its rise, and its joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from cam_rig.laws import Law
from cam_rig.laws.cam import segment_angles
from cam_rig.laws.law import Extreme, continuity, extremes
from cam_rig.schema import CamConfig
from cam_rig.units import TURN

#: Orders of the derivatives whose peaks are displayed: s', s'' and s'''.
PEAK_ORDERS = (1, 2, 3)
#: Smallest change of the lift over a segment that counts as a rise, relative to the lift. A smaller
#: one is rounding.
RISE_RTOL = 1e-9


@dataclass(frozen=True)
class RiseRange:
    """Rise of a cam: adjacent segments, each of which ends higher than it starts.

    `start` (cam angle) and `span` are in rad, and `height` is in m.
    """

    start: float
    span: float
    height: float

    def pieces(self, law: Law) -> Sequence[int]:
        """Return the indices of the polynomial pieces of a law in the rise."""
        middles = law.breaks[:-1] + 0.5 * law.spans
        return np.flatnonzero((middles - self.start) % TURN < self.span).tolist()


def find_rise(cam: CamConfig, law: Law) -> RiseRange | None:
    """Return the highest rise of a cam with its law, or None if no segment rises.

    A segment that rises and falls back to its start is not a rise.
    """
    starts, spans = segment_angles(cam), [segment.span.si for segment in cam.segments]
    levels = law(np.array(starts))
    heights = (np.roll(levels, -1) - levels).tolist()
    lowest = int(np.argmin(levels))  # no rise contains its start
    indices = [(lowest + i) % len(starts) for i in range(len(starts))]
    rises = []
    for is_rising, run in groupby(indices, lambda i: heights[i] > RISE_RTOL * law.lift):
        if is_rising:
            parts = list(run)
            span, height = sum(spans[i] for i in parts), sum(heights[i] for i in parts)
            rises.append(RiseRange(starts[parts[0]], span, height))
    return max(rises, key=lambda rise: rise.height, default=None)


def law_figures(law: Law, rise: RiseRange | None) -> dict[str, Any]:
    """Return the peaks of s' to s''' over the turn, and the class of the roughest joint.

    A peak has the largest and the least value (m/rad^order) with their cam angles (deg), and the
    coefficient of the rise. The coefficient is the largest magnitude in the rise, multiplied by
    span^order/height. It is None without a rise.
    """
    return {
        "continuity": continuity(law),
        "peaks": [_peak(law, rise, order) for order in PEAK_ORDERS],
    }


def _peak(law: Law, rise: RiseRange | None, order: int) -> dict[str, Any]:
    least, largest = extremes(law, order)
    coefficient = None
    if rise is not None:
        magnitude = max(abs(end.value) for end in extremes(law, order, rise.pieces(law)))
        coefficient = magnitude * rise.span**order / rise.height
    return {"largest": _at(largest), "least": _at(least), "coefficient": coefficient}


def _at(extreme: Extreme) -> dict[str, float]:
    return {"value": extreme.value, "angle_deg": math.degrees(extreme.angle) % 360.0}
