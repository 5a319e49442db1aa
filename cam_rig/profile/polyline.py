"""A closed polyline along a path, with few points and a proven chord error."""

from __future__ import annotations

import numpy as np

from cam_rig.errors import ProfileError
from cam_rig.laws import TURN
from cam_rig.laws.bernstein import FloatArray
from cam_rig.profile.path import Path

#: Samples of the path for a first guess, and at least so many in each chord for the proof.
GUESS, IN_CHORD = 8192, 12
#: No chord is longer than this fraction of the path: straight parts would have none.
LONGEST = 1.0 / 90.0
#: More points at each trial, and how often it is tried.
MORE, TRIALS = 1.08, 12
#: Less is within the rounding of a metre, m.
FINEST = 1e-11


def polyline(path: Path, tolerance: float) -> FloatArray:
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
    angle = np.linspace(0.0, TURN, GUESS + 1)
    points, radius, _ = path.at(angle)
    step = np.hypot(*np.diff(points, axis=1))
    bend = np.abs(1.0 / np.where(radius == 0.0, np.inf, radius))
    bend = 0.5 * (bend[1:] + bend[:-1])
    chords = step * np.maximum(np.sqrt(bend / (8.0 * tolerance)), 1.0 / (LONGEST * step.sum()))
    passed = np.append(0.0, np.cumsum(chords))
    count = int(np.ceil(passed[-1]))
    for _ in range(TRIALS):
        nodes = np.interp(np.linspace(0.0, passed[-1], count + 1), passed, angle)
        found, error = _chord_error(path, nodes)
        if error <= tolerance:
            return found
        count = int(np.ceil(count * MORE * max(1.0, min(4.0, np.sqrt(error / tolerance)))))
    raise ProfileError(
        f"a polyline of {count} points is {error * 1e6:.3g} µm off; allowed: {tolerance * 1e6:.3g} "
        "µm; let the tolerance be coarser"
    )


def _chord_error(path: Path, nodes: FloatArray) -> tuple[FloatArray, float]:
    """Points at the nodes but the last, and how far the path is from the chords, m."""
    share = np.arange(IN_CHORD) / IN_CHORD
    angle = nodes[:-1, None] + share * np.diff(nodes)[:, None]
    points = path.at(angle.ravel())[0].reshape(2, *angle.shape)
    begin = points[:, :, :1]
    chord = np.roll(begin, -1, axis=1) - begin
    length = np.maximum(np.hypot(*chord), 1e-300)
    inside = points - begin
    along = np.clip((inside * chord).sum(axis=0) / length**2, 0.0, 1.0)
    error = np.hypot(*(inside - along * chord)).max()
    return begin[:, :, 0], float(error)
