"""B-splines over knots, as the Bézier curves they are made of (profile thesis §2.1.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws.pieces import Pieces

if TYPE_CHECKING:  # a quarter of a node's imports, which few cams need
    from scipy.interpolate import BSpline


def greville(knots: FloatArray, degree: int) -> FloatArray:
    """``(m,)`` Greville abscissae ξᵢ = (uᵢ + … + uᵢ₊ₙ₋₁)/n of m control points (eq. 2.8).

    ``knots`` are the m + n − 1 of the thesis, the ends n times.
    """
    windows = np.lib.stride_tricks.sliding_window_view(knots, degree)
    return np.asarray(windows.mean(axis=1))


def pieces(knots: FloatArray, ordinates: FloatArray, degree: int) -> Pieces:
    """Bézier pieces of the B-spline with the thesis's knots, the ends ``degree`` times."""
    from scipy.interpolate import BSpline

    outer = np.concatenate([knots[:1], knots, knots[-1:]])  # scipy counts one more at each end
    return bezier_pieces(BSpline(outer, ordinates, degree))


def bezier_pieces(spline: BSpline[np.float64]) -> Pieces:
    """The Bézier curves of a spline, over its domain.

    Each inner knot is inserted until it stands ``degree`` times; the control points then are
    the Bézier ordinates. Insertion takes convex combinations, so it is as accurate as they are.
    """
    from scipy.interpolate import insert  # BSpline.insert_knot, its equal, is newer

    n = spline.k
    breaks = np.unique(spline.t[n : spline.t.size - n])
    for knot in breaks:
        missing = n - int(np.count_nonzero(spline.t == knot))
        if missing > 0:
            spline = insert(knot, spline, missing)
    last = np.searchsorted(spline.t, breaks[:-1], side="right") - 1
    columns = [np.array(spline.c[j - n : j + 1], dtype=np.float64) for j in last.tolist()]
    return breaks.tolist(), columns
