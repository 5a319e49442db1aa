"""A law through measured points: the periodic smoothing spline of degree 5.

The spline is FITPACK's (Dierckx, *Curve and Surface Fitting with Splines*, ch. 6): it takes the
fewest knots whose least-squares residual can reach the tolerance, and among the splines on them
the one whose jumps of the fifth derivative are smallest. It is C⁴ all around.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.arrays import FloatArray, rms
from cam_rig.errors import LawError
from cam_rig.laws.families.b_spline import bezier_pieces
from cam_rig.laws.pieces import Pieces, turned_to_zero
from cam_rig.units import TURN

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The law's pieces, and how far (m) they are from the points."""

    pieces: Pieces
    rms: float
    largest: float


def smooth(angles: FloatArray, lifts: FloatArray, tolerance: float) -> Smoothed:
    """The smoothest spline within ``tolerance`` (m, r.m.s.) of points (rad, m) of one turn.

    A last point that repeats the first a turn later is averaged with it.

    Raises
    ------
    LawError : the tolerance is too small for a spline to reach
    """
    if angles[-1] - angles[0] > TURN * (1.0 - 1e-12):
        lifts = np.concatenate([[0.5 * (lifts[0] + lifts[-1])], lifts[1:-1]])
        angles = angles[:-1]
    spline = _spline(angles, lifts, tolerance)
    away = np.abs(spline(angles) - lifts)
    pieces = turned_to_zero(bezier_pieces(spline), TURN)
    return Smoothed(pieces, rms(away), float(away.max()))


def _spline(angles: FloatArray, lifts: FloatArray, tolerance: float) -> BSpline[np.float64]:
    from scipy.interpolate import BSpline, make_interp_spline, splrep

    x, y = np.append(angles, angles[0] + TURN), np.append(lifts, lifts[0])
    if tolerance == 0.0:
        return make_interp_spline(x, y, k=DEGREE, bc_type="periodic")
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            knots = splrep(x, y, k=DEGREE, s=angles.size * tolerance**2, per=True)
        except RuntimeWarning:
            raise LawError(
                f"no spline comes within {tolerance * 1e3:g} mm r.m.s. of the {angles.size} "
                "points; allowed: a larger tolerance, or 0 to go through every point"
            ) from None
    return BSpline(*knots)
