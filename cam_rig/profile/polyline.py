"""A closed polyline along a path, with few points and a proven chord error.

Where the law's slope or acceleration jumps the path has a corner, or bends otherwise at once: a
vertex stands on each side.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cam_rig.errors import ConfigError, ProfileError
from cam_rig.laws import Law
from cam_rig.laws.law import joints
from cam_rig.profile.checks import sharpest_concave
from cam_rig.profile.contact import Motion, Scan
from cam_rig.profile.disc import Contour, Disc, discs
from cam_rig.profile.faces import GuidedFace, SwungFace
from cam_rig.schema.cam import Follower
from cam_rig.units import TURN, FloatArray

# What a machine or a drawing follows: the contour, the pitch curve, the path of a cutter.


@dataclass(frozen=True, eq=False)
class ContourPath:
    """A closed curve ``offset`` (m) outside a disc's contour."""

    name: str
    disc: Disc
    law: Law
    offset: float = 0.0

    def at(self, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points ``(2, n)`` m, radius of curvature m and pressure angle rad at cam angles, rad."""
        return self.of(Motion.at(self.law, angle))

    def of(self, motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same at the angles of a motion."""
        contour = Contour.of(self.disc, motion)
        points = contour.points + self.offset * contour.normal
        return points, contour.radius + self.offset, contour.pressure

    def require_room(self) -> None:
        """Refuse a cutter that is too large for a concave part of the contour."""
        found = sharpest_concave(Scan(self.law, self.disc.element))
        if found is not None and found.value <= self.offset:
            raise ProfileError(
                f"cutter radius is {self.offset * 1e3:.6g} mm; allowed: less than the concave "
                f"radius of curvature {found.value * 1e3:.6g} mm at "
                f"{np.degrees(found.angle):.4g}°; let the cutter be smaller"
            )


def contour_paths(
    follower: Follower, law: Law, kind: str = "CAM", offset: float = 0.0
) -> list[ContourPath]:
    """The contours, or paths ``offset`` (m) outside of them such as a cutter's, one a disc."""
    return [
        ContourPath(f"{kind}_{disc.name.upper()}" if disc.name else kind, disc, law, offset)
        for disc in discs(follower, law)
    ]


def pitch_paths(follower: Follower, law: Law) -> list[ContourPath]:
    """The pitch curves; of a point follower the contours."""
    paths = contour_paths(follower, law, "PITCH", follower.roller)
    if isinstance(paths[0].disc.element, GuidedFace | SwungFace):
        raise ConfigError(
            f"a {follower.type} follower has no pitch curve; allowed: a roller or a point, or the "
            "path of a cutter by its radius"
        )
    return paths


#: Samples of the path for a first guess, and at least so many in each chord for the proof.
GUESS, IN_CHORD = 8192, 12
#: No chord is longer than this fraction of the path: straight parts would have none.
LONGEST = 1.0 / 90.0
#: More points at each trial, and how often it is tried.
MORE, TRIALS = 1.08, 12
#: Less is within the rounding of a metre, m.
FINEST = 1e-11
#: Of a smooth stretch: cam angles (rad), steps of the path between (m), its curvature (1/m).
Samples = tuple[FloatArray, FloatArray, FloatArray]


def polyline(path: ContourPath, tolerance: float) -> FloatArray:
    """``(2, n)`` points on the path, m; no chord between two is farther than ``tolerance`` (m)."""
    if not tolerance >= FINEST:
        raise ProfileError(
            f"tolerance is {tolerance * 1e6:.3g} µm; allowed: at least {FINEST * 1e6:g} µm"
        )
    rough = [joint.angle for joint in joints(path.law) if joint.continuity < 2]
    cuts = sorted({0.0, TURN, *rough})
    stretches = [_samples(path, low, high) for low, high in pairwise(cuts)]
    longest = LONGEST * sum(float(step.sum()) for _, step, _ in stretches)
    found = np.concatenate([_line(path, one, longest, tolerance) for one in stretches], axis=1)
    step = np.hypot(*(found - np.roll(found, 1, axis=1)))
    return found[:, step > FINEST]  # both sides of a joint may be one point


def _samples(path: ContourPath, low: float, high: float) -> Samples:
    """From ``low`` to just before ``high`` (rad), where the law still is that of the stretch."""
    count = max(IN_CHORD, round(GUESS * (high - low) / TURN))
    angle = np.linspace(low, np.nextafter(high, low), count + 1)
    points, radius, _ = path.at(angle)
    step = np.hypot(*np.diff(points, axis=1))
    curvature = np.abs(1.0 / np.where(radius == 0.0, np.inf, radius))
    return angle, step, 0.5 * (curvature[1:] + curvature[:-1])


def _line(path: ContourPath, one: Samples, longest: float, tolerance: float) -> FloatArray:
    """Points of a smooth stretch, with both its ends."""
    angle, step, curvature = one
    chords = step * np.maximum(np.sqrt(curvature / (8.0 * tolerance)), 1.0 / longest)
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
