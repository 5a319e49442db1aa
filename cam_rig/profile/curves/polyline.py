"""A closed polyline along a path, with few points and a proven chord error.

The path is cut where the law's slope or acceleration jumps: there the path has a corner, steps
along a face, or bends otherwise at once, and a vertex stands on each side.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.laws.continuity import joints
from cam_rig.profile.curves.path import ContourPath
from cam_rig.units import TURN

#: Samples of the path for a first guess, and at least so many in each chord for the proof.
GUESS, IN_CHORD = 8192, 12
#: No chord is longer than this fraction of the path: straight parts would have none.
LONGEST = 1.0 / 90.0
#: More points at each trial, and how often it is tried.
MORE, TRIALS = 1.08, 12
#: Less is within the rounding of a metre, m.
FINEST = 1e-11


def polyline(path: ContourPath, tolerance: float) -> FloatArray:
    """``(2, n)`` points on the path, m; no chord between two is farther than ``tolerance`` (m).

    Points are dense where the curvature is. The chord error is measured on samples of the path
    between the points, and points are added until it holds.

    Raises
    ------
    ProfileError : the tolerance is too fine
    """
    if not tolerance >= FINEST:
        raise ProfileError(
            f"tolerance is {tolerance * 1e6:.3g} µm; allowed: at least {FINEST * 1e6:g} µm"
        )
    stretches = [_samples(path, low, high) for low, high in pairwise(_cuts(path.law))]
    longest = LONGEST * sum(float(step.sum()) for _, step, _ in stretches)
    found = np.concatenate([_stretch(path, *one, longest, tolerance) for one in stretches], axis=1)
    step = np.hypot(*(found - np.roll(found, 1, axis=1)))
    return found[:, step > FINEST]  # both sides of a joint may be one point


def _cuts(law: Law) -> list[float]:
    """Cam angles (rad) where s' or s'' jumps, with the ends of the turn."""
    rough = [joint.angle for joint in joints(law) if joint.continuity < 2]
    return sorted({0.0, TURN, *rough})


def _samples(
    path: ContourPath, low: float, high: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cam angles of a smooth stretch (rad), the steps of the path between (m), its bend (1/m).

    The stretch ends just before ``high``, where the law still is that of the stretch.
    """
    count = max(IN_CHORD, round(GUESS * (high - low) / TURN))
    angle = np.linspace(low, np.nextafter(high, low), count + 1)
    points, radius, _ = path.at(angle)
    step = np.hypot(*np.diff(points, axis=1))
    bend = np.abs(1.0 / np.where(radius == 0.0, np.inf, radius))
    return angle, step, 0.5 * (bend[1:] + bend[:-1])


def _stretch(
    path: ContourPath,
    angle: FloatArray,
    step: FloatArray,
    bend: FloatArray,
    longest: float,
    tolerance: float,
) -> FloatArray:
    """Points of a smooth stretch, with both its ends."""
    chords = step * np.maximum(np.sqrt(bend / (8.0 * tolerance)), 1.0 / longest)
    passed = np.append(0.0, np.cumsum(chords))
    count = max(1, int(np.ceil(passed[-1])))
    for _ in range(TRIALS):
        nodes = np.interp(np.linspace(0.0, passed[-1], count + 1), passed, angle)
        nodes[[0, -1]] = angle[[0, -1]]
        found, error = _chord_error(path, nodes)
        if error <= tolerance:
            return found
        count = int(np.ceil(count * MORE * max(1.0, min(4.0, np.sqrt(error / tolerance)))))
    raise ProfileError(
        f"a polyline of {count} points is {error * 1e6:.3g} µm off; allowed: {tolerance * 1e6:.3g} "
        "µm; let the tolerance be coarser"
    )


def _chord_error(path: ContourPath, nodes: FloatArray) -> tuple[FloatArray, float]:
    """Points at the nodes, and how far the path is from the chords between them, m."""
    share = np.arange(IN_CHORD) / IN_CHORD
    angle = nodes[:-1, None] + share * np.diff(nodes)[:, None]
    every = path.at(np.append(angle.ravel(), nodes[-1]))[0]
    points = every[:, :-1].reshape(2, *angle.shape)
    ends = np.append(points[:, :, 0], every[:, -1:], axis=1)
    begin = points[:, :, :1]
    chord = np.diff(ends, axis=1)[:, :, None]
    length = np.maximum(np.hypot(*chord), 1e-300)
    inside = points - begin
    along = np.clip((inside * chord).sum(axis=0) / length**2, 0.0, 1.0)
    error = np.hypot(*(inside - along * chord)).max()
    return ends, float(error)
