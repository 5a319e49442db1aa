"""SVG drawings of closed polylines at scale 1: black on white, one unit of the page is 1 mm."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cam_rig.arrays import FloatArray

MM = 1e3
MARGIN_MM = 5.0
#: Decimals of a millimetre that there are at least: the lines are 0.25 mm wide.
COARSEST_DIGITS = 2
PAGE = """\
<?xml version="1.0" encoding="utf-8"?>
<svg xmlns="http://www.w3.org/2000/svg" width="{0}mm" height="{1}mm" viewBox="0 0 {0} {1}">
<rect width="{0}" height="{1}" fill="white"/>
<g fill="none" stroke="black" stroke-width="0.25" stroke-linejoin="round">
{2}
</g>
</svg>
"""


def write_svg(path: Path, curves: dict[str, FloatArray], rounding: float) -> None:
    """Write closed polylines by name, ``(2, n)`` points in m, as one path each.

    The page is whole millimetres wide and high, with 5 mm left free around the curves. Points
    are absolute, so that what a reader rounds does not add up, and off by ``rounding`` (m) at most.
    """
    digits = max(COARSEST_DIGITS, math.ceil(-math.log10(math.sqrt(2.0) * MM * rounding)))
    every = MM * np.concatenate(list(curves.values()), axis=1)
    corner = np.array([every[0].min() - MARGIN_MM, every[1].max() + MARGIN_MM])
    width, height = np.ceil(np.ptp(every, axis=1) + 2.0 * MARGIN_MM).astype(int)
    paths = []
    for name, points in curves.items():
        placed = (MM * points.T - corner) * [1.0, -1.0]  # y of a page is down
        words = " ".join(f"{x:.{digits}f},{y:.{digits}f}" for x, y in placed.tolist())
        paths.append(f'<path id="{name}" d="M {words} Z"/>')
    path.write_text(PAGE.format(width, height, "\n".join(paths)), encoding="utf-8")
